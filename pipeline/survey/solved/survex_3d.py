"""Reader of Survex's solved surveys (.3d), versions 3 to 8."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.plain_file import read_text_bytes
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.solved.labels import Cursor, read_label, read_old_label, trim_old_label
from pipeline.survey.solved.model import LegStyle, Passage, SolvedSurvey, StationFlag

_MAGIC = b"Survex 3D Image File\n"
_VERSIONS = range(3, 9)
_EXTENDED = 0x80
_ERROR_BYTES = 20
_KEPT = 0x20  # of a leg's code in version 8: the label stays
_LEG_BITS, _STATION_BITS = 0x07, 0x7F
_DATE_BYTES = {0x10: 0, 0x11: 2, 0x12: 3, 0x13: 4}  # version 8
_OLD_DATE_BYTES = {0x20: 2, 0x21: 3, 0x23: 4, 0x24: 0}  # version 7
_OLDEST_DATE_BYTES = {0x20: 4, 0x21: 8}  # versions 4 to 6


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
        If the file is no `.3d` of versions 3 to 8, ends early, holds a reserved code, or exceeds a limit. The message
        names the file and the byte.

    References
    ----------
    Survex, "Survex 3d Format Specification (v8+)" and "(v3-v7)", 3dformat.htm and 3dformat-old.htm.
    """
    reader = _Survex3dReader(path, read_text_bytes(path))
    reader.read()
    return reader.survey()


class _Survex3dReader:
    """The state of one reading: the position in the file, the label, and what was found."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.cursor = path, Cursor(path, data)
        self.label = bytearray()
        self.version, self.title, self.date = 0, "", ""
        self.crs: str | None = None
        self.index: dict[tuple[int, int, int], int] = {}  # the first station at a place
        self.by_name: dict[str, int] = {}
        self.names: list[str] = []
        self.places: list[tuple[int, int, int]] = []
        self.station_flags: list[int] = []
        self.legs: list[tuple[int, int]] = []
        self.leg_flags: list[int] = []
        self.leg_styles: list[int] = []
        self.passages: list[list[tuple[str, list[float], int]]] = [[]]
        self.lines: list[tuple[tuple[int, int, int], tuple[int, int, int]]] = []
        self.style = int(LegStyle.UNKNOWN)
        self.here: tuple[int, int, int] | None = None

    def read(self) -> None:
        self._read_header()
        most, count = reader_limits().solved_items, 0
        step = self._read_new if self.version >= 8 else self._read_old
        while step(self.cursor.byte()):
            count += 1
            if count > most:
                raise InputError(f"{self.path}: more than {most} items, the limit (solved_items in {FILE})")

    def _read_header(self) -> None:
        cursor = self.cursor
        if cursor.take(min(len(_MAGIC), len(cursor.data))) != _MAGIC:
            raise InputError(f"{self.path}: not a Survex .3d file (it does not begin with {_MAGIC[:-1].decode()!r})")
        version = cursor.line()
        known = {f"v{number}".encode(): number for number in _VERSIONS}
        if version not in known:
            raise InputError(f"{self.path}: .3d version {version[:12].decode('latin-1')!r}; versions v3 to v8 are read")
        self.version = known[version]
        title = cursor.line().split(b"\0") if self.version >= 8 else [cursor.line()]
        self.title = title[0][:1000].decode("utf-8", "replace")
        if len(title) > 1 and title[1]:
            self.crs = title[1][:1000].decode("utf-8", "replace")
        self.date = cursor.line()[:100].decode("utf-8", "replace")
        if self.version >= 8 and cursor.byte() & _EXTENDED:
            raise InputError(f"{self.path}: an extended elevation, which is a drawing; give the survey itself")

    def _read_new(self, code: int) -> bool:
        """Read one item of version 8; return whether more follow."""
        if code <= 0x04:
            if code == 0 and self.style == LegStyle.NORMAL:
                return False
            self.style = code
        elif code == 0x0F:
            self.here = self.cursor.place()
        elif code in _DATE_BYTES:
            self.cursor.take(_DATE_BYTES[code])
        elif code == 0x1F:
            self.cursor.take(_ERROR_BYTES)
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

    def _read_old(self, code: int) -> bool:
        """Read one item of versions 3 to 7; return whether more follow."""
        dates = {3: {}, 7: _OLD_DATE_BYTES}.get(self.version, _OLDEST_DATE_BYTES)
        if code == 0:
            if not self.label:
                return False
            self.label.clear()
        elif code == 0x0F:
            self.here = self.cursor.place()
        elif code < 0x20:
            trim_old_label(self.cursor, self.label, code)
        elif code in dates:
            self.cursor.take(dates[code])
        elif code == 0x22 and self.version >= 6:
            self.cursor.take(_ERROR_BYTES)
        elif 0x30 <= code <= 0x33 and self.version >= 5:
            read_old_label(self.cursor, self.label)
            self._section(code)
        elif 0x40 <= code <= 0x7F:
            read_old_label(self.cursor, self.label)
            self._station(code & _STATION_BITS & 0x1F)
        elif 0x80 <= code <= 0xBF:
            read_old_label(self.cursor, self.label)
            self._leg(code)
        else:
            self._refuse(code)
        return True

    def _refuse(self, code: int) -> None:
        at = self.cursor.at - 1
        raise InputError(
            f"{self.path}: byte {at}: code 0x{code:02x} is reserved in version {self.version}; it is broken"
        )

    def _station(self, flags: int) -> None:
        place, name = self.cursor.place(), self.label.decode("utf-8", "replace")
        if flags & StationFlag.ANONYMOUS:
            name = ""
        known = self.by_name.get(name)
        if name and known is not None:
            if self.places[known] != place:
                raise InputError(f"{self.path}: byte {self.cursor.at}: station {name[:60]} has two positions")
            return
        self._add(name, place, flags)

    def _add(self, name: str, place: tuple[int, int, int], flags: int) -> int:
        number = len(self.names)
        self.names.append(name)
        self.places.append(place)
        self.station_flags.append(flags)
        first = self.index.setdefault(place, number)
        if name and not self.names[first]:
            self.index[place] = number  # a named station stands for its place
        if name:
            self.by_name[name] = number
        return number

    def _leg(self, code: int) -> None:
        if self.here is None:
            raise InputError(f"{self.path}: byte {self.cursor.at}: a leg without a start")
        end = self.cursor.place()
        self.lines.append((self.here, end))
        self.leg_flags.append(code & _LEG_BITS)
        self.leg_styles.append(self.style)
        self.here = end

    def _section(self, code: int) -> None:
        size = "<4h" if code < 0x32 else "<4i"
        numbers = struct.unpack(size, self.cursor.take(struct.calcsize(size)))
        lrud = [n / 100 if n >= 0 else float("nan") for n in numbers]
        self.passages[-1].append((self.label.decode("utf-8", "replace"), lrud, self.cursor.at))
        if code & 0x01:
            self.passages.append([])

    def _end(self, place: tuple[int, int, int]) -> int:
        found = self.index.get(place)
        return self._add("", place, int(StationFlag.ANONYMOUS)) if found is None else found

    def survey(self) -> SolvedSurvey:
        legs = [(self._end(start), self._end(end)) for start, end in self.lines]
        passages = tuple(self._passage(rows) for rows in self.passages if rows)
        return SolvedSurvey(
            tuple(self.names),
            np.array(self.places, np.float64).reshape(-1, 3) / 100,
            np.array(self.station_flags, np.uint8),
            np.array(legs, np.int64).reshape(-1, 2),
            np.array(self.leg_flags, np.uint8),
            np.array(self.leg_styles, np.uint8),
            passages,
            self.title,
            self.crs,
            self.date,
        )

    def _passage(self, rows: list[tuple[str, list[float], int]]) -> Passage:
        for name, _, at in rows:
            if name not in self.by_name:
                raise InputError(f"{self.path}: byte {at}: a cross-section of {name[:60]!r}, which is no station")
        stations = np.array([self.by_name[name] for name, _, _ in rows], np.int64)
        return Passage(stations, np.array([lrud for _, lrud, _ in rows], np.float64))
