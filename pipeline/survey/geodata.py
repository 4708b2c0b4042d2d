"""Reader of GeoPackage and Shapefile through GDAL (pyogrio)."""

from __future__ import annotations

from pathlib import Path

import pyogrio
import shapely

from pipeline.errors import InputError
from pipeline.survey.shapes import Shapes, require_size

# GDAL chooses a driver by content, and some drivers follow references to other files: what a file is must be plain.
_REFUSALS = tuple(
    getattr(pyogrio.errors, name)
    for name in ("DataSourceError", "DataLayerError", "FeatureError", "GeometryError", "FieldError", "CRSError")
)
_MAGIC = {".gpkg": b"SQLite format 3\x00", ".shp": b"\x00\x00\x27\x0a"}


def read_geodata(path: Path, layers: list[str] | None) -> Shapes:
    """Read polygons and lines of some layers, or of all.

    Raises
    ------
    InputError
        If the file is not of its kind, a layer is unknown (they are listed), or layers are of different systems.
    """
    if path.open("rb").read(len(_MAGIC[path.suffix.lower()])) != _MAGIC[path.suffix.lower()]:
        raise InputError(f"{path}: not a {'GeoPackage' if path.suffix.lower() == '.gpkg' else 'Shapefile'}")
    try:
        known = [str(name) for name in pyogrio.list_layers(path)[:, 0]]
        unknown = sorted(set(layers or []) - set(known))
        if unknown:
            raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(known)}")
        shapes, systems, points = [], set(), 0
        for layer in layers or known:
            meta, _, found, _ = pyogrio.raw.read(path, layer=layer, columns=[])
            if found is None:
                continue
            read = [shape for shape in shapely.from_wkb(found, on_invalid="ignore") if shape is not None]
            points += int(shapely.get_num_coordinates(read).sum())
            require_size(path, points)
            shapes += read
            systems.add(meta.get("crs"))
    except (*_REFUSALS, shapely.GEOSException, ValueError, UnboundLocalError) as error:  # the last on a broken .prj
        raise InputError(f"{path}: cannot be read ({str(error).splitlines()[0][:160]})") from error
    if len(systems) > 1:
        raise InputError(f"{path}: its layers have different coordinate systems; choose some by survey.layers")
    return Shapes(shapes, None, next(iter(systems), None))


def companions(path: Path) -> list[Path]:
    """Return the files beside a Shapefile that belong to it."""
    if path.suffix.lower() != ".shp":
        return []
    beside = (p for p in sorted(path.parent.iterdir()) if p.stem == path.stem and p.is_file())
    return [p for p in beside if p.suffix.lower() in (".shx", ".dbf", ".prj", ".cpg")]
