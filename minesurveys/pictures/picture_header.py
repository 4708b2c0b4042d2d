"""Read a picture's header by Pillow, before OpenCV decodes any pixel.

Only PNG, JPEG, TIFF, BMP, PNM and GIF are read. OpenCV alone would choose any of its decoders by content.
"""

from __future__ import annotations

import logging
import math
import warnings
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from PIL import ImageFile, PngImagePlugin
from PIL.ExifTags import Base

from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits

MAX_SIDE_PX = 16_384  # the largest framebuffer of OSMesa, in which stage 6 renders the world
Pillow.MAX_IMAGE_PIXELS = None  # `require_size` has the limits
PngImagePlugin.MAX_TEXT_CHUNK = 2**24  # bytes of a colour profile; those of printers have a few million
logging.getLogger("PIL").setLevel(logging.CRITICAL + 1)  # it writes lines of its own before it raises
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM", "GIF")
_PAGED = ("TIFF", "GIF")
_SUBFILE, _TILE_WIDTH, _TILE_HEIGHT = 254, 322, 323  # tags of a TIFF
_NO_PAGE = 0b101  # a smaller copy of a picture (an overview), or a mask
_DPI = (30.0, 10_000.0)  # of scans; a picture of a camera or a screen may state 1
_MOST_PAGES = 1000
_WHITE = 255  # of 8 bits


@dataclass(frozen=True)
class PictureHeader:
    """Size of a picture, an upper limit of the bytes of a decoded pixel, its orientation by Exif, pages and format.

    `dpi` is the resolution of the scan, None if the file states none, or two that differ. `white` is the largest value
    of a PNM file, 255 of others.
    """

    width: int
    height: int
    pixel_bytes: int
    orientation: int
    pages: int
    format: str
    dpi: float | None = None
    white: int = _WHITE


def read_header(path: Path) -> PictureHeader:
    """Return the header of a picture.

    Raises
    ------
    InputError
        If the format is not supported, or the header is broken.
    """
    try:
        with warnings.catch_warnings(action="ignore"), Pillow.open(path, formats=_FORMATS) as picture:  # of broken tags
            return _header_of(path, picture)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # Pillow passes on every exception of its parsers
        reason = "the header is broken, or it is none of PNG, JPEG, TIFF, BMP, PNM and GIF"
        raise InputError(f"{path}: not a picture that can be read: {reason} ({path.stat().st_size} bytes)") from error


def _header_of(path: Path, picture: ImageFile.ImageFile) -> PictureHeader:
    orientation, tags = 1, getattr(picture, "tag_v2", {})
    with suppress(Exception):  # a broken Exif block leaves the picture as it is stored
        exif = Pillow.Exif()
        exif.load(picture.info.get("exif", b""))
        found = int(tags.get(Base.Orientation) or exif.get(Base.Orientation) or 1)
        orientation = found if 1 <= found <= 8 else 1
    coding = picture.tile[0][3] if picture.tile else ""
    white = coding[1] if picture.format == "PPM" and isinstance(coding, tuple) else _WHITE
    depth = 4 if picture.mode in ("I", "F") else 2 if "16" in str(coding) else 1
    channels = 1 if len(picture.getbands()) == 1 and picture.mode != "P" else 4
    return PictureHeader(
        # A tile is decoded whole, also if it is larger than the picture.
        width=max(picture.width, tags.get(_TILE_WIDTH, 0)),
        height=max(picture.height, tags.get(_TILE_HEIGHT, 0)),
        pixel_bytes=channels * depth,
        orientation=orientation,
        pages=_count_pages(picture) if picture.format in _PAGED else 1,
        format=picture.format or "",
        dpi=_dpi_of(picture),
        white=white,
    )


def _dpi_of(picture: ImageFile.ImageFile) -> float | None:
    """Return the resolution that a picture states, the same along both axes."""
    try:
        across, along = (float(value) for value in picture.info["dpi"])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None
    return across if _DPI[0] <= across <= _DPI[1] and abs(across - along) <= 0.01 * across else None


def _count_pages(picture: ImageFile.ImageFile) -> int:
    """Return how many pictures a TIFF or a GIF holds, without overviews and masks; a broken list ends the count."""
    pages = 0
    with suppress(Exception):
        for number in range(_MOST_PAGES):
            picture.seek(number)
            pages += not getattr(picture, "tag_v2", {}).get(_SUBFILE, 0) & _NO_PAGE
    return max(pages, 1)


def read_first_frame(path: Path) -> np.ndarray:
    """Return the first frame of a GIF as (rows, cols, 3 or 4) uint8: blue, green, red, and opacity if it states one.

    Raises
    ------
    InputError
        If it cannot be decoded.
    """
    try:
        with warnings.catch_warnings(action="ignore"), Pillow.open(path, formats=("GIF",)) as picture:
            is_opaque = "transparency" not in picture.info
            return np.asarray(picture.convert("RGB" if is_opaque else "RGBA"))[
                ..., [2, 1, 0] if is_opaque else [2, 1, 0, 3]
            ]
    except MemoryError:
        raise
    except Exception as error:  # Pillow passes on every exception of its parsers
        raise InputError(f"{path}: the GIF is broken ({path.stat().st_size} bytes)") from error


def require_picture_size(path: Path, header: PictureHeader, max_megapixels: float) -> None:
    """Refuse a picture by its header.

    Raises
    ------
    InputError
        If the picture exceeds `max_megapixels`, the side that can be rendered, or the limit on decoded bytes. The
        message names the file, the value and the limit.
    """
    require_size(path, header.width, header.height, max_megapixels)
    decoded, most = header.width * header.height * header.pixel_bytes, reader_limits().decoded_bytes
    if decoded > most:
        raise InputError(
            f"{path}: {decoded:,} bytes when decoded, the limit is {most:,} (decoded_bytes in {FILE}); "
            "save it with 8 bits a channel"
        )


def require_size(path: Path, width: int, height: int, max_megapixels: float) -> None:
    """Refuse a size in px; see `require_picture_size`."""
    if min(width, height) < 1:
        raise InputError(f"{path}: {width} x {height} px, at least 1 px a side is needed")
    share = min(MAX_SIDE_PX / max(width, height), math.sqrt(max_megapixels * 1e6 / (width * height)))
    remedy = f"save it at {math.floor(100 * share)} % of its size, or the part that shows the workings"
    if max(width, height) > MAX_SIDE_PX:
        raise InputError(f"{path}: {width} x {height} px, the limit is {MAX_SIDE_PX} px a side; {remedy}")
    if width * height > max_megapixels * 1e6:
        raise InputError(
            f"{path}: {width * height / 1e6:.1f} megapixels, the limit is {max_megapixels:g} (survey.max_megapixels); "
            f"{remedy}"
        )


def turn_upright(picture: np.ndarray, orientation: int) -> np.ndarray:
    """Return a picture (rows, cols, ...) as it is to be shown by its orientation.

    References
    ----------
    Exif 2.3, table 4, tag 274.
    """
    if orientation >= 5:  # rows are columns
        picture = picture.swapaxes(0, 1)
    turned = {1: picture, 2: picture[:, ::-1], 3: picture[::-1, ::-1], 4: picture[::-1],
              5: picture, 6: picture[:, ::-1], 7: picture[::-1, ::-1], 8: picture[::-1]}  # fmt: skip
    return np.ascontiguousarray(turned[orientation])  # OpenCV draws in no other layout
