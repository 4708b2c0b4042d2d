"""The coordinate system that a LAS file states: in well-known text, or in the keys of a GeoTIFF."""

from __future__ import annotations

import io
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from pyproj.database import get_units_map

from minesurveys.clouds.point_blocks import StatedSystem
from minesurveys.errors import InputError

_USER = "lasf_projection"
_WKT, _KEYS, _DOUBLES, _TEXT = 2112, 34735, 34736, 34737  # records
_PLAN_UNIT, _UP_UNIT = 3076, 4099  # keys whose values are EPSG's codes of units
_MOST_KEYS = 1000


def stated_system(path: Path, header: Any) -> StatedSystem:
    """Return what a header states of its coordinates.

    The record that the header's flag names counts if there are both kinds, as in GDAL and PDAL.

    Parameters
    ----------
    path : Path
    header : laspy.LasHeader

    Raises
    ------
    InputError
        If a scale factor or an offset is none.
    """
    scales = [float(value) for value in header.scales]
    numbers = [*scales, *(float(value) for value in header.offsets)]
    if not all(map(math.isfinite, numbers)) or not all(scales):
        raise InputError(f"{path}: its header states the scale factors {scales}, expected numbers, no 0")
    records = {
        record.record_id: record
        for record in (*header.vlrs, *(header.evlrs or ()))
        if record.user_id.strip("\0 ").lower() == _USER
    }
    step = max(map(abs, scales))
    is_text = _WKT in records and (header.global_encoding.wkt or _KEYS not in records)
    if is_text:
        text = bytes(records[_WKT].record_data_bytes()).decode("utf-8", "replace").strip("\0 \r\n")
        if text:
            return StatedSystem(text, step=step)
    if _KEYS in records:
        keys = np.frombuffer(records[_KEYS].record_data_bytes(), "<u2")[: 4 * _MOST_KEYS]
        rest = [bytes(records[k].record_data_bytes()) if k in records else b"" for k in (_DOUBLES, _TEXT)]
        wkt = _wkt_of_keys(keys, np.frombuffer(rest[0][: len(rest[0]) // 8 * 8], "<f8"), rest[1])
        codes = {int(key): int(value) for key, at, _, value in keys[4 : len(keys) // 4 * 4].reshape(-1, 4) if not at}
        plan_m, up_m = (_metres_of_code(codes.get(key)) for key in (_PLAN_UNIT, _UP_UNIT))
        return StatedSystem(wkt, plan_m, up_m, step)
    return StatedSystem(step=step)


def _metres_of_code(code: int | None) -> float | None:
    """Return the metres of EPSG's code of a unit of length, None if it is none."""
    units = get_units_map(auth_name="EPSG", category="linear").values()
    return next((float(unit.conv_factor) for unit in units if unit.code == str(code)), None)


def _wkt_of_keys(keys: np.ndarray, doubles: np.ndarray, text: bytes) -> str:
    """Return the system of GeoTIFF's keys, which GDAL reads from a picture of one pixel; empty if they name none."""
    import rasterio
    from PIL import Image
    from PIL.TiffImagePlugin import ImageFileDirectory_v2
    from rasterio.errors import RasterioError
    from rasterio.io import MemoryFile

    tags = ImageFileDirectory_v2()
    for tag, kind, values in ((_KEYS, 3, keys.tolist()), (_DOUBLES, 12, doubles.tolist()), (_TEXT, 2, text)):
        if len(values):
            tags.tagtype[tag] = kind
            tags[tag] = tuple(values) if isinstance(values, list) else values
    stream = io.BytesIO()
    Image.new("L", (1, 1)).save(stream, "TIFF", tiffinfo=tags)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with (
                rasterio.Env(GTIFF_REPORT_COMPD_CS=True),
                MemoryFile(stream.getvalue()) as file,
                file.open(driver="GTiff") as picture,
            ):
                found = picture.crs
                wkt = "" if found is None else str(found.to_wkt(version="WKT2_2019"))
    except (RasterioError, ValueError):
        return ""
    return "" if wkt.startswith(("ENGCRS", "LOCAL_CS")) else wkt
