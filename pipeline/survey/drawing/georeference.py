"""Georeference of a picture: the map coordinates of its pixels, from a world file or a GeoTIFF."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyproj
import rasterio
from rasterio.crs import CRS
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.transform import Affine

from pipeline.errors import InputError
from pipeline.guard.plain_file import read_text_bytes
from pipeline.guard.plain_number import plain_number
from pipeline.guard.reading_process import warn_user
from pipeline.survey.coordinates.ground import ground_scale, is_true_to_scale
from pipeline.survey.coordinates.map_axes import axes_of, coordinate_system, warn_of_turn
from pipeline.survey.drawing.picture_header import read_header

_UNEVEN = 0.01  # Web Mercator's axes differ by up to 0.007
_FARTHEST = 1e9  # of a coordinate in the map's units; map coordinates in feet reach 1e8
_SUFFIXES = {
    ".png": [".pgw", ".pngw"],
    ".jpg": [".jgw", ".jpgw"],
    ".jpeg": [".jgw", ".jpegw"],
    ".tif": [".tfw", ".tifw"],
    ".tiff": [".tfw", ".tiffw"],
}


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
    file, tags = world_file(image), _geotiff_tags(image)
    if file is None and tags is None:
        return None
    orientation = read_header(image).orientation
    if orientation != 1:
        raise InputError(
            f"{image}: it is stored turned (orientation {orientation}); save it upright to use a georeference"
        )
    if file is not None:
        return _by_world_file(image, file)
    assert tags is not None
    t, crs, cols, rows = tags
    if crs is not None and crs.is_geographic:
        raise InputError(
            f"{image}: its pixels are in degrees ({crs}); warp it to a metric system first, or state --px-per-m"
        )
    six: tuple[float, ...] = (t.a, t.d, t.b, t.e, t.c + (t.a + t.b) / 2, t.f + (t.d + t.e) / 2)
    if crs is not None:
        axes = axes_of(coordinate_system(image, crs.to_wkt()))
        six = tuple(axes.plan_of(np.array(six).reshape(3, 2)).ravel().tolist())
        warn_of_turn(image, axes)
    unit, metres = crs.linear_units_factor if crs is not None and crs.is_projected else ("m", 1.0)
    placement = _placement(image, six, float(metres), str(unit), crs.to_string() if crs is not None else None)
    if crs is None or not crs.is_projected:
        return placement
    along = _ground_scale(image, crs.to_wkt(), *(t @ (cols / 2, rows / 2)))
    return replace(placement, metres_per_unit=float(metres) / along)


def placement_files(image: Path) -> list[Path]:
    """Return the world file of a picture, and the file beside it that names the coordinate system, if there are any."""
    file = world_file(image)
    beside = [image.with_suffix(end) for end in (".prj", ".PRJ")] if file is not None else []
    return [found for found in (file, *beside) if found is not None and found.is_file()]


def _by_world_file(image: Path, file: Path) -> Placement:
    """Return the georeference of a world file, in metres unless a `.prj` file beside it names a system."""
    six, systems = _six_numbers(file), placement_files(image)[1:]
    if not systems:
        _warn_of_unread(image)
        return _placement(file, six, 1.0, "m", None)
    system = coordinate_system(systems[0], read_text_bytes(systems[0], "yaml_bytes").decode("latin-1"))
    if system.is_geographic:
        raise InputError(
            f"{image}: its pixels are in degrees ({system.name}); warp it to a metric system first, or state --px-per-m"
        )
    axes, header = axes_of(system), read_header(image)
    warn_of_turn(image, axes)
    a, d, b, e, c, f = axes.plan_of(np.array(six).reshape(3, 2)).ravel().tolist()
    code = system.to_authority()
    placement = _placement(file, (a, d, b, e, c, f), axes.metres, axes.unit, ":".join(code) if code else system.name)
    if not system.is_projected:
        return placement
    middle = (c + a * header.width / 2 + b * header.height / 2, f + d * header.width / 2 + e * header.height / 2)
    return replace(placement, metres_per_unit=axes.metres / _ground_scale(image, system.to_wkt(), *middle))


def _warn_of_unread(image: Path) -> None:
    """List a coordinate system that GDAL or ArcGIS wrote into another file beside the picture."""
    beside = image.with_name(f"{image.name}.aux.xml")
    if beside.is_file() and b"<SRS" in read_text_bytes(beside, "text_bytes"):
        warn_user(
            f"{beside.name} states a coordinate system, which is not read; a pixel is taken in metres; "
            f"`gdalsrsinfo -o wkt_esri {image.name} > {image.stem}.prj` writes it beside",
            of=image.name,
        )


def _geotiff_tags(image: Path) -> tuple[Affine, CRS | None, int, int] | None:
    """Return a GeoTIFF's transform from pixels to the map, its system and size; None for another file."""
    if image.suffix.lower() not in (".tif", ".tiff"):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with (
                rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"),  # files beside it are not read
                rasterio.open(image, driver="GTiff") as picture,
            ):
                found = picture.transform, picture.crs, picture.width, picture.height
    except (RasterioError, ValueError, TypeError):
        return None
    return None if found[0].is_identity else found


def _ground_scale(image: Path, system: str, east: float, north: float) -> float:
    """Return how much longer lengths are in the map than on the ground; 1 within 0.3 %.

    Raises
    ------
    InputError
        If the middle of the picture is outside the system, or lengths differ between the axes.
    """
    try:
        along = ground_scale(coordinate_system(image, system), east, north)
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


def _placement(path: Path, six: tuple[float, ...], metres: float, unit: str, crs: str | None) -> Placement:
    a, d, b, e, c, f = six  # one column right is (a, d), one row down is (b, e); (c, f) is the centre of pixel (0, 0)
    size, down = math.hypot(a, d), math.hypot(b, e)
    if not (1e-6 < size < 1e6) or abs(size - down) > 0.005 * size or a * e - b * d >= 0:
        raise InputError(
            f"{path}: pixels of {size:g} by {down:g} units; they must be square, north up and not mirrored"
        )
    if max(abs(c), abs(f)) > _FARTHEST:
        raise InputError(f"{path}: its first pixel is at ({c:g}, {f:g}), expected coordinates within +-{_FARTHEST:g}")
    return Placement(size, math.degrees(math.atan2(d, a)), c - (a + b) / 2, f - (d + e) / 2, metres, unit, crs)
