"""Items of `.3d` files of versions 0.01 (text), 1 and 2 (binary), which some programs still write."""

from __future__ import annotations

import re

from pipeline.errors import InputError
from pipeline.guard.plain_number import plain_number
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.solved.found_items import FoundItems, Place
from pipeline.survey.solved.labels import Cursor
from pipeline.survey.solved.model import StationFlag

_WORD = re.compile(rb"\s*(\S+)")
_NAME = re.compile(rb" ?+([^ \n]*) ")
_FARTHEST_M = 2e7  # four bytes of centimetres hold as much in the other versions
_ENDS = (0, -1)
_CROSS, _NAME_HERE, _NAME_AT, _MOVE, _LINE, _NAME_COUNTED, _NAME_FLAGGED = range(1, 8)
_LEG_BITS, _STATION_BITS = 0x07, 0x3F


def read_text_items(cursor: Cursor, found: FoundItems) -> None:
    """Read the items of version 0.01: a word, and coordinates in metres, which are rounded to centimetres.

    `move` and `draw` have one place, `line` has two, `name` has a name and a place, and `cross` marks a station.

    Raises
    ------
    InputError
        If a word is unknown, a number is missing or not finite, or a limit is exceeded. The message names the byte.
    """
    while (word := _word(cursor)) is not None:
        found.count_item()
        if word == b"name":
            name, place = _text_name(cursor), _text_place(cursor)
            if name:
                found.station(name, place, int(StationFlag.UNDERGROUND))
        elif word == b"draw":
            found.leg(_text_place(cursor), 0, cursor.at)
        elif word in (b"move", b"line"):
            found.here = _text_place(cursor)
            if word == b"line":
                found.leg(_text_place(cursor), 0, cursor.at)
        elif word == b"cross":
            _text_place(cursor)
        else:
            raise InputError(
                f"{cursor.path}: byte {cursor.at}: {word[:20].decode('latin-1')!r} is no item; it is broken"
            )


def read_binary_items(cursor: Cursor, found: FoundItems, version: int) -> None:
    """Read the items of version 1, whose codes have four bytes, or 2, whose codes have one.

    Raises
    ------
    InputError
        If a code is unknown, the file ends early, or a limit is exceeded. The message names the byte.
    """
    size = 4 if version == 1 else 1
    place: Place = (0, 0, 0)  # the last one, where a name without a place stands
    while (code := _code(cursor.take(size))) not in _ENDS:
        found.count_item()
        if code == _CROSS:
            cursor.place()
        elif code == _MOVE:
            place = cursor.place()
            # Version 1 moves to where a name stands, and draws on from where it was.
            if version == 2 or _code(cursor.data[cursor.at : cursor.at + size]) != _NAME_HERE:
                found.here = place
        elif code == _LINE or 0x80 <= code < 0xC0:
            place = cursor.place()
            found.leg(place, 0 if code == _LINE else code & _LEG_BITS, cursor.at)
        else:
            name, flags = _binary_name(cursor, code)
            if name:  # names without letters have no place; some programs wrote them by mistake
                place = place if code == _NAME_HERE else cursor.place()
                found.station(name, place, flags)


def _code(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=len(data) == 4)


def _binary_name(cursor: Cursor, code: int) -> tuple[str, int]:
    """Return the name and the flags of a station whose code was read."""
    flags = int(StationFlag.UNDERGROUND)
    if code in (_NAME_HERE, _NAME_AT) or 0x40 <= code < 0x80:
        flags = code & _STATION_BITS if code >= 0x40 else flags
        name = cursor.line()
    elif code in (_NAME_COUNTED, _NAME_FLAGGED):
        flags = cursor.byte() if code == _NAME_FLAGGED else flags
        name = cursor.take(int.from_bytes(cursor.take(4), "little"))
    else:
        raise InputError(f"{cursor.path}: byte {cursor.at}: code 0x{code & 0xFFFFFFFF:02x} is unknown; it is broken")
    return _plain(cursor, name), flags


def _word(cursor: Cursor) -> bytes | None:
    """Return the next word, or None at the end of the file."""
    found = _WORD.match(cursor.data, cursor.at)
    if found is None:
        return None
    cursor.at = found.end()
    return found[1]


def _text_name(cursor: Cursor) -> str:
    found = _NAME.match(cursor.data, cursor.at)
    if found is None:
        raise InputError(f"{cursor.path}: byte {cursor.at}: a name without a place; it is broken")
    cursor.at = found.end()
    return _plain(cursor, found[1])


def _text_place(cursor: Cursor) -> Place:
    """Return three numbers of metres in whole centimetres."""
    east, north, up = (_centimetres(cursor, _word(cursor)) for _ in range(3))
    return east, north, up


def _centimetres(cursor: Cursor, word: bytes | None) -> int:
    text = "the end" if word is None else word[:40].decode("latin-1")
    try:
        metres = plain_number(text)
    except ValueError:
        raise InputError(f"{cursor.path}: byte {cursor.at}: {text!r} is no number of metres") from None
    if not abs(metres) <= _FARTHEST_M:
        raise InputError(f"{cursor.path}: byte {cursor.at}: {text!r} is no number of metres below {_FARTHEST_M:g}")
    return round(metres * 100)


def _plain(cursor: Cursor, name: bytes) -> str:
    """Return a name without the backslash that old names begin with."""
    most = reader_limits().survex_name_bytes
    if len(name) > most:
        raise InputError(
            f"{cursor.path}: byte {cursor.at}: a name of more than {most} bytes (survex_name_bytes in {FILE})"
        )
    return name.removeprefix(b"\\").decode("utf-8", "replace")
