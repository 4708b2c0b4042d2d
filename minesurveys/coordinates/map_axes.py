"""The axes of a coordinate system that a file states: which way each points, and its unit."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from pyproj.database import get_units_map

from minesurveys.errors import InputError
from minesurveys.remarks import warn_user

# PROJ opens the files that such a definition names. Web Mercator is often written with `+nadgrids=@null`, no grid.
_PROJ_FILES = re.compile(r"\binit=|\bpipeline\b|grids=(?!@null\b)|\bfile\b|parameterfile", re.IGNORECASE)
_WAYS = {"east": (1.0, 0.0), "west": (-1.0, 0.0), "north": (0.0, 1.0), "south": (0.0, -1.0)}
_AS_STORED = ((1.0, 0.0), (0.0, 1.0))
_POLAR = ("north", "south")  # both axes of a polar system point away from the pole, or to it
_EQUAL = 1e-9
_EARTH_M = (6_350_000.0, 6_380_000.0)  # semi-axes of the Earth's ellipsoids; the Moon's and Mars's are far smaller
# As programs write units that PROJ's database names otherwise. Its own decimetre is 0.01 m, so it is here:
# findings/pyproj-decimetre-is-a-centimetre.sh.
_SPELLINGS = {
    **dict.fromkeys(("meter", "meters", "metres"), "metre"),
    **dict.fromkeys(("feet", "international foot", "international feet"), "foot"),
    **dict.fromkeys(
        ("us survey feet", "foot_us", "ftus", "us ft", "sft", "survey foot", "ussurveyfoot"), "us survey foot"
    ),
    **dict.fromkeys(("centimeter", "centimeters", "centimetres"), "centimetre"),
    **dict.fromkeys(("millimeter", "millimeters", "millimetres"), "millimetre"),
    **dict.fromkeys(("kilometer", "kilometers", "kilometres"), "kilometre"),
    **dict.fromkeys(("inch", "inches"), "in"),
}
_DECIMETRE = ("dm", "decimeter", "decimetre", "decimeters", "decimetres")


@dataclass(frozen=True)
class MapAxes:
    """How stored coordinates (x, y, z) become east, north and up.

    Attributes
    ----------
    unit : str
        Of the plan, as the system names it.
    metres : float
        Metres a unit of the plan; 1 of degrees.
    ways : ((float, float), (float, float))
        East, and north, of one unit along x and y. Of a system in degrees they are in degrees.
    up_unit : str
        Of heights; empty if the system states none.
    up_metres : float
        Metres upwards a unit of heights, negative if they count downwards; NaN if the system states none.
    vertical : str
        The vertical system's name; empty if there is none.
    """

    unit: str = "metre"
    metres: float = 1.0
    ways: tuple[tuple[float, float], tuple[float, float]] = _AS_STORED
    up_unit: str = ""
    up_metres: float = math.nan
    vertical: str = ""

    @property
    def states_heights(self) -> bool:
        """Return whether the system states a unit of heights."""
        return math.isfinite(self.up_metres)

    @property
    def is_turned(self) -> bool:
        """Return whether x is not east or y not north, whatever their unit."""
        (a, b), (c, d) = self.ways
        return b != 0 or c != 0 or a < 0 or d < 0

    def up_scale(self, unstated: float) -> float:
        """Return metres a unit of heights, `unstated` if the system states none."""
        return self.up_metres if self.states_heights else unstated

    def plan_of(self, points: np.ndarray) -> np.ndarray:
        """Return east and north (n, 2) of stored coordinates (n, 2), in the plan's unit, or degrees."""
        return np.asarray(points @ np.array(self.ways).T)

    def ways_text(self) -> str:
        """Return how east and north are made of x and y, as a text."""
        return ", ".join(
            f"{name} is {'-' if min(row) < 0 else ''}{'x' if row[0] else 'y'}"
            for name, row in zip(("east", "north"), self.ways, strict=True)
        )


def coordinate_system(path: Path, text: str) -> pyproj.CRS:
    """Return the coordinate system that a file names.

    Raises
    ------
    InputError
        If it is unknown, or its definition names files, which PROJ would open.
    """
    if _PROJ_FILES.search(text):
        raise InputError(f"{path}: its coordinate system {text[:80]!r} names files; they are not read")
    try:
        return pyproj.CRS.from_user_input(text)
    except (pyproj.exceptions.CRSError, UnicodeEncodeError) as error:
        raise InputError(f"{path}: its coordinate system {text[:80]!r} is unknown") from error


def horizontal(system: pyproj.CRS) -> pyproj.CRS:
    """Return the part of a system that the plan is in, without its vertical system and its tie to another datum."""
    return _parts(system)[0]


def other_units(system: pyproj.CRS) -> str:
    """Return the units of a plan's axes that are not metres, such as "degree"; empty if all are."""
    axes = horizontal(system).axis_info[:2]
    return ", ".join(sorted({str(axis.unit_name) for axis in axes if abs(axis.unit_conversion_factor - 1) > _EQUAL}))


def axes_of(system: pyproj.CRS) -> MapAxes:
    """Return the axes of coordinates in a system, as geographic information systems store them.

    These store easting or longitude first where the system defines northing or latitude first. In all other systems,
    such as those whose axes point south and west, they keep the system's own order:
    findings/pyproj-krovak-south-first.sh.

    References
    ----------
    OGC 12-128r18 (GeoPackage), 1.1.3.1.3; GDAL, OSR API tutorial, "CRS and axis order".
    """
    plan, height = _parts(system)
    axes = plan.axis_info
    if len(axes) < 2:
        return MapAxes()
    x, y = (axes[1], axes[0]) if _is_swapped(axes) else (axes[0], axes[1])
    ways = np.array([_WAYS.get(axis.direction, (0.0, 0.0)) for axis in (x, y)]).T
    if abs(np.linalg.det(ways)) != 1:  # as of polar systems: both axes point to the pole
        ways = np.eye(2)
    factor = float(x.unit_conversion_factor) or 1.0
    if plan.is_geographic:
        ways, factor = ways * round(math.degrees(factor), 9), 1.0  # WKT states 15 digits of it
    (a, b), (c, d) = ways.tolist()
    found = MapAxes(str(x.unit_name), factor, ((a, b), (c, d)))
    if height is None:
        return found
    name, axis = height
    up = float(axis.unit_conversion_factor) * (-1.0 if axis.direction == "down" else 1.0)
    return replace(found, up_unit=str(axis.unit_name), up_metres=up, vertical=name)


def _is_swapped(axes: Sequence[Any]) -> bool:
    """Return whether stored coordinates have a system's second axis first: its first is latitude or northing."""
    one, two = axes[0], axes[1]
    if one.direction == "north" and two.direction == "east":
        return True
    is_polar = one.direction == two.direction and one.direction in _POLAR
    return bool(is_polar and one.name.lower().startswith("north") and two.name.lower().startswith("east"))


def _parts(system: pyproj.CRS) -> tuple[pyproj.CRS, tuple[str, Any] | None]:
    """Return the horizontal part of a system, and the name and axis of its heights if it has any."""
    while system.is_bound and system.source_crs is not None:
        system = system.source_crs
    if system.is_compound:
        plan, height = horizontal(system.sub_crs_list[0]), system.sub_crs_list[-1]
        while height.is_bound and height.source_crs is not None:
            height = height.source_crs
        return plan, (str(height.name), height.axis_info[0])
    if len(system.axis_info) == 3 and not system.is_geocentric:
        return system.to_2d(), ("ellipsoidal height", system.axis_info[2])
    return system, None


def warn_of_turn(path: Path, axes: MapAxes) -> None:
    """List axes of a system that do not point east and north."""
    if axes.is_turned:
        warn_user(
            f"the axes of its coordinate system do not point east and north: {axes.ways_text()}; "
            "survey.origin is (east, north); without a coordinate system x is read as east and y as north",
            of=path.name,
            option="survey.origin",
        )


def warn_of_heights(path: Path, axes: MapAxes, plan_metres: float) -> None:
    """List what a system states of heights, or that it states nothing where the plan is not in metres."""
    if axes.states_heights:
        way = ", which count downwards" if axes.up_metres < 0 else ""
        warn_user(f"its coordinate system states {axes.vertical} in {axes.up_unit}{way}", of=path.name)
    elif abs(plan_metres - 1.0) > _EQUAL:
        warn_user(
            f"its coordinate system states no unit of heights; they are read in that of its plan ({axes.unit}); "
            "a compound system, such as EPSG:2230+5703, states one",
            of=path.name,
        )


def require_plane(path: Path, system: pyproj.CRS, place: np.ndarray) -> None:
    """Refuse a system whose axes start at the Earth's centre: no two of them are a plan.

    Parameters
    ----------
    path : Path
    system : pyproj.CRS
    place : (3,) float64
        A place in the file, which the advice is for.
    """
    if not system.is_geocentric:
        return
    raise InputError(
        f"{path}: its coordinates are x, y and z from the Earth's centre ({system.name}), no plan; transform it to "
        f"{utm_zone(system, place)} in the program that made it"
    )


def utm_zone(system: pyproj.CRS, place: np.ndarray) -> str:
    """Return the UTM zone of a place (2 or 3,) in a system, as "EPSG:32633 (UTM zone 33N)"; else "a UTM zone"."""
    if not is_earth(system):
        return "a system in metres"
    try:
        to_degrees = pyproj.Transformer.from_crs(system, "EPSG:4979", always_xy=True)
        x, y, z = (*np.nan_to_num(place).tolist(), 0.0)[:3]
        lon, lat, _ = to_degrees.transform(x, y, z, errcheck=True)
    except pyproj.exceptions.ProjError:
        return "its UTM zone"
    zone, is_north = min(int((lon + 180) // 6) + 1, 60), lat >= 0
    return f"EPSG:{(32600 if is_north else 32700) + zone} (UTM zone {zone}{'N' if is_north else 'S'})"


def is_earth(system: pyproj.CRS) -> bool:
    """Return whether a system is of the Earth, or of no body at all."""
    body = system.ellipsoid
    return body is None or _EARTH_M[0] <= body.semi_minor_metre <= body.semi_major_metre <= _EARTH_M[1]


def metres_of_unit(text: str) -> float | None:
    """Return how many metres a unit of length has that a file names; None if it is no unit of length."""
    name = " ".join(text.strip().lower().split())
    if name in _DECIMETRE:
        return 0.1
    units = get_units_map(category="linear")
    by_name = {unit.name.lower(): unit.conv_factor for unit in units.values()}
    by_name |= {unit.proj_short_name: unit.conv_factor for unit in units.values() if unit.proj_short_name}
    found = by_name.get(_SPELLINGS.get(name, name))
    return None if found is None else float(found)
