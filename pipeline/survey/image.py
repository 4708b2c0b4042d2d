"""Plan images: read safely, whatever the file holds."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.errors import InputError
from pipeline.types import Image


def read_image(path: Path, max_megapixels: float) -> Image:
    """Read an image file as BGR.

    Parameters
    ----------
    path : Path
        PNG, JPEG, TIFF or any other format OpenCV reads.
    max_megapixels : float
        Larger images are refused.

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
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
    except cv2.error as error:  # OpenCV's own limits on width, height and pixels
        raise InputError(f"{path}: not decoded by OpenCV ({error.err or error})") from error
    if picture is None:
        raise InputError(f"{path}: not an image that OpenCV can read ({data.size} bytes)")
    megapixels = picture.shape[0] * picture.shape[1] / 1e6
    if megapixels > max_megapixels:
        raise InputError(f"{path}: {megapixels:.1f} megapixels, at most {max_megapixels:g} (survey.max_megapixels)")
    if (picture == picture[0, 0]).all():
        colour = {0: "black", 765: "white"}.get(int(picture[0, 0].astype(int).sum()), "of one colour")
        raise InputError(f"{path}: the image is all {colour}; there is nothing to trace")
    return picture
