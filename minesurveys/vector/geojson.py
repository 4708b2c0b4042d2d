"""Reader of GeoJSON: polygons of workings, or lines of walls."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.vector.level_fields import require_field, text_of
from minesurveys.vector.other_kinds import NO_GEOMETRY
from minesurveys.vector.shapes import LARGEST, Shapes, require_plain_coordinates, require_size

_NO_NUMBER = re.compile(r"-?(?:NaN|Infinity|\d{300,})\b")  # as Python writes what is no JSON, or no float


def read_geojson(path: Path, layers: list[str] | None, level_by: str | None = None) -> Shapes:
    """Read polygons and lines.

    GDAL leaves out broken geometries without an error: findings/gdal-geojson-broken-geometry-is-none.sh.

    Parameters
    ----------
    path : Path
    layers : list of str or None
        Read only the features whose property `layer` is in this list; None reads all features.
    level_by : str or None
        The property that is a feature's layer in the result; None is `layer`.

    Raises
    ------
    InputError
        If the file is not GeoJSON, or no feature has the property `level_by`.

    References
    ----------
    RFC 7946. The member `crs` is from the 2008 specification; GDAL still writes it for other systems than WGS 84.
    """
    data = read_text_bytes(path)
    require_size(path, data.count(b"[") // 2)  # before anything is built; a point has one bracket, a ring few more
    try:
        content = json.loads(data)
        _require_no_other_json(path, content)
        features = _features(content)
        require_at_most(path, len(features), "shapes", "features")
        chosen = [feature for feature in features if layers is None or _layer(feature) in layers]
        numbers = {id(feature): number for number, feature in enumerate(features, 1)}
        drawn = [feature for feature in chosen if feature["geometry"] is not None]
        shapes = [_shape(path, numbers[id(feature)], feature["geometry"]) for feature in drawn]
        require_plain_coordinates(path, shapes, [f"feature {numbers[id(feature)]}" for feature in drawn])
        fields = list(dict.fromkeys(name for feature in drawn for name in (feature.get("properties") or {})))
        if level_by is not None:
            require_field(path, level_by, fields)
        layer_of = [_layer(feature, level_by) for feature in drawn]
    except InputError:
        raise
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not GeoJSON: its byte {error.start} is no UTF-8 text") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: not GeoJSON: line {error.lineno}, column {error.colno} is no JSON") from error
    except RecursionError as error:
        raise InputError(f"{path}: not GeoJSON: its lists are nested too deep") from error
    except (ValueError, TypeError, KeyError, shapely.GEOSException, AttributeError) as error:
        raise InputError(
            f"{path}: not GeoJSON: a feature or its geometry lacks what RFC 7946 asks for (type, features, geometry, "
            "coordinates)"
        ) from error
    others = {NO_GEOMETRY: len(chosen) - len(drawn)} if len(chosen) > len(drawn) else {}
    if "note" in content and "metres" in str(content["note"]):  # this project's own artifacts
        return Shapes(shapes, "m", layer_of=layer_of, others=others, fields=fields)
    crs = content.get("crs") or {}
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    return Shapes(shapes, None, str(name) if name else "OGC:CRS84", layer_of, others, fields)


def _shape(path: Path, number: int, geometry: Any) -> BaseGeometry:
    """Return a feature's shape; `InputError` names the feature if it cannot be read, and a coordinate that is none."""
    text = json.dumps(geometry)
    try:
        return shapely.from_geojson(text)
    except (ValueError, TypeError, shapely.GEOSException) as error:
        found = _NO_NUMBER.search(text)
        if found is None:
            raise
        raise InputError(
            f"{path}: feature {number} has the coordinate {found[0]:.20}, expected numbers below {LARGEST:g}"
        ) from error


def _require_no_other_json(path: Path, content: Any) -> None:
    """Name other programs' ways to write shapes as JSON."""
    if not isinstance(content, dict):
        return
    name = "Esri JSON" if "geometryType" in content else "TopoJSON" if content.get("type") == "Topology" else ""
    if name:
        raise InputError(f"{path}: {name}, which is not read: QGIS opens it and saves it as GeoJSON")


def _features(content: Any) -> list[dict]:
    if not isinstance(content, dict) or "type" not in content:
        raise ValueError("no member `type`")
    if content["type"] == "FeatureCollection":
        return list(content["features"])
    return [content if content["type"] == "Feature" else {"type": "Feature", "geometry": content}]


def _layer(feature: dict, field: str | None = None) -> str:
    properties = feature.get("properties") or {}
    return str(properties.get("layer")) if field is None else text_of(properties.get(field))
