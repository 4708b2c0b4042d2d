"""Reader of GeoPackage and Shapefile by GDAL (pyogrio)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyogrio
import shapely
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.guard.plain_file import require_at_most
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.vector.shapes import Shapes, require_size

_READ_ERRORS = tuple(
    getattr(pyogrio.errors, name)
    for name in ("DataSourceError", "DataLayerError", "FeatureError", "GeometryError", "FieldError", "CRSError")
)
# GDAL chooses a driver by the content, and some drivers open other files that the content names. So check the content.
_MAGIC = {".gpkg": b"SQLite format 3\x00", ".shp": b"\x00\x00\x27\x0a"}


def read_geodata(path: Path, layers: list[str] | None) -> Shapes:
    """Read polygons and lines of the given layers; None reads all layers.

    Raises
    ------
    InputError
        If the content does not match the suffix, a layer is unknown (the message lists the layers), or the layers have
        different coordinate systems.
    """
    most = reader_limits().file_bytes
    if path.stat().st_size > most:
        raise InputError(f"{path}: {path.stat().st_size} bytes, the limit is {most} (file_bytes in {FILE})")
    if path.open("rb").read(len(_MAGIC[path.suffix.lower()])) != _MAGIC[path.suffix.lower()]:
        raise InputError(f"{path}: not a {'GeoPackage' if path.suffix.lower() == '.gpkg' else 'Shapefile'}")
    odd = [p for p in sorted(path.parent.iterdir()) if p.name.startswith(f"{path.stem}.") and not p.is_file()]
    if odd:  # GDAL would open it, and wait for ever at a pipe
        raise InputError(f"{path}: {odd[0].name} beside it is not a plain file")
    source = _plain_database(path) if path.suffix.lower() == ".gpkg" else path
    try:
        existing = [str(name) for name in pyogrio.list_layers(source)[:, 0]]
        unknown = sorted(set(layers or []) - set(existing))
        if unknown:
            raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(existing)}")
        shapes: list[BaseGeometry] = []
        systems, points = set(), 0
        layer_of: list[str] = []
        for layer in layers or existing:
            most = reader_limits().shapes + 1 - len(shapes)
            meta, _, wkb, _ = pyogrio.raw.read(source, layer=layer, columns=[], max_features=most)
            if wkb is None:
                continue
            layer_shapes = _decoded(path, layer, wkb)
            require_at_most(path, len(shapes) + len(wkb), "shapes", "shapes or more")
            points += int(shapely.get_num_coordinates(layer_shapes).sum())
            require_size(path, points)
            shapes += layer_shapes
            layer_of += [layer] * len(layer_shapes)
            systems.add(meta.get("crs"))
    # pyogrio raises UnboundLocalError on a broken .prj
    except (*_READ_ERRORS, shapely.GEOSException, ValueError, UnboundLocalError) as error:
        raise InputError(f"{path}: cannot be read ({str(error).splitlines()[0][:160]})") from error
    if len(systems) > 1:
        raise InputError(
            f"{path}: its layers have different coordinate systems; choose layers with one system by survey.layers"
        )
    return Shapes(shapes, None, next(iter(systems), None), layer_of)


def _decoded(path: Path, layer: str, wkb: np.ndarray) -> list[BaseGeometry]:
    """Return a layer's shapes; features without one are left out, a broken one is refused."""
    shapes = shapely.from_wkb(wkb, on_invalid="ignore")
    broken = [number for number, (data, shape) in enumerate(zip(wkb, shapes, strict=True), 1) if data and shape is None]
    if broken:
        raise InputError(
            f"{path}: {len(broken)} of {len(wkb)} shapes in layer {layer!r} are broken, the first is number {broken[0]}"
        )
    return [shape for shape in shapes if shape is not None]


def _plain_database(path: Path) -> bytes:
    """Return a GeoPackage's bytes without its mark for a write-ahead log.

    SQLite reads the copy in memory, so it makes no files beside the original and follows no journal there.
    """
    log = path.with_name(f"{path.name}-wal")
    if log.is_file() and log.stat().st_size:
        raise InputError(f"{path}: {log.name} holds changes that are not in the file; close it in its program first")
    data = bytearray(path.read_bytes())
    if data[18:20] == b"\x02\x02":
        data[18:20] = b"\x01\x01"
    return bytes(data)


def companions(path: Path) -> list[Path]:
    """Return the companion files of a Shapefile (.shx, .dbf, .prj, .cpg); none for other formats."""
    if path.suffix.lower() != ".shp":
        return []
    same_stem = (p for p in sorted(path.parent.iterdir()) if p.stem == path.stem and p.is_file())
    return [p for p in same_stem if p.suffix.lower() in (".shx", ".dbf", ".prj", ".cpg")]
