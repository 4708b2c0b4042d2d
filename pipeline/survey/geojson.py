"""Reader of GeoJSON: polygons of the workings, or lines of their walls."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.survey.shapes import Shapes, read_text_bytes


def read_geojson(path: Path, layers: list[str] | None) -> Shapes:
    """Read polygons and lines.

    Parameters
    ----------
    path : Path
    layers : list of str or None
        Keeps the features whose property `layer` is one of them; None keeps all.

    Raises
    ------
    InputError
        If the file is no GeoJSON.

    References
    ----------
    RFC 7946; the member `crs` is that of the 2008 specification, still written by GDAL for other systems.
    """
    data = read_text_bytes(path)
    try:
        content = json.loads(data)
        found = [shape for feature in _features(content) if _chosen(feature, layers) for shape in _shapes(feature)]
    except (ValueError, TypeError, KeyError, RecursionError, shapely.GEOSException, AttributeError) as error:
        raise InputError(f"{path}: not GeoJSON ({str(error)[:120]})") from error
    if "note" in content and "metres" in str(content["note"]):  # our own artifacts
        return Shapes(found, "m")
    named = content.get("crs") or {}
    about = named.get("properties") if isinstance(named, dict) else None
    name = about.get("name") if isinstance(about, dict) else None
    return Shapes(found, None, str(name) if name else "OGC:CRS84")


def _features(content: Any) -> list[dict]:
    if not isinstance(content, dict) or "type" not in content:
        raise ValueError("no member `type`")
    if content["type"] == "FeatureCollection":
        return list(content["features"])
    return [content if content["type"] == "Feature" else {"type": "Feature", "geometry": content}]


def _chosen(feature: dict, layers: list[str] | None) -> bool:
    return layers is None or str((feature.get("properties") or {}).get("layer")) in layers


def _shapes(feature: dict) -> list[BaseGeometry]:
    geometry = feature["geometry"]
    return [shapely.from_geojson(json.dumps(geometry))] if geometry is not None else []
