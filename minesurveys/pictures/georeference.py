"""Georeference of a picture: the map coordinates of its pixels, from a world file or a GeoTIFF."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyproj
import rasterio
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from minesurveys.coordinates.ground import ground_scale, is_true_to_scale
from minesurveys.coordinates.map_axes import axes_of, coordinate_system, warn_of_turn
from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.guard.plain_number import plain_number
from minesurveys.pictures.picture_header import read_header
from minesurveys.remarks import warn_user

_UNEVEN = 0.01  # Web Mercator's axes differ by up to 0.007
_FARTHEST = 1e9  # of a coordinate in the map's units; map coordinates in feet reach 1e8
_SUFFIXES = {
    ".png": [".pgw", ".pngw"],
    ".jpg": [".jgw", ".jpgw"],
    ".jpeg": [".jgw", ".jpegw"],
    ".tif": [".tfw", ".tifw"],
    ".tiff": [".tfw", ".tiffw"],
}
# The file that states a place, its six numbers as in a world file, and its system with its name if there is one.
_Stated = tuple[Path, tuple[float, ...], tuple[pyproj.CRS, str] | None]


@dataclass(frozen=True)
class Placement:
    """Georeference of a picture: pixel size, rotation, and the corner of pixel (0, 0).

    `size`, `east` and `north` are in units of the map's system; `turned_deg` is counter-clockwise.
    """

    size: float
    turned_deg: float
    east: float
    north: float
    metres_per_unit: float
    unit: str
    crs: str | None


def world_file(image: Path) -> Path | None:
    """Return the world file in a picture's folder, or None.

    Raises
    ------
    InputError
        If it is a link that leads out of the folder.
    """
    suffixes = [*_SUFFIXES.get(image.suffix.lower(), []), ".wld"]
    same_stem = [p for p in sorted(image.parent.glob("*")) if p.stem == image.stem and p.is_file()]
    found = next((p for suffix in suffixes for p in same_stem if p.suffix.lower() == suffix), None)
    if found is not None and not found.resolve().is_relative_to(image.parent.resolve()):
        raise InputError(f"{found}: a link that leads out of {image.parent}; copy the file there")
    return found


def find_placement(image: Path) -> Placement | None:
    """Read a picture's georeference from its world file, or from the GeoTIFF itself; None if it has none.

    Raises
    ------
    InputError
        If its pixels are not square or are mirrored, or its system is in degrees; if it is
        stored turned, because no format says whether its georeference is of the stored or of the turned picture.

    References
    ----------
    Esri, "World files for raster datasets"; OGC GeoTIFF 1.1.
    """
    found = _by_world_file(image) or _by_geotiff(image)
    if found is None:
        return None
    header = read_header(image)
    if header.orientation != 1:
        raise InputError(
            f"{image}: it is stored turned (orientation {header.orientation}); save it upright to use a georeference"
        )
    file, six, stated = found
    if stated is None:
        return _placement(file, six, 1.0, "m", None)
    system, name = stated
    if system.is_geographic:
        raise InputError(
            f"{image}: its pixels are in degrees ({system.name}); warp it to a metric system first, or state --px-per-m"
        )
    axes = axes_of(system)
    warn_of_turn(image, axes)
    turned = axes.plan_of(np.array(six).reshape(3, 2)).ravel().tolist()
    placement = _placement(file, turned, axes.metres, axes.unit, name)
    if not system.is_projected:
        return placement
    a, d, b, e, c, f = six
    across, along = (header.width - 1) / 2, (header.height - 1) / 2
    middle = c + a * across + b * along, f + d * across + e * along
    return replace(placement, metres_per_unit=axes.metres / _ground_scale(image, system, *middle))


def placement_files(image: Path) -> list[Path]:
    """Return the world file of a picture, and the file beside it that names the coordinate system, if there are any."""
    file = world_file(image)
    beside = [image.with_suffix(end) for end in (".prj", ".PRJ")] if file is not None else []
    return [found for found in (file, *beside) if found is not None and found.is_file()]


def _by_world_file(image: Path) -> _Stated | None:
    """Return what a world file states, with the system of a `.prj` file beside it; None if there is none."""
    files = placement_files(image)
    if not files:
        return None
    six = _six_numbers(files[0])
    if len(files) == 1:
        _warn_of_unread(image)
        return files[0], six, None
    system = coordinate_system(files[1], read_text_bytes(files[1], "yaml_bytes").decode("latin-1"))
    code = system.to_authority()
    return files[0], six, (system, ":".join(code) if code else system.name)


def _warn_of_unread(image: Path) -> None:
    """List a coordinate system that GDAL or ArcGIS wrote into another file beside the picture."""
    beside = image.with_name(f"{image.name}.aux.xml")
    if beside.is_file() and b"<SRS" in read_text_bytes(beside, "text_bytes"):
        warn_user(
            f"{beside.name} states a coordinate system, which is not read; a pixel is taken in metres; "
            f"`gdalsrsinfo -o wkt_esri {image.name} > {image.stem}.prj` writes it beside",
            of=image.name,
        )


def _by_geotiff(image: Path) -> _Stated | None:
    """Return what a GeoTIFF states; None of another file."""
    if image.suffix.lower() not in (".tif", ".tiff"):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with (
                rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"),  # files beside it are not read
                rasterio.open(image, driver="GTiff") as picture,
            ):
                t, crs = picture.transform, picture.crs
    except (RasterioError, ValueError, TypeError):
        return None
    if t.is_identity:
        return None
    six = t.a, t.d, t.b, t.e, t.c + (t.a + t.b) / 2, t.f + (t.d + t.e) / 2
    return image, six, None if crs is None else (coordinate_system(image, crs.to_wkt()), crs.to_string())


def _ground_scale(image: Path, system: pyproj.CRS, east: float, north: float) -> float:
    """Return how much longer lengths are in the map than on the ground; 1 within 0.3 %.

    Raises
    ------
    InputError
        If the middle of the picture is outside the system, or lengths differ between the axes.
    """
    try:
        along = ground_scale(system, east, north)
    except pyproj.exceptions.ProjError as error:
        raise InputError(
            f"{image}: its middle is outside its coordinate system; --px-per-m states the scale instead"
        ) from error
    if is_true_to_scale(along):
        return 1.0
    if abs(along[0] / along[1] - 1) > _UNEVEN:
        raise InputError(
            f"{image}: lengths in its map are {along[0]:.3f} (east) and {along[1]:.3f} (north) times those on the "
            "ground; warp it to a metric system first, or state --px-per-m"
        )
    return (along[0] * along[1]) ** 0.5


def _six_numbers(path: Path) -> tuple[float, ...]:
    words = read_text_bytes(path, "yaml_bytes").decode("latin-1").split()
    try:
        numbers = tuple(map(plain_number, words))
    except ValueError as error:
        raise InputError(f"{path}: not six numbers ({error})") from error
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)):
        raise InputError(f"{path}: expected six finite numbers, got {len(numbers)}")
    return numbers


def _placement(path: Path, six: Sequence[float], metres: float, unit: str, crs: str | None) -> Placement:
    a, d, b, e, c, f = six  # one column right is (a, d), one row down is (b, e); (c, f) is the centre of pixel (0, 0)
    size, down = math.hypot(a, d), math.hypot(b, e)
    if not (1e-6 < size < 1e6) or abs(size - down) > 0.005 * size or a * e - b * d >= 0:
        raise InputError(
            f"{path}: pixels of {size:g} by {down:g} units; they must be square, north up and not mirrored"
        )
    if max(abs(c), abs(f)) > _FARTHEST:
        raise InputError(f"{path}: its first pixel is at ({c:g}, {f:g}), expected coordinates within +-{_FARTHEST:g}")
    return Placement(size, math.degrees(math.atan2(d, a)), c - (a + b) / 2, f - (d + e) / 2, metres, unit, crs)
