"""Read a picture's size from its header, before any pixel is decoded.

Only PNG, JPEG, TIFF, BMP and PNM are read. OpenCV alone would choose any of its decoders by content.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.drawing.tiff_header import BITS, CHANNELS, HEIGHT, TILE_HEIGHT, TILE_WIDTH, WIDTH, first_tags

MAX_SIDE_PX = 16_384  # the largest framebuffer of OSMesa, in which stage 6 renders the world
_JPEG_SIZES = {0xC0 + k for k in range(16)} - {0xC4, 0xC8, 0xCC}  # markers of frames; the others are tables
_MARKER = re.compile(rb"\xff[^\xff\x00\x01]", re.DOTALL)
_MOST_SEGMENTS = 10_000
_WHITE = (b"255", b"65535")  # of 8 and of 16 bits
_PNM = re.compile(rb"P([1-6])(?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{0,9})")


@dataclass(frozen=True)
class PictureHeader:
    """Size of a picture and an upper limit of the bytes of a decoded pixel."""

    width: int
    height: int
    pixel_bytes: int


def require_picture_size(path: Path, data: bytes | memoryview, max_megapixels: float) -> None:
    """Refuse a picture by its header.

    Raises
    ------
    InputError
        If the format is not supported, the header is broken, or the picture exceeds `max_megapixels`, the side that
        can be rendered, or the limit on decoded bytes. The message names the file, the value and the limit.
    """
    try:
        header = read_header(bytes(data[:2]), memoryview(data))
    except (struct.error, IndexError, KeyError) as error:
        raise InputError(f"{path}: the picture's header is broken ({len(data)} bytes)") from error
    if header is None:
        kinds = "PNG, JPEG, TIFF, BMP or PNM"
        raise InputError(f"{path}: not an image that OpenCV can read as {kinds} ({len(data)} bytes)")
    _require_whole_scale(path, bytes(data[:4096]))
    require_size(path, header.width, header.height, max_megapixels)
    decoded, most = header.width * header.height * header.pixel_bytes, reader_limits().decoded_bytes
    if decoded > most:
        raise InputError(
            f"{path}: {decoded:,} bytes when decoded, the limit is {most:,} (decoded_bytes in {FILE}); "
            "save it with 8 bits a channel"
        )


def _require_whole_scale(path: Path, head: bytes) -> None:
    """Refuse a PNM picture whose white is not that of 8 or 16 bits: OpenCV does not scale it, it would be dark."""
    found = _PNM.match(head)
    if found and found[1] not in b"14" and found[4] not in _WHITE:
        white = found[4].decode() or "missing"
        raise InputError(f"{path}: its largest value (maxval) is {white}, want 255 or 65535; save it with 8 bits")


def require_size(path: Path, width: int, height: int, max_megapixels: float) -> None:
    """Refuse a size in px; see `require_picture_size`."""
    if min(width, height) < 1:
        raise InputError(f"{path}: {width} x {height} px, at least 1 px a side is needed")
    if max(width, height) > MAX_SIDE_PX:
        raise InputError(f"{path}: {width} x {height} px, the limit is {MAX_SIDE_PX} px a side")
    if width * height > max_megapixels * 1e6:
        raise InputError(
            f"{path}: {width * height / 1e6:.1f} megapixels, the limit is {max_megapixels:g} (survey.max_megapixels)"
        )


def read_header(magic: bytes, data: memoryview) -> PictureHeader | None:
    """Return the header of a picture, or None for other content; raise `struct.error` if it is cut off."""
    if magic == b"\x89P":
        width, height, depth, colour = struct.unpack_from(">IIBB", data, 16)
        return PictureHeader(width, height, (4 if colour else 1) * (2 if depth == 16 else 1))
    if magic == b"\xff\xd8":
        return _jpeg(data)
    if magic == b"BM":
        if struct.unpack_from("<I", data, 14)[0] == 12:
            width, height = struct.unpack_from("<HH", data, 18)
            return PictureHeader(width, height, 4)
        width, height = struct.unpack_from("<ii", data, 18)
        return PictureHeader(abs(width), abs(height), 4)
    if magic in (b"II", b"MM"):
        return _tiff(data)
    found = _PNM.match(bytes(data[:4096]))
    if found is None:
        return None
    kind, width, height, largest = found.groups()
    deep = kind not in (b"1", b"4") and int(largest or 0) > 255
    return PictureHeader(int(width), int(height), (3 if kind in (b"3", b"6") else 1) * (2 if deep else 1))


def _jpeg(data: memoryview) -> PictureHeader | None:
    whole, at = bytes(data), 2
    for _ in range(_MOST_SEGMENTS):
        found = _MARKER.search(whole, at)
        if found is None:
            return None
        marker, at = found[0][-1], found.end()
        if marker in _JPEG_SIZES:
            height, width, channels = struct.unpack_from(">HHB", data, at + 3)
            return PictureHeader(width, height, max(3, channels))
        if not 0xD0 <= marker <= 0xD9:  # those have no length
            at += struct.unpack_from(">H", data, at)[0]
    return None


def _tiff(data: memoryview) -> PictureHeader:
    """Return the header of a TIFF's first picture."""
    tags = first_tags(data)
    # A tile is decoded whole, also if it is larger than the picture.
    width, height = max(tags[WIDTH], tags.get(TILE_WIDTH, 0)), max(tags[HEIGHT], tags.get(TILE_HEIGHT, 0))
    return PictureHeader(width, height, max(3, tags.get(CHANNELS, 1)) * max(1, tags.get(BITS, 8) // 8))
