"""Tags of a TIFF's pictures, read without a library. An Exif block is a small TIFF, so this reads its tags as well."""

from __future__ import annotations

import struct

_TYPES = {1: "B", 3: "H", 4: "I", 16: "Q"}
_MOST_TAGS, _MOST_PICTURES = 4096, 1000
WIDTH, HEIGHT, BITS, ORIENTATION, CHANNELS, TILE_WIDTH, TILE_HEIGHT = 256, 257, 258, 274, 277, 322, 323
_SUBFILE = 254
_NO_PAGE = 0b101  # a smaller copy of a picture (an overview), or a mask
_READ = (_SUBFILE, WIDTH, HEIGHT, BITS, ORIENTATION, CHANNELS, TILE_WIDTH, TILE_HEIGHT)


def first_tags(data: memoryview) -> dict[int, int]:
    """Return the tags of the first picture that say how large it is and how it stands.

    Raises
    ------
    struct.error, KeyError
        If the header is cut off, or a tag has no type of a whole number.
    """
    order, big, at = _begin(data)
    return _tags(data, order, big, at)[0]


def count_pages(data: memoryview) -> int:
    """Return how many pictures a TIFF holds, without overviews and masks; a broken list ends the count."""
    order, big, at = _begin(data)
    seen: set[int] = set()
    pages = 0
    try:
        while at and at not in seen and len(seen) < _MOST_PICTURES:
            seen.add(at)
            tags, at = _tags(data, order, big, at)
            pages += not tags.get(_SUBFILE, 0) & _NO_PAGE
    except (struct.error, KeyError):
        pass
    return max(pages, 1)


def _begin(data: memoryview) -> tuple[str, bool, int]:
    """Return the byte order, whether offsets have eight bytes (BigTIFF), and where the first picture's tags begin."""
    order = "<" if bytes(data[:2]) == b"II" else ">"
    big = struct.unpack_from(order + "H", data, 2)[0] == 43
    return order, big, struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)[0]


def _tags(data: memoryview, order: str, big: bool, at: int) -> tuple[dict[int, int], int]:
    """Return the tags at a place, the first value of each, and the place of the next picture's tags or 0."""
    offset = order + ("Q" if big else "I")
    count = struct.unpack_from(order + ("Q" if big else "H"), data, at)[0]
    at, step, value = (at + 8, 20, 12) if big else (at + 2, 12, 8)
    tags: dict[int, int] = {}
    for entry in range(min(count, _MOST_TAGS)):
        tag, kind = struct.unpack_from(order + "HH", data, at + entry * step)
        if tag in _READ:
            number = struct.unpack_from(offset, data, at + entry * step + 4)[0]
            inline = number * struct.calcsize(_TYPES[kind]) <= (8 if big else 4)
            place = at + entry * step + value
            place = place if inline else struct.unpack_from(offset, data, place)[0]
            tags[tag] = struct.unpack_from(order + _TYPES[kind], data, place)[0]
    end = at + count * step
    following = struct.unpack_from(offset, data, end)[0] if end + struct.calcsize(offset) <= len(data) else 0
    return tags, following
