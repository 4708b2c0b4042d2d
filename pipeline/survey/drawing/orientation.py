"""How a picture stands: cameras and scanners store it as the sensor saw it, and state how to turn it."""

from __future__ import annotations

import struct
from contextlib import suppress

import numpy as np

from pipeline.survey.drawing.tiff_header import ORIENTATION, first_tags

_MOST_SEGMENTS = 1000
_EXIF = b"Exif\0\0"


def orientation_of(data: memoryview) -> int:
    """Return a picture's orientation by Exif or its TIFF tag: 1, upright, unless it states one of 2 to 8.

    References
    ----------
    Exif 2.3, table 4, tag 274; PNG 3, eXIf.
    """
    with suppress(struct.error, KeyError):
        block = _exif_block(data)
        found = 1 if block is None else first_tags(block).get(ORIENTATION, 1)
        return found if 1 <= found <= 8 else 1
    return 1


def turn_upright(picture: np.ndarray, orientation: int) -> np.ndarray:
    """Return a picture (rows, cols, ...) as its orientation says that it is to be shown."""
    if orientation >= 5:  # rows are columns
        picture = picture.swapaxes(0, 1)
    turned = {1: picture, 2: picture[:, ::-1], 3: picture[::-1, ::-1], 4: picture[::-1],
              5: picture, 6: picture[:, ::-1], 7: picture[::-1, ::-1], 8: picture[::-1]}  # fmt: skip
    return turned[orientation]


def _exif_block(data: memoryview) -> memoryview | None:
    magic = bytes(data[:2])
    if magic in (b"II", b"MM"):
        return data
    if magic == b"\xff\xd8":
        return _of_jpeg(data)
    return _of_png(data) if magic == b"\x89P" else None


def _of_jpeg(data: memoryview) -> memoryview | None:
    at = 2
    for _ in range(_MOST_SEGMENTS):
        start, marker, size = struct.unpack_from(">BBH", data, at)
        if start != 0xFF or marker == 0xDA:  # the picture begins
            return None
        if marker == 0xE1 and bytes(data[at + 4 : at + 10]) == _EXIF:
            return data[at + 10 : at + 2 + size]
        at += 2 + size
    return None


def _of_png(data: memoryview) -> memoryview | None:
    at = 8
    for _ in range(_MOST_SEGMENTS):
        size, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"eXIf":
            return data[at + 8 : at + 8 + size]
        at += 12 + size
    return None
