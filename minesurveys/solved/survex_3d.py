"""Reader of Survex's solved surveys (.3d): the header, and the items of version 8, which Survex writes since 2013."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.limits import FILE, reader_limits
from minesurveys.solved.found_items import FoundItems
from minesurveys.solved.model import LegStyle, SolvedSurvey

_MAGIC = b"Survex 3D Image File\n"
_VERSION = b"v8"
_EXTENDED = 0x80
_ERROR_BYTES = 20
_KEPT = 0x20  # of a leg's code: the label stays
_LEG_BITS, _STATION_BITS = 0x07, 0x7F
_DATE_BYTES = {0x10: 0, 0x11: 2, 0x12: 3, 0x13: 4}


@dataclass(frozen=True)
class _Header:
    """What stands before the items."""

    title: str
    crs: str | None
    date: str


def read_3d(path: Path) -> SolvedSurvey:
    """Read a solved survey.

    Coordinates are whole centimetres, so positions are exact to 5 mm. A leg names no stations; its ends are the
    stations at its coordinates. An end without a station becomes an anonymous station.

    Parameters
    ----------
    path : Path

    Returns
    -------
    SolvedSurvey
        Extended elevations, which are drawings and no surveys, are refused.

    Raises
    ------
    InputError
        If the file is no `.3d` of version 8, ends early, holds a reserved code, or exceeds a limit. The
        message names the file and the byte.

    References
    ----------
    Survex, "Survex 3d Format Specification (v8+)", 3dformat.htm.
    """
    cursor = Cursor(path, read_text_bytes(path))
    header = _read_header(cursor)
    found = FoundItems(path)
    _ItemReader(cursor, found).read()
    return found.survey(header.title, header.crs, header.date)


def _read_header(cursor: Cursor) -> _Header:
    if cursor.take(min(len(_MAGIC), len(cursor.data))) != _MAGIC:
        raise InputError(f"{cursor.path}: not a Survex .3d file (it does not begin with {_MAGIC[:-1].decode()!r})")
    named = cursor.line()
    if named != _VERSION:
        name = named[:12].decode("latin-1")
        raise InputError(
            f"{cursor.path}: .3d version {name!r}; v8 is read, which Survex since 2013 and Therion 6 write: solve the "
            "survey again, give the .lox that Therion wrote, or Survex's survexport converts the file to Compass's .plt"
        )
    texts = cursor.line().split(b"\0")
    title = texts[0][:1000].decode("utf-8", "replace")
    crs = texts[1][:1000].decode("utf-8", "replace") if len(texts) > 1 and texts[1] else None
    date = cursor.line()[:100].decode("utf-8", "replace")
    if cursor.byte() & _EXTENDED:
        raise InputError(f"{cursor.path}: an extended elevation, which is a drawing; give the survey itself")
    return _Header(title, crs, date)


class _ItemReader:
    """A reading of items: the position in the file, and the label that every item changes a little."""

    def __init__(self, cursor: Cursor, found: FoundItems) -> None:
        self.cursor, self.found = cursor, found
        self.label = bytearray()

    def read(self) -> None:
        while self._read_item(self.cursor.byte()):
            self.found.count_item()

    def _read_item(self, code: int) -> bool:
        """Read one item; return whether more follow."""
        if code <= 0x04:
            if code == 0 and self.found.style == LegStyle.NORMAL:
                return False
            self.found.style = code
        elif code == 0x0F:
            self.found.move(self.cursor.place())
        elif code in _DATE_BYTES:
            self.cursor.take(_DATE_BYTES[code])
        elif code == 0x1F:
            self.cursor.take(_ERROR_BYTES)
            self.found.close()
        elif 0x30 <= code <= 0x33:
            read_label(self.cursor, self.label)
            self._section(code)
        elif 0x40 <= code <= 0x7F:
            if not code & _KEPT:
                read_label(self.cursor, self.label)
            self._leg(code)
        elif code >= 0x80:
            read_label(self.cursor, self.label)
            self._station(code & _STATION_BITS)
        else:
            self._refuse(code)
        return True

    def _refuse(self, code: int) -> None:
        at = self.cursor.at - 1
        raise InputError(f"{self.cursor.path}: byte {at}: code 0x{code:02x} is reserved; it is broken")

    def _name(self) -> str:
        return self.label.decode("utf-8", "replace")

    def _station(self, flags: int) -> None:
        place = self.cursor.place()
        self.found.station(self._name(), place, flags)

    def _leg(self, code: int) -> None:
        end = self.cursor.place()
        self.found.leg(end, code & _LEG_BITS, self.cursor.at)

    def _section(self, code: int) -> None:
        size = "<4h" if code < 0x32 else "<4i"
        numbers = struct.unpack(size, self.cursor.take(struct.calcsize(size)))
        lrud_m = [n / 100 if n >= 0 else float("nan") for n in numbers]
        self.found.section(self._name(), lrud_m, bool(code & 0x01))


class Cursor:
    """A position in a file's bytes."""

    def __init__(self, path: Path, data: bytes) -> None:
        """Begin at the first byte."""
        self.path, self.data, self.at = path, data, 0

    def take(self, count: int) -> bytes:
        """Return the next bytes; refuse a file that ends before them."""
        end = self.at + count
        if end > len(self.data):
            raise InputError(f"{self.path}: ends at byte {len(self.data)} within an item; it is cut off")
        taken, self.at = self.data[self.at : end], end
        return taken

    def byte(self) -> int:
        """Return the next byte."""
        return self.take(1)[0]

    def line(self) -> bytes:
        """Return the bytes up to the next line feed, without it."""
        end = self.data.find(b"\n", self.at)
        if end < 0:
            raise InputError(f"{self.path}: ends at byte {len(self.data)} within its header; it is cut off")
        return self.take(end + 1 - self.at)[:-1]

    def place(self) -> tuple[int, int, int]:
        """Return three coordinates, cm."""
        x, y, z = struct.unpack("<3i", self.take(12))
        return x, y, z


def read_label(cursor: Cursor, label: bytearray) -> None:
    """Change the label as an item states: remove bytes from its end, then add bytes."""
    first = cursor.byte()
    if first:
        remove, add = first >> 4, first & 0x0F
    else:
        remove, add = _count(cursor), _count(cursor)
    _remove(cursor, label, remove)
    _add(cursor, label, add)


def _count(cursor: Cursor) -> int:
    count = cursor.byte()
    return struct.unpack("<I", cursor.take(4))[0] if count == 0xFF else count


def _remove(cursor: Cursor, label: bytearray, count: int) -> None:
    if count > len(label):
        raise InputError(f"{cursor.path}: byte {cursor.at}: {count} bytes of a label of {len(label)} are removed")
    del label[len(label) - count :]


def _add(cursor: Cursor, label: bytearray, count: int) -> None:
    most = reader_limits().survex_name_bytes
    if len(label) + count > most:
        raise InputError(
            f"{cursor.path}: byte {cursor.at}: a name of more than {most} bytes (survex_name_bytes in {FILE})"
        )
    label += cursor.take(count)
