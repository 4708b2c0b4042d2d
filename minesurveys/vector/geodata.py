"""Reader of GeoPackage and Shapefile by GDAL (pyogrio)."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import require_at_most
from minesurveys.limits import FILE, reader_limits
from minesurveys.vector.geodata_kinds import (
    CURVE,
    FLAGS,
    MEASURED,
    flags_of,
    multipatches,
    stored_kinds,
    warn_of_kinds,
    without_flagged,
)
from minesurveys.vector.level_fields import require_field, text_of
from minesurveys.vector.other_kinds import MULTIPATCH, NO_GEOMETRY
from minesurveys.vector.shapes import Shapes, require_size

# GDAL chooses a driver by the content, and some drivers open other files that the content names. So check the content.
_MAGIC = {".gpkg": b"SQLite format 3\x00", ".shp": b"\x00\x00\x27\x0a"}
# srs_id -1 of a GeoPackage: no system, though GDAL gives it metres:
# findings/gdal-geopackage-undefined-system-in-metres.sh.
_UNDEFINED = "Undefined Cartesian SRS"
_NOT_SUPPORTED = "Geometry type is not supported"  # pyogrio, of a layer declared as TIN or polyhedral surface


@dataclass
class _Found:
    """What the layers of a file hold."""

    shapes: list[BaseGeometry] = field(default_factory=list)
    layer_of: list[str] = field(default_factory=list)
    systems: set[str | None] = field(default_factory=set)
    kinds: Counter[str] = field(default_factory=Counter)
    fields: list[str] = field(default_factory=list)
    flags: list[frozenset[str]] = field(default_factory=list)
    points: int = 0


def read_geodata(path: Path, layers: list[str] | None, level_by: str | None = None) -> Shapes:
    """Read polygons and lines of the given layers; None reads all layers.

    Measures (M) are dropped and curves are read as chords, with a warning that counts them.

    Parameters
    ----------
    path : Path
    layers : list of str or None
    level_by : str or None
        The property that is a shape's layer in the result; None is the layer itself.

    Raises
    ------
    InputError
        If the content does not match the suffix, a layer or the property is unknown (the message lists them), or the
        layers have different coordinate systems.
    """
    suffix, most = path.suffix.lower(), reader_limits().file_bytes
    if path.stat().st_size > most:
        raise InputError(f"{path}: {path.stat().st_size} bytes, the limit is {most} (file_bytes in {FILE})")
    if path.open("rb").read(len(_MAGIC[suffix])) != _MAGIC[suffix]:
        raise InputError(f"{path}: not a {'GeoPackage' if suffix == '.gpkg' else 'Shapefile'}")
    odd = [p for p in sorted(path.parent.iterdir()) if p.name.startswith(f"{path.stem}.") and not p.is_file()]
    if odd:  # GDAL would open it, and wait for ever at a pipe
        raise InputError(f"{path}: {odd[0].name} beside it is not a plain file")
    source = _plain_database(path) if suffix == ".gpkg" else path
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of measures; they are counted
            found = _read_layers(path, source, layers, level_by)
    # pyogrio raises UnboundLocalError on a broken .prj
    except (*_read_errors(), shapely.GEOSException, ValueError, UnboundLocalError) as error:
        raise InputError(f"{path}: {_reason(path, str(error))}") from error
    if len(found.systems) > 1:
        raise InputError(
            f"{path}: its layers have different coordinate systems; choose layers with one system by --layer "
            "(survey.layers)"
        )
    if level_by is not None:
        require_field(path, level_by, found.fields)
    warn_of_kinds(path, found.kinds)
    others = {kind: count for kind, count in found.kinds.items() if kind not in (CURVE, MEASURED)}
    shapes = Shapes(found.shapes, None, next(iter(found.systems), None), found.layer_of, others, found.fields)
    return without_flagged(path, shapes, found.flags)


def _read_errors() -> tuple[type[Exception], ...]:
    from pyogrio import errors

    names = ("DataSourceError", "DataLayerError", "FeatureError", "GeometryError", "FieldError", "CRSError")
    return tuple(getattr(errors, name) for name in names)


def _reason(path: Path, message: str) -> str:
    """Return why GDAL does not read a file."""
    if _NOT_SUPPORTED in message:
        return (
            f"holds a {MULTIPATCH}: surfaces are not read yet; cut them at the height of the floor in the program that "
            "made them, and save the outline as polygons"
        )
    if path.suffix.lower() == ".shp" and not any(path.with_suffix(end).is_file() for end in (".shx", ".SHX")):
        return f"{path.with_suffix('.shx').name} is not beside it; a Shapefile is read with its .shx"
    what = "GeoPackage" if path.suffix.lower() == ".gpkg" else "Shapefile"
    return f"the {what} is damaged or incomplete; open it in the program that made it, and save it again"


def _read_layers(path: Path, source: Path | bytes, layers: list[str] | None, level_by: str | None) -> _Found:
    """Return the shapes of layers with the names of their layers, or their levels by a property."""
    import pyogrio  # loads pandas, and few surveys are GeoPackages or Shapefiles

    found = _Found()
    existing = [str(name) for name in pyogrio.list_layers(source)[:, 0]]
    unknown = sorted(set(layers or []) - set(existing))
    if unknown:
        raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(existing)}")
    for layer in layers or existing:
        names = pyogrio.raw.read(source, layer=layer, max_features=1)[0]["fields"]  # read_info counts without a limit
        found.fields += [str(name) for name in names if str(name) not in found.fields]
        most = reader_limits().shapes + 1 - len(found.shapes)
        columns = [name for name in dict.fromkeys([level_by, *FLAGS]) if name in names]
        meta, _, wkb, values = pyogrio.raw.read(source, layer=layer, columns=columns, max_features=most)
        if wkb is None:
            continue
        require_at_most(path, len(found.shapes) + len(wkb), "shapes", "shapes or more")
        surfaces = multipatches(path, wkb)
        found.kinds += Counter({MULTIPATCH: int(surfaces.sum()), NO_GEOMETRY: sum(data is None for data in wkb)})
        found.kinds += stored_kinds(source, layer, len(wkb))
        wkb[surfaces] = None
        shapes = _decoded(path, layer, wkb)
        there = np.array([shape is not None for shape in shapes], bool)
        kept = [shape for shape in shapes if shape is not None]
        found.points += int(shapely.get_num_coordinates(kept).sum())
        require_size(path, found.points)
        found.shapes += kept
        rows = {name: column[there].tolist() for name, column in zip(meta["fields"], values, strict=True)}
        found.layer_of += [text_of(value) for value in rows[level_by]] if level_by in rows else [layer] * len(kept)
        found.flags += flags_of(rows, len(kept))
        found.systems.add(None if _UNDEFINED in (meta.get("crs") or "") else meta["crs"])
    return found


def _decoded(path: Path, layer: str, wkb: np.ndarray) -> np.ndarray:
    """Return a layer's shapes, None for features without one; a broken one is refused."""
    shapes = shapely.from_wkb(wkb, on_invalid="ignore")
    broken = [number for number, (data, shape) in enumerate(zip(wkb, shapes, strict=True), 1) if data and shape is None]
    if broken:
        raise InputError(
            f"{path}: {len(broken)} of {len(wkb)} shapes in layer {layer!r} are broken, the first is number {broken[0]}"
        )
    return np.asarray(shapes)


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


def files_of_shapefile(path: Path) -> list[Path]:
    """Return a Shapefile and its companions (.shx, .dbf, .prj, .cpg)."""
    same_stem = (p for p in sorted(path.parent.iterdir()) if p.stem == path.stem and p.is_file())
    return [path, *(p for p in same_stem if p.suffix.lower() in (".shx", ".dbf", ".prj", ".cpg"))]
