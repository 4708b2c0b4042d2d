"""Read plan images, and refuse files that are not usable images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.errors import InputError
from pipeline.types import Image

MAX_SIDE_PX = 16_384  # the largest framebuffer of OSMesa, in which stage 6 renders the world


def read_image(path: Path, max_megapixels: float) -> Image:
    """Read an image file as BGR.

    Parameters
    ----------
    path : Path
        PNG, JPEG, TIFF or any other format that OpenCV reads.
    max_megapixels : float
        Upper limit of the image's size.

    Returns
    -------
    (rows, cols, 3) uint8

    Raises
    ------
    InputError
        If the file is empty, unreadable, too large or of one colour only.
    """
    data = np.fromfile(path, dtype=np.uint8)
    if not data.size:
        raise InputError(f"{path}: empty file")
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:  # OpenCV has its own limits on width, height and pixels
        raise InputError(f"{path}: OpenCV cannot decode it ({error.err or error})") from error
    if picture is None:
        raise InputError(f"{path}: not an image that OpenCV can read ({data.size} bytes)")
    if max(picture.shape[:2]) > MAX_SIDE_PX:
        raise InputError(f"{path}: {picture.shape[1]} x {picture.shape[0]} px, the limit is {MAX_SIDE_PX} px a side")
    megapixels = picture.shape[0] * picture.shape[1] / 1e6
    if megapixels > max_megapixels:
        raise InputError(
            f"{path}: {megapixels:.1f} megapixels, the limit is {max_megapixels:g} (survey.max_megapixels)"
        )
    return require_workings_drawn(path, _to_bgr(picture))


def require_workings_drawn(path: Path, picture: Image) -> Image:
    """Return the picture if it has more than one colour.

    Raises
    ------
    InputError
        If it has one colour only. The message names the file and the colour.
    """
    if (picture == picture[0, 0]).all():
        colour = {0: "black", 765: "white"}.get(int(picture[0, 0].astype(int).sum()), "of one colour")
        raise InputError(f"{path}: the image is all {colour}; there is nothing to trace")
    return picture


def _to_bgr(picture: np.ndarray) -> Image:
    """Convert a decoded picture to 8-bit BGR. Transparent pixels become white."""
    if picture.dtype == np.uint16:
        picture = (picture // 257).astype(np.uint8)
    elif picture.dtype != np.uint8:
        picture = np.clip(np.round(picture.astype(np.float64) * 255), 0, 255).astype(np.uint8)
    if picture.ndim == 2:
        return cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    if picture.shape[2] == 4:
        opaque = picture[..., 3:].astype(np.float64) / 255
        return np.round(picture[..., :3] * opaque + 255 * (1 - opaque)).astype(np.uint8)
    return picture
