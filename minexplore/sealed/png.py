"""Check a PNG before anything decodes it: its header, the order of its chunks and their checksums."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

from minexplore.bundle import BundleError

GREY, RGB, PALETTE = 0, 2, 3  # PNG's numbers
_BLOCK = 1 << 20  # bytes that are unpacked at once
_CHUNK = 4096  # bytes; writers fill chunks of 8 KB and more, and each chunk costs time


def image_blocks(name: str, data: bytes) -> Iterator[bytes]:
    """Yield the bytes of the image of a picture that `check_png` accepts, at most 1 MB at once.

    Raises
    ------
    BundleError
        If they are damaged, or too few or too many for its size. No more than 1 MB is unpacked at once.
    """
    width, height = struct.unpack(">II", data[16:24])
    wanted, found = height * (1 + width * (3 if data[25] == RGB else 1)), 0
    engine = zlib.decompressobj()
    for kind, body in chunks_of(data):
        for block in _inflate(name, engine, body) if kind == b"IDAT" else ():
            found += len(block)
            if found > wanted:
                raise BundleError(f"{name}: the image has {found} bytes or more, want {wanted}")
            yield block
    if found != wanted or not engine.eof or engine.unused_data:
        raise BundleError(f"{name}: the image has {found} bytes, or others behind them, want {wanted}")


def chunks_of(data: bytes) -> Iterator[tuple[bytes, memoryview]]:
    """Yield the kind and the content of each chunk of a picture whose sizes hold."""
    at, view = 8, memoryview(data)
    while at < len(data):
        count = struct.unpack(">I", data[at : at + 4])[0]
        yield data[at + 4 : at + 8], view[at + 8 : at + 8 + count]
        at += 12 + count


def _inflate(name: str, engine: zlib._Decompress, packed: memoryview) -> Iterator[bytes]:
    """Yield what packed bytes hold, block by block, so that nothing large is unpacked."""
    rest: bytes | memoryview = packed
    while True:
        try:
            block = engine.decompress(rest, _BLOCK)
        except zlib.error as error:
            raise BundleError(f"{name}: the image is damaged: its data cannot be unpacked") from error
        if block:
            yield block
        rest = engine.unconsumed_tail
        if not rest and len(block) < _BLOCK:
            return


def check_png(name: str, data: bytes, colours: tuple[int, ...], most_px: int) -> tuple[int, int]:
    """Return a picture's width and height.

    Raises
    ------
    BundleError
        If it is no PNG of 8 bits a channel with one of these kinds of colours, has more pixels, holds other chunks
        than a header, a palette where it needs one, the image and the end, or a checksum is wrong.
    """
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise BundleError(f"{name}: not a PNG")
    at, kinds, size_px, kind_of_colour = 8, [], (0, 0), -1
    while at < len(data):
        if at + 12 > len(data) or at + 12 + (size := struct.unpack(">I", data[at : at + 4])[0]) > len(data):
            raise BundleError(f"{name}: a chunk ends beyond the file")
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        if zlib.crc32(data[at + 4 : at + 8 + size]) != struct.unpack(">I", data[at + 8 + size : at + 12 + size])[0]:
            raise BundleError(f"{name}: the checksum of chunk {kind!r} is wrong")
        if kind == b"IHDR" and size == 13:
            width, height, *form = struct.unpack(">IIBBBBB", body)
            size_px = width, height
            if not 0 < width * height <= most_px or form not in [[8, kind, 0, 0, 0] for kind in colours]:
                raise BundleError(
                    f"{name}: {width} x {height} px of form {form}, want at most {most_px} px of form "
                    f"{' or '.join(str([8, kind, 0, 0, 0]) for kind in colours)}"
                )
            kind_of_colour = form[1]
        elif kind == b"PLTE" and not (0 < size <= 768 and size % 3 == 0):
            raise BundleError(f"{name}: a palette of {size} bytes, want 3 for each of at most 256 colours")
        kinds.append(kind)
        if len(kinds) > 16 + len(data) // _CHUNK:
            raise BundleError(f"{name}: more than {len(kinds) - 1} chunks in {len(data)} bytes")
        at += 12 + size
    before = [b"IHDR", b"PLTE"] if kind_of_colour == PALETTE else [b"IHDR"]
    image = kinds[len(before) : -1]
    if size_px == (0, 0) or kinds[: len(before)] != before or kinds[-1] != b"IEND" or set(image) != {b"IDAT"}:
        found = sorted({kind.decode("ascii", "replace") for kind in kinds})
        raise BundleError(f"{name}: chunks {found}, want {', '.join(k.decode() for k in before)}, IDAT, IEND")
    return size_px
