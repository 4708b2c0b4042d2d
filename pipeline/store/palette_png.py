"""Pictures of few colours as PNG with a palette: a third of the bytes that three channels take."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from pipeline.store.codecs import encode
from pipeline.types import Image

MOST_COLOURS = 256
_CODES = 1 << 24  # colours of three bytes


def encode_texture(picture: Image) -> bytes:
    """Return a picture (rows, cols, 3) uint8, BGR, as PNG, with a palette if its colours are few enough."""
    return encode_palette_png(picture) or encode(Path("texture.png"), picture)


def encode_palette_png(picture: Image) -> bytes | None:
    """Return a picture (rows, cols, 3) uint8, BGR, as PNG with a palette, or None if it has too many colours."""
    code = picture.astype(np.uint32) @ np.array([1, 256, 65_536], np.uint32)
    index = np.zeros(_CODES, np.uint8)  # by colour: a table takes a fifth of the time of a sort
    index[code] = 1
    colours = np.flatnonzero(index)
    if len(colours) > MOST_COLOURS:
        return None
    index[colours] = np.arange(len(colours))
    height, width = code.shape
    rows = np.zeros((height, width + 1), np.uint8)  # the first byte of a row says that it is not filtered
    rows[:, 1:] = index[code]
    palette = np.column_stack([colours >> 16, colours >> 8 & 255, colours & 255]).astype(np.uint8)
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
        (b"PLTE", palette.tobytes()),
        (b"IDAT", zlib.compress(rows.tobytes(), 9)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks
    )
