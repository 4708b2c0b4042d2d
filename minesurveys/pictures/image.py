"""Read plan images, and refuse files that are not usable images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from minesurveys.errors import InputError
from minesurveys.frames import Image
from minesurveys.limits import FILE, reader_limits
from minesurveys.pictures.picture_header import (
    PictureHeader,
    read_first_frame,
    read_header,
    require_picture_size,
    require_size,
    turn_upright,
)
from minesurveys.remarks import warn_user

_NUMBERS_AS_TEXT = (b"P1", b"P2", b"P3")  # PNM files whose pixels are decimal numbers
_DEPTHS = (255, 1023, 4095, 16383, 65535)  # white in pictures of 16 bits, which may hold fewer
_WHITES = (255, 65535)  # of 8 and of 16 bits
_STRIP_ROWS = 512  # conversions work on strips, so that they need little memory beside the picture


def read_image(path: Path, max_megapixels: float) -> Image:
    """Read an image file of a plan as BGR: as `read_pixels`, and it must have more than one colour.

    Raises
    ------
    InputError
        If the file is empty, unreadable, too large or of one colour only.
    """
    return require_workings_drawn(path, read_pixels(path, max_megapixels, is_plan=True))


def read_pixels(path: Path, max_megapixels: float, is_plan: bool = False) -> Image:
    """Read an image file as BGR.

    Parameters
    ----------
    path : Path
        PNG, JPEG, TIFF, BMP, PNM or GIF. The header is checked before pixels are decoded. The picture is turned upright
        as its Exif data say. Of several pages of a TIFF or frames of a GIF the first is read, with a warning.
    max_megapixels : float
        Upper limit of the image's size.
    is_plan : bool
        Whether pixels of 16 bits may use fewer, and white on transparent ground is refused.

    Returns
    -------
    (rows, cols, 3) uint8

    Raises
    ------
    InputError
        If the file is empty, unreadable or too large.
    """
    picture = decode_pixels(path, max_megapixels)
    read = _to_bgr(picture, is_plan)
    if (
        is_plan
        and picture.shape[2:] == (4,)
        and picture[..., 3].any()
        and all((strip == 255).all() for strip in _strips(read))
    ):
        raise InputError(f"{path}: its lines are white, and so is what is transparent in it; save it on a dark ground")
    return read


def decode_pixels(path: Path, max_megapixels: float) -> np.ndarray:
    """Decode an image file as `read_pixels`, with its own channels, opacity among them, and its own depth.

    Returns
    -------
    (rows, cols) or (rows, cols, 3 or 4) uint8, uint16 or shares of white
        Grey, or blue, green, red and opacity.
    """
    size = path.stat().st_size
    if not size:
        raise InputError(f"{path}: empty file")
    if size > reader_limits().file_bytes:
        raise InputError(f"{path}: {size:,} bytes, the limit is {reader_limits().file_bytes:,} (file_bytes in {FILE})")
    header = read_header(path)
    require_picture_size(path, header, max_megapixels)
    picture = read_first_frame(path) if header.format == "GIF" else _decode(path, header)
    require_size(path, picture.shape[1], picture.shape[0], max_megapixels)
    _require_known_depth(path, picture)
    if header.format != "TIFF":  # OpenCV turns a TIFF upright
        picture = turn_upright(picture, header.orientation)
    if header.pages > 1:
        warn_user(f"the first of {header.pages} pages is read; save another one as a file of its own", of=path.name)
    if picture.ndim not in (2, 3) or (picture.ndim == 3 and picture.shape[2] not in (3, 4)):
        raise InputError(f"{path}: {picture.shape[2:]} channels; grey, colour and transparency are read")
    return picture


def _decode(path: Path, header: PictureHeader) -> np.ndarray:
    data = np.fromfile(path, dtype=np.uint8)
    if bytes(data[:2]) in _NUMBERS_AS_TEXT:
        # OpenCV reads no last number without a blank behind it: findings/opencv-pgm-last-number-needs-a-blank.sh.
        data = np.append(data, np.uint8(ord("\n")))
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:  # OpenCV has its own limits on width, height and pixels
        raise InputError(f"{path}: its pixels cannot be decoded; save it as PNG") from error
    if picture is None:
        raise InputError(f"{path}: its pixels cannot be decoded; is it cut off ({data.size} bytes)?")
    is_scaled = header.white < 256 and bytes(data[:2]) in _NUMBERS_AS_TEXT
    return picture if is_scaled or header.white in _WHITES else _of_16_bits(picture, header.white)


def _of_16_bits(picture: np.ndarray, white: int) -> np.ndarray:
    """Return the pixels of a PNM file whose white OpenCV does not know, with the white of 16 bits.

    OpenCV applies it to a text file alone: findings/opencv-pgm-maximum-by-encoding.sh.
    """
    result = np.empty(picture.shape, np.uint16)
    for row in range(0, len(picture), _STRIP_ROWS):
        strip = picture[row : row + _STRIP_ROWS].astype(np.uint32)
        result[row : row + _STRIP_ROWS] = np.minimum((strip * _WHITES[1] + white // 2) // white, _WHITES[1])
    return result


def _require_known_depth(path: Path, picture: np.ndarray) -> None:
    """Refuse pixels that are neither of 8 or 16 bits nor shares of white from 0 to 1."""
    if picture.dtype in (np.uint8, np.uint16):
        return
    if picture.dtype in (np.float32, np.float64):
        low, high = (float(f(picture, initial=0.5, where=np.isfinite(picture))) for f in (np.min, np.max))
        if low >= 0 and high <= 1:
            return
        kind = f"{picture.dtype} from {low:g} to {high:g}"
    else:
        kind = str(picture.dtype)
    raise InputError(f"{path}: pixels of {kind}; uint8, uint16, and shares of white from 0 to 1 are read")


def require_workings_drawn(path: Path, picture: Image) -> Image:
    """Return the picture if it has more than one colour.

    Raises
    ------
    InputError
        If it has one colour only. The message names the file and the colour.
    """
    if all((strip == picture[0, 0]).all() for strip in _strips(picture)):
        colour = {0: "black", 765: "white"}.get(int(picture[0, 0].astype(int).sum()), "of one colour")
        raise InputError(f"{path}: the image is all {colour}; there is nothing to trace")
    return picture


def _strips(picture: np.ndarray) -> list[np.ndarray]:
    return [picture[row : row + _STRIP_ROWS] for row in range(0, len(picture), _STRIP_ROWS)]


def _to_bgr(picture: np.ndarray, fewer_bits: bool) -> Image:
    """Convert a decoded picture to 8-bit BGR. Transparent pixels become white."""
    if picture.dtype == np.uint8 and picture.ndim == 3 and picture.shape[2] == 3:
        return picture  # a copy of 200 megapixels takes 600 MB
    result = np.empty((*picture.shape[:2], 3), np.uint8)
    most = picture.max() if fewer_bits and picture.dtype == np.uint16 else _DEPTHS[-1]
    white = next(white for white in _DEPTHS if most <= white)
    for row, strip in zip(range(0, len(picture), _STRIP_ROWS), _strips(picture), strict=True):
        result[row : row + _STRIP_ROWS] = _strip_to_bgr(strip, white)
    return result


def _strip_to_bgr(picture: np.ndarray, white: int) -> Image:
    """Convert some rows; `white` is the lightest value of pixels of 16 bits."""
    if picture.dtype == np.uint16:
        picture = (picture.astype(np.uint32) * 255 // white).astype(np.uint8)
    elif picture.dtype != np.uint8:
        shares = np.nan_to_num(picture.astype(np.float64), nan=1.0, posinf=1.0, neginf=0.0)
        picture = np.round(np.clip(shares, 0, 1) * 255).astype(np.uint8)
    if picture.ndim == 2:
        return cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    if picture.shape[2] == 4:
        opaque = picture[..., 3:].astype(np.float64) / 255
        return np.round(picture[..., :3] * opaque + 255 * (1 - opaque)).astype(np.uint8)
    return picture
