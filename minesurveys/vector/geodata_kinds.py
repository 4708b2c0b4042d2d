"""Kinds of shapes in a GeoPackage or Shapefile that are read as others, or not at all, and flags of shots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user
from minesurveys.vector.shapes import Shapes

SPLAY, SURFACE, DUPLICATE = "_SPLAY", "_SURFACE", "_DUPLICATE"  # fields of Therion's shots3d.shp; 1: flagged
FLAGS = (SPLAY, SURFACE, DUPLICATE)
_SET = (1, 1.0, True, "1")
_NAMES = {SPLAY: "splays", SURFACE: "legs on the surface"}
CURVE, MEASURED = "curves", "shapes with measures"
_SURFACES = (15, 16, 17)  # PolyhedralSurface, TIN, Triangle in OGC 06-103r4, table 7
_FLAGS = 0x0FFFFFFF  # of well-known binary without those for z and m that GDAL sets
_PATCHES = 31  # the Shapefile's MultiPatch (ESRI 1998)
_MEASURED = (21, 23, 25, 28)  # its kinds with measures; those with z may have them, and mostly have none
_CURVES = ("CIRCULARSTRING", "COMPOUNDCURVE", "CURVEPOLYGON", "MULTICURVE", "MULTISURFACE")


def multipatches(path: Path, wkb: np.ndarray) -> np.ndarray:
    """Return which shapes (n,) of a layer are surfaces in space.

    All are in a Shapefile of MultiPatch, whose faces GDAL may read as polygons.
    """
    if path.suffix.lower() == ".shp" and _kind_of_shapefile(path) == _PATCHES:
        return np.array([data is not None for data in wkb], bool)
    return np.array([data is not None and _kind(data) in _SURFACES for data in wkb], bool)


def _kind(wkb: bytes) -> int:
    """Return the kind of a shape as well-known binary states it, without z and m."""
    return (int.from_bytes(wkb[1:5], "little" if wkb[0] == 1 else "big") & _FLAGS) % 1000


def _kind_of_shapefile(path: Path) -> int:
    with path.open("rb") as stream:
        return int.from_bytes(stream.read(36)[32:], "little")


def stored_kinds(source: Path | bytes, layer: str, count: int) -> Counter[str]:
    """Return how many shapes of a layer are stored as curves or with measures, which GDAL reads as others.

    Parameters
    ----------
    source : Path or bytes
        A Shapefile, or the bytes of a GeoPackage.
    layer : str
    count : int
        Shapes of the layer. A Shapefile states measures for all.
    """
    if isinstance(source, Path):
        return Counter({MEASURED: count} if _kind_of_shapefile(source) in _MEASURED else {})
    table, text = layer.replace('"', '""'), layer.replace("'", "''")
    named = f"SELECT column_name FROM gpkg_geometry_columns WHERE table_name = '{text}'"
    column = str((_first_column(source, named) or ["geom"])[0]).replace('"', '""')
    questions = {CURVE: f'ST_GeometryType("{column}") IN {_CURVES}', MEASURED: f'ST_IsMeasured("{column}") = 1'}
    found: Counter[str] = Counter()  # of a shape without geometry ST_IsMeasured is -1
    for kind, wanted in questions.items():
        found[kind] = int((_first_column(source, f'SELECT COUNT(*) AS n FROM "{table}" WHERE {wanted}') or [0])[0])
    return +found


def _first_column(source: bytes, sql: str) -> list[Any]:
    """Return the first column of what a query of a GeoPackage gives; nothing if it fails, as of an unusual view."""
    import pyogrio
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        return list(pyogrio.raw.read(source, sql=sql)[3][0].tolist())
    except (DataSourceError, DataLayerError):
        return []


def warn_of_kinds(path: Path, kinds: Mapping[str, int]) -> None:
    """Warn of shapes whose measures are dropped, and of curves that are read as chords."""
    if kinds.get(MEASURED):
        warn_user("shapes have measures (M); they are not read, x, y and z are", of=path.name, count=kinds[MEASURED])
    if kinds.get(CURVE):
        warn_user("shapes have curves; arcs are read as chords of 4 degrees", of=path.name, count=kinds[CURVE])


def flags_of(columns: Mapping[str | None, Sequence[Any]], count: int) -> list[frozenset[str]]:
    """Return the flags of each of `count` shapes, from the columns of properties that there are."""
    there = [name for name in FLAGS if name in columns]
    return [frozenset(name for name in there if columns[name][row] in _SET) for row in range(count)]


def without_flagged(path: Path, content: Shapes, flags: Sequence[frozenset[str]]) -> Shapes:
    """Return shapes without splays and without legs on the surface, as they are no drifts; a warning counts them.

    Parameters
    ----------
    path : Path
    content : Shapes
    flags : sequence of frozenset of str
        Of each shape. Those of a duplicate go with it: it ties stations, and is no passage of its own.

    Raises
    ------
    InputError
        If all shapes are splays or on the surface.
    """
    if not any(flags):
        return content
    left_out = Counter(next(name for name in _NAMES if name in one) for one in flags if one & set(_NAMES))
    if left_out:
        text = " and ".join(f"{count} {_NAMES[name]} ({name})" for name, count in left_out.items())
        if sum(left_out.values()) == len(flags):
            raise InputError(f"{path}: holds no drifts: {text}")
        warn_user(f"{text} of {len(flags)} shots are no drifts, and are left out", of=path.name)
    found = replace(content, is_duplicate=[DUPLICATE in one for one in flags])
    found = found.only([not one & set(_NAMES) for one in flags])
    if (twice := sum(found.is_duplicate)) > 0:
        warn_user(
            f"shots flagged {DUPLICATE} were measured before; --half-width M reads them as ties, not as "
            "passages of their own",
            of=path.name,
            count=twice,
            option="--half-width",
        )
    return found
