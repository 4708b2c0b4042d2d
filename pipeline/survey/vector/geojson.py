"""Reader of GeoJSON: polygons of workings, or lines of walls."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import shapely

from pipeline.errors import InputError
from pipeline.guard.plain_file import read_text_bytes, require_at_most
from pipeline.survey.vector.shapes import Shapes, require_size


def read_geojson(path: Path, layers: list[str] | None) -> Shapes:
    """Read polygons and lines.

    Parameters
    ----------
    path : Path
    layers : list of str or None
        Read only the features whose property `layer` is in this list; None reads all features.

    Raises
    ------
    InputError
        If the file is not GeoJSON.

    References
    ----------
    RFC 7946. The member `crs` is from the 2008 specification; GDAL still writes it for other systems than WGS 84.
    """
    data = read_text_bytes(path)
    require_size(path, data.count(b"[") // 2)  # before anything is built; a point has one bracket, a ring few more
    try:
        content = json.loads(data)
        features = _features(content)
        require_at_most(path, len(features), "shapes", "features")
        chosen = [feature for feature in features if layers is None or _layer(feature) in layers]
        drawn = [feature for feature in chosen if feature["geometry"] is not None]
        shapes = [shapely.from_geojson(json.dumps(feature["geometry"])) for feature in drawn]
        layer_of = [_layer(feature) for feature in drawn]
    except (ValueError, TypeError, KeyError, RecursionError, shapely.GEOSException, AttributeError) as error:
        raise InputError(f"{path}: not GeoJSON ({str(error)[:120]})") from error
    if "note" in content and "metres" in str(content["note"]):  # this project's own artifacts
        return Shapes(shapes, "m", layer_of=layer_of)
    crs = content.get("crs") or {}
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    return Shapes(shapes, None, str(name) if name else "OGC:CRS84", layer_of)


def _features(content: Any) -> list[dict]:
    if not isinstance(content, dict) or "type" not in content:
        raise ValueError("no member `type`")
    if content["type"] == "FeatureCollection":
        return list(content["features"])
    return [content if content["type"] == "Feature" else {"type": "Feature", "geometry": content}]


def _layer(feature: dict) -> str:
    return str((feature.get("properties") or {}).get("layer"))
