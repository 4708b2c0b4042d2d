"""Drawings, geodata and tables, written by the programs of others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pyogrio
import shapely
import trimesh
from shapely import LineString, Polygon

from tests.survey.advice.of_pictures import picture


def geojson(
    folder: Path,
    shapes: list[Any],
    kind: str = "LineString",
    fields: list[dict[str, Any]] | None = None,
    scale: float = 1.0,
) -> Path:
    """Write lines, or polygons of one ring each, without a coordinate system of its own: GeoJSON is in degrees."""
    features = []
    for k, shape in enumerate(shapes):
        places = (scale * np.array(shape, dtype=float)).tolist()
        geometry = {"type": kind, "coordinates": [places] if kind == "Polygon" else places}
        features.append({"type": "Feature", "properties": fields[k] if fields else {}, "geometry": geometry})
    path = folder / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def dxf(folder: Path, layers: dict[str, list[Any]], unit: int = 6, closed: bool = False, scale: float = 1.0) -> Path:
    """Write lines on layers."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = unit
    space = document.modelspace()
    for layer, lines in layers.items():
        for places in lines:
            line = (scale * np.array(places, dtype=float)).tolist()
            if len(line[0]) > 2:
                space.add_polyline3d(line, dxfattribs={"layer": layer}, close=closed)
            else:
                space.add_lwpolyline(line, dxfattribs={"layer": layer}, close=closed)
    document.saveas(folder / "a.dxf")
    return folder / "a.dxf"


def points(folder: Path, name: str) -> Path:
    """Write points with heights."""
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [x, 2.0, 5.0 + x / 50]}}
        for x in range(0, 61, 10)
    ]
    (folder / name).write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return folder / name


def faces(folder: Path) -> Path:
    """Write a box of faces."""
    document = ezdxf.new("R2010", units=6)
    mesh = trimesh.creation.box((60.0, 4.0, 3.0))
    for corners in mesh.triangles.tolist():
        document.modelspace().add_3dface(corners)
    document.saveas(folder / "a.dxf")
    return folder / "a.dxf"


def placed(folder: Path) -> Path:
    """Write a drawing on which a picture is."""
    document = ezdxf.new("R2010", units=6)
    image = document.add_image_def(picture(folder).name, (700, 380))
    document.modelspace().add_image(image, (0, 0), (90, 50))
    document.saveas(folder / "a.dxf")
    return folder / "a.dxf"


def csv(folder: Path, text: str) -> Path:
    """Write a table."""
    (folder / "a.csv").write_text(text)
    return folder / "a.csv"


def svx(folder: Path, text: str) -> Path:
    """Write Survex data."""
    (folder / "a.svx").write_text(text)
    return folder / "a.svx"


def lifted(lines: list[Any], heights: list[float]) -> list[Any]:
    """Return lines with elevations."""
    return [[[*point, z] for point in line] for line, z in zip(lines, heights, strict=True)]


def geopackage(folder: Path, layers: dict[str, list[Any]], systems: dict[str, str], scale: float = 1.0) -> Path:
    """Write lines, or areas of closed ones, each layer in its coordinate system."""
    path = folder / "a.gpkg"
    path.unlink(missing_ok=True)
    for name, lines in layers.items():
        rings = [scale * np.array(line, dtype=float) for line in lines]
        closed = np.array_equal(rings[0][0], rings[0][-1])
        shapes = shapely.to_wkb(np.array([Polygon(ring) if closed else LineString(ring) for ring in rings], object))
        kind = ("Polygon" if closed else "LineString") + " Z" * (rings[0].shape[1] > 2)
        pyogrio.raw.write(path, shapes, [], [], layer=name, geometry_type=kind, crs=systems[name])
    return path
