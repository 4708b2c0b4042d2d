"""Where and when a Therion project was surveyed: its coordinate system, its middle, and its first date."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass

import numpy as np
import pyproj

from minesurveys.coordinates.map_axes import other_units
from minesurveys.errors import InputError
from minesurveys.survex.convergence import convergence_deg
from minesurveys.therion.dates import CENTRELINES, Dates, year_of
from minesurveys.therion.lines import TherionLine
from minesurveys.therion.words import number_for_survex

_SQUARE_M = 100_000.0
_LETTERS = "ABCDEFGHJKLMNOPQRSTUVWXYZ"
_DEGREES = "long-lat"  # as Survex calls it


@dataclass(frozen=True)
class System:
    """A coordinate system by Survex's name. `metric` is empty for degrees.

    Coordinates of a system that `is_reversed` are counted to the west and to the south. Therion has that to the west
    first, whatever the system's own order.
    """

    name: str
    metric: str
    is_latitude_first: bool = False
    is_reversed: bool = False

    def east_north(self, first: float, second: float) -> tuple[float, float]:
        """Return coordinates as a file states them as those to the east and to the north."""
        if self.is_latitude_first:
            return second, first
        return (-first, -second) if self.is_reversed else (first, second)


@dataclass(frozen=True)
class Place:
    """The first coordinate system of a project, the mean of its fixed stations there, and its first date.

    `convergence_deg` is the angle from true north to grid north there.
    """

    line: TherionLine
    cs: str
    cs_out: str
    middle: tuple[float, float, float]
    convergence_deg: float
    date: str


def cs_for_survex(where: str, words: tuple[str, ...]) -> System:
    """Return a coordinate system for `*cs`, and the metric one in which the result is wanted.

    Raises
    ------
    InputError
        If Survex does not know it.
    """
    name = " ".join(words)
    upper = name.upper()
    if upper in ("LAT-LONG", "LONG-LAT", "EPSG:4326"):
        return System(_DEGREES, "", upper != "LONG-LAT")
    if re.fullmatch(r"OSGB:[HNOST][A-HJ-Z]", upper):
        return System(upper, "EPSG:27700")
    if upper in ("S-MERC", "IJTSK", "IJTSK03"):
        return System(upper, upper)
    if upper in ("JTSK", "JTSK03"):
        return System(*2 * (f"I{upper}",), is_reversed=True)
    if re.fullmatch(r"(EPSG|ESRI):\d{3,6}", upper):
        return _of_authority(where, upper)
    zone = re.fullmatch(r"(UTM|ETRS)(\d{1,2})([NS]?)", upper)
    if zone and zone[1] == "ETRS" and 28 <= int(zone[2]) <= 37 and not zone[3]:
        return System(f"EPSG:{25800 + int(zone[2])}", f"EPSG:{25800 + int(zone[2])}")
    if zone and zone[1] == "UTM" and 1 <= int(zone[2]) <= 60:
        return System(*2 * (f"UTM{int(zone[2])}{zone[3] or 'N'}",))
    raise InputError(
        f"{where}: cs {name[:40]!r} is not supported; "
        "use EPSG, ESRI, UTM, ETRS, OSGB, S-MERC, JTSK, lat-long or long-lat"
    )


def _of_authority(where: str, name: str) -> System:
    """Return a system of EPSG or ESRI; in place of axes to the west and the south, it has axes to the east and north.

    Raises
    ------
    InputError
        If it is unknown, or counts in another unit than metres: Survex and Therion would take these for metres.
    """
    try:
        found = pyproj.CRS.from_user_input(name)
    except pyproj.exceptions.ProjError as error:
        raise InputError(f"{where}: cs {name}: it is unknown") from error
    units = other_units(found)
    if units:
        raise InputError(
            f"{where}: cs {name} counts in {units}, not in metres; state the stations in another "
            "system (UTM), or of degrees lat-long or long-lat"
        )
    if {axis.direction for axis in found.axis_info[:2]} != {"west", "south"}:
        return System(name, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # PROJ strings name no datum; that the survey's own are kept is all we need
        text = found.to_proj4()
    east_north = re.sub(r"\+(axis|type)=\S+ ?", "", text).strip()
    return System(*2 * (f'custom "{east_north}"',), is_reversed=True)


def place_of(lines: list[TherionLine], dates: Dates) -> Place | None:
    """Return where a project lies, or None if it names no coordinate system or fixes no station in it.

    Raises
    ------
    InputError
        If a coordinate system is not supported, or the fixed stations do not lie within it.
    """
    first, current = None, None
    fixes: list[list[float]] = []
    for line in lines:
        word = line.words[0]
        if word in CENTRELINES:
            current = None
        elif word == "cs":
            current = cs_for_survex(line.where, line.words[1:])
            first = first or (line, current)
        elif word == "fix" and first and current == first[1] and len(line.words) >= 5:
            x, y, up = (float(number_for_survex(line.where, text)) for text in line.words[2:5])
            fixes.append([*current.east_north(x, y), up])
    if first is None or not fixes:
        return None
    line, system = first
    east, north, up = np.mean(fixes, axis=0).tolist()
    cs, out = system.name, system.metric or _utm_zone(east, north)
    earliest = min(dates.values(), key=year_of, default="")
    return Place(line, cs, out, (east, north, up), _convergence_deg(line, cs, out, east, north), earliest)


def _convergence_deg(line: TherionLine, cs: str, out: str, east: float, north: float) -> float:
    """Return the angle from true north to the north of a metric system at a place, as Therion finds it."""
    try:
        system = pyproj.CRS.from_user_input(_proj_name(out))
        if cs.startswith("OSGB:"):
            east, north = east + _square(cs)[0], north + _square(cs)[1]
        elif cs != out:
            to_out = pyproj.Transformer.from_crs(_proj_name(cs), system, always_xy=True)
            east, north = to_out.transform(east, north)
        angle = convergence_deg(system, east, north)
    except pyproj.exceptions.ProjError as error:
        raise InputError(f"{line.where}: cs {cs}: it is unknown, or the fixed stations lie outside") from error
    if not np.isfinite(angle):
        raise InputError(f"{line.where}: the fixed stations lie outside cs {cs}")
    return angle


def _utm_zone(longitude_deg: float, latitude_deg: float) -> str:
    zone = int(np.clip((longitude_deg + 180) // 6 + 1, 1, 60))
    return f"EPSG:{(32600 if latitude_deg >= 0 else 32700) + zone}"


def _square(cs: str) -> tuple[float, float]:
    """Return the south-west corner of a square of 100 km of the British National Grid, m east and north."""
    major, minor = (_LETTERS.index(letter) for letter in cs.removeprefix("OSGB:"))
    east = (major - 2) % 5 * 5 + minor % 5
    north = 19 - major // 5 * 5 - minor // 5
    return east * _SQUARE_M, north * _SQUARE_M


def _proj_name(cs: str) -> str:
    if cs.startswith("UTM"):
        zone, half = int(cs[3:-1]), cs[-1]
        return f"EPSG:{(32600 if half == 'N' else 32700) + zone}"
    if cs.startswith("custom"):
        return cs.partition('"')[2].rstrip('"')
    return {_DEGREES: "EPSG:4326", "S-MERC": "EPSG:3857", "IJTSK": "EPSG:5514", "IJTSK03": "EPSG:8353"}.get(cs, cs)
