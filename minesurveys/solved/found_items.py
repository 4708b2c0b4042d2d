"""What is found in a `.3d` file, item by item, and the survey that it makes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solved.model import LegStyle, Passage, SolvedSurvey, StationFlag

Place = tuple[int, int, int]  # east, north, up, cm


class FoundItems:
    """Stations, legs and cross-sections of a file, in its order.

    A leg names no stations; its ends are the stations at its coordinates. An end without a station becomes an anonymous
    station.
    """

    def __init__(self, path: Path) -> None:
        """Begin without items."""
        self.path, self.count = path, 0
        self.names: list[str] = []
        self.places: list[Place] = []
        self.station_flags: list[int] = []
        self.lines: list[tuple[Place, Place]] = []
        self.leg_flags: list[int] = []
        self.leg_styles: list[int] = []
        self.passages: list[list[tuple[str, list[float]]]] = [[]]
        self.here: Place | None = None
        self.style = int(LegStyle.UNKNOWN)
        self.adjusted: list[int] = []  # the first leg of each traverse whose misclosure was shared out
        self._begin = 0  # the first leg since the last move
        self._first_at: dict[Place, int] = {}
        self._by_name: dict[str, int] = {}
        self._renamed: dict[tuple[str, Place], str] = {}

    def count_item(self) -> None:
        """Refuse a file of too many items."""
        self.count += 1
        most = reader_limits().solved_items
        if self.count > most:
            raise InputError(f"{self.path}: more than {most} items, the limit (solved_items in {FILE})")

    def station(self, name: str, place: Place, flags: int) -> None:
        """Add a station. One whose name is taken at another place, as Therion writes them, gets a number."""
        if flags & StationFlag.ANONYMOUS:
            name = ""
        known = self._by_name.get(name)
        if name and known is not None and self.places[known] != place:
            if (name, place) in self._renamed:
                return
            self._renamed[name, place] = f"{name} ({len(self._renamed) + 2})"
            name = self._renamed[name, place]
        elif name and known is not None:
            return
        self._add(name, place, flags)

    def move(self, place: Place) -> None:
        """Begin a row of legs."""
        self.here, self._begin = place, len(self.lines)

    def close(self) -> None:
        """Read that the misclosure of the row of legs was shared out among them."""
        if self._begin < len(self.lines):
            self.adjusted.append(self._begin)

    def leg(self, end: Place, flags: int, at: int) -> None:
        """Add a leg from the last place to another one."""
        if self.here is None:
            raise InputError(f"{self.path}: byte {at}: a leg without a start")
        self.lines.append((self.here, end))
        self.leg_flags.append(flags)
        self.leg_styles.append(self.style)
        self.here = end

    def section(self, name: str, lrud_m: list[float], is_last: bool) -> None:
        """Add a cross-section to the open passage; the last one closes it."""
        self.passages[-1].append((name, lrud_m))
        if is_last:
            self.passages.append([])

    def survey(self, title: str, crs: str | None, date: str) -> SolvedSurvey:
        """Return the survey that the items make, and warn of names that stood at several places."""
        if self._renamed:
            (first, _), renamed = next(iter(self._renamed.items()))
            count = len(self._renamed)
            warn_user(
                f"stations have names of others elsewhere: {first[:60]} is {renamed[:60]}", of=self.path, count=count
            )
        self._begin_at_stations()
        legs = [(self._end(start), self._end(end)) for start, end in self.lines]
        passages = tuple(self._passage(rows) for rows in self._rows() if rows)
        return SolvedSurvey(
            tuple(self.names),
            np.array(self.places, np.float64).reshape(-1, 3) / 100,
            np.array(self.station_flags, np.uint8),
            np.array(legs, np.int64).reshape(-1, 2),
            np.array(self.leg_flags, np.uint8),
            np.array(self.leg_styles, np.uint8),
            passages,
            title,
            crs,
            date,
        )

    def _begin_at_stations(self) -> None:
        """Let traverses from a fix with deviations begin at its station.

        `cavern` writes their first leg from the place that was stated, where no station is
        (findings/survex-leg-ends-at-no-station.sh). The station is the nearest one with a fix.
        """
        fixed = [
            place for place, flags in zip(self.places, self.station_flags, strict=True) if flags & StationFlag.FIXED
        ]
        if not fixed:
            return
        places = np.array(fixed, float)
        for leg in self.adjusted:
            start, end = self.lines[leg]
            if start not in self._first_at:
                far = np.linalg.norm(places - start, axis=1)
                far[(places == end).all(axis=1)] = np.inf
                if np.isfinite(far.min()):
                    self.lines[leg] = (fixed[int(far.argmin())], end)

    def _add(self, name: str, place: Place, flags: int) -> int:
        number = len(self.names)
        self.names.append(name)
        self.places.append(place)
        self.station_flags.append(flags)
        first = self._first_at.setdefault(place, number)
        if name and not self.names[first]:
            self._first_at[place] = number  # a named station stands for its place
        if name:
            self._by_name[name] = number
        return number

    def _end(self, place: Place) -> int:
        found = self._first_at.get(place)
        return self._add("", place, int(StationFlag.ANONYMOUS)) if found is None else found

    def _rows(self) -> Iterator[list[tuple[str, list[float]]]]:
        """Yield rows of cross-sections of stations that the file has, and warn of others.

        Survex 1.4.10 and newer leave out stations that hang on no fixed one, and keep their cross-sections.
        """
        unknown: dict[str, None] = {}
        for rows in self.passages:
            part: list[tuple[str, list[float]]] = []
            for name, lrud_m in rows:
                if name in self._by_name:
                    part.append((name, lrud_m))
                    continue
                unknown[name] = None
                yield part
                part = []
            yield part
        if unknown:
            warn_user(
                "cross-sections are of no station of the file and are left out: the first is that of "
                f"{next(iter(unknown))[:60]}",
                of=self.path.name,
                count=len(unknown),
            )

    def _passage(self, rows: list[tuple[str, list[float]]]) -> Passage:
        stations = np.array([self._by_name[name] for name, _ in rows], np.int64)
        return Passage(stations, np.array([lrud for _, lrud in rows], np.float64))
