"""A raster of heights, and what its file states of them: scale and offset, unit, cells without a value."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from minesurveys.coordinates.map_axes import metres_of_unit
from minesurveys.errors import NAMED, InputError, one_line
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user

RASTER_DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid"}
_GRID = ".asc"  # its coordinate system is in a .prj beside it
_PICTURE = {ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.palette}
_STATED_BESIDE = re.compile(rb"<(Scale|Offset|UnitType|NoDataValue|SRS|GeoTransform|GCPList)\b")  # of GDAL's .aux.xml
_ZUNITS = re.compile(rb"^\s*zunits\s+(\S+)", re.IGNORECASE | re.MULTILINE)  # of a .prj of Arc/Info


@dataclass(frozen=True)
class HeightPoints:
    """Points (k, 3) with a height, as a file has them, in the unit that it states for each axis.

    `crs` is the coordinate system, `up_m` how many metres a unit of height has; None: the file states none.
    """

    points: np.ndarray
    crs: str | None = None
    up_m: float | None = None


def read_raster(path: Path) -> HeightPoints:
    """Read the middles of a raster's cells that have a value; values have the band's scale and offset.

    Raises
    ------
    InputError
        If the file is no raster of heights, has no georeference, states something in a file beside it that is not
        read, or a limit is exceeded.
    """
    most = reader_limits()
    if path.stat().st_size > most.file_bytes:
        raise InputError(f"{path}: {path.stat().st_size} bytes, the limit is {most.file_bytes} (file_bytes in {FILE})")
    _require_nothing_beside(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with (
                # Files beside it are not read, but for the .prj of a .asc. Old GeoTIFF files state heights by a key.
                rasterio.Env(
                    GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR", GDAL_PAM_ENABLED=False, GTIFF_REPORT_COMPD_CS=True
                ),
                rasterio.open(path, driver=RASTER_DRIVERS[path.suffix.lower()]) as raster,
            ):
                _require_heights(path, raster)
                values, place = raster.read(1, masked=True), raster.transform
                scale, offset, unit = raster.scales[0], raster.offsets[0], raster.units[0] or ""
                crs = raster.crs.to_wkt() if raster.crs is not None else None
    except (RasterioError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not a raster of heights; it is broken, cut off or of another format") from error
    if not (math.isfinite(scale) and math.isfinite(offset) and scale):
        raise InputError(f"{path}: band 1 has the scale {scale:g} and the offset {offset:g}, expected numbers, no 0")
    if not (known := ~np.ma.getmaskarray(values) & np.isfinite(values.data)).any():
        raise InputError(f"{path}: no cell of band 1 has a value")
    row, col = np.nonzero(known)
    east, north = place @ (col + 0.5, row + 0.5)  # GDAL's places are of corners, of RasterPixelIsPoint too
    heights = values.data[row, col].astype(float)
    if (scale, offset) != (1.0, 0.0):
        heights = heights * scale + offset
    return HeightPoints(np.column_stack([east, north, heights]), crs, _up_m(path, unit))


def _require_heights(path: Path, raster: Any) -> None:
    """Refuse a raster that is too large, has no place, or holds no heights; list its other bands."""
    most = reader_limits()
    if raster.width * raster.height > most.megapixels * 1e6:
        raise InputError(
            f"{path}: {raster.width} x {raster.height} cells, the limit is {most.megapixels:g} million "
            f"(megapixels in {FILE})"
        )
    if raster.dtypes[0].startswith("complex"):
        raise InputError(f"{path}: band 1 has values of {raster.dtypes[0]}; heights are real numbers")
    if raster.colorinterp[0] in _PICTURE:
        raise InputError(
            f"{path}: band 1 holds colours ({raster.colorinterp[0].name}): a picture, no heights; give the raster of "
            "elevations that it was drawn from"
        )
    if raster.transform.is_identity:
        by = "its georeference is by ground control points; `gdalwarp in.tif out.tif` makes a grid of it"
        raise InputError(f"{path}: {by if raster.gcps[0] else 'has no georeference'}")
    others = [k for k in range(1, raster.count) if raster.colorinterp[k] is not ColorInterp.alpha]
    if others:
        names = [one_line(raster.descriptions[k] or f"band {k + 1}", 40) for k in others[:NAMED]]
        warn_user(
            f"band 1 of {raster.count} is read as heights, not {', '.join(names)}; `gdal_translate -b 2 "
            "in.tif out.tif` writes another alone",
            of=path.name,
        )


def _require_nothing_beside(path: Path) -> None:
    """Refuse a raster that has values, places or a mask of its own in a file beside it, which is not read."""
    notes, mask = (path.with_name(f"{path.name}{end}") for end in (".aux.xml", ".msk"))
    found = _STATED_BESIDE.search(read_text_bytes(notes)) if notes.is_file() else None
    what = f"{notes.name} beside it states {found[1].decode()}" if found else f"{mask.name} beside it is its mask"
    if found or mask.is_file():
        raise InputError(
            f"{path}: {what}, and files beside it are not read; "
            f"`gdal_translate {path.name} out.tif` with GDAL_TIFF_INTERNAL_MASK=YES writes one file"
        )


def _up_m(path: Path, unit: str) -> float | None:
    """Return how many metres a unit of height has, as the band or the .prj of a .asc states it."""
    prj = prj_beside(path)
    found = _ZUNITS.search(read_text_bytes(prj)) if prj is not None else None
    if found and found[1].upper() != b"NO":
        unit = found[1].decode("latin-1")
    if not unit:
        return None
    metres = metres_of_unit(unit)
    if metres is None:
        raise InputError(
            f"{path}: its heights are in {one_line(unit, 40)!r}, which is no unit of length; "
            f"`gdal_edit.py -units m {path.name}` states another"
        )
    return metres


def prj_beside(path: Path) -> Path | None:
    """Return the file with the coordinate system of an Esri ASCII grid, or None."""
    if path.suffix.lower() != _GRID:
        return None
    names = (path.with_suffix(end) for end in (".prj", ".PRJ"))
    return next((file for file in names if file.is_file()), None)
