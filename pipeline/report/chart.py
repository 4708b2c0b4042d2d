"""Maps and long sections of the report's page, as the data that `figures/chart.js` draws, moves and enlarges."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from minesurveys.frames import Georeference

_DIGITS = 2  # of a metre
ELEVATION = ("elevation", "Elevation")
KNOWN_MODES = (("walls", "Walls"), ("roof", "Roof"), ("floor", "Floor"))


@dataclass(frozen=True)
class ChartStation:
    """A station by name, its place m, what is known about it, and its rank: names of a higher one get room first."""

    name: str
    x: float
    y: float
    about: str
    rank: int = 0


@dataclass(frozen=True)
class ChartPlace:
    """A place with a number on the chart, m, and what is there."""

    number: int
    x: float
    y: float
    text: str


@dataclass(frozen=True)
class ChartGrid:
    """Numbers of a chart's grid: `at` is that of x = y = 0, and there are `per_m` units to a metre."""

    at: tuple[float, float] = (0.0, 0.0)
    per_m: float = 1.0

    @classmethod
    def of(cls, place: Georeference) -> ChartGrid:
        """Return the grid of the survey's own coordinates."""
        return cls((place.origin[0], place.origin[1]), 1 / place.metres_per_unit)

    def text(self, x: float, y: float) -> str:
        """Return a place of the mine frame, m, in the survey's own coordinates."""
        east, north = (self.at[k] + self.per_m * value for k, value in enumerate((x, y)))
        return f"E {east:,.1f}, N {north:,.1f}"


@dataclass(frozen=True)
class Chart:
    """What a chart shows, in m.

    Attributes
    ----------
    bounds : (west, south, east, north)
    modes : rows of a key and a title
        What quads can be coloured by: `walls`, `roof`, `floor` by how they are known; others leave them plain.
    quads : rows of eight coordinates and how walls, roof and floor there are known
    lines : rows of coordinates
    paths : SVG paths with their attributes
    picture : its data URL, west, north, wide and high, or None
    stretch : how many times heights are enlarged
    """

    bounds: tuple[float, float, float, float]
    modes: Sequence[tuple[str, str]] = (("plan", "Plan"),)
    quads: list[list[float]] = field(default_factory=list)
    lines: list[list[float]] = field(default_factory=list)
    paths: list[dict[str, str]] = field(default_factory=list)
    stations: list[ChartStation] = field(default_factory=list)
    places: list[ChartPlace] = field(default_factory=list)
    grid: ChartGrid = ChartGrid()
    start: tuple[float, float] | None = None
    picture: dict[str, Any] | None = None
    stretch: float = 1.0

    @property
    def prefix(self) -> str:
        """Return what all names of stations begin with, up to a point: labels leave it out."""
        names = [station.name for station in self.stations]
        first, last = min(names, default=""), max(names, default="")
        same = next((k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), 0)
        return first[: first.rfind(".", 0, same) + 1]

    @property
    def aspect(self) -> float:
        """Return its width over its height on the page, with room for the grid's numbers."""
        west, south, east, north = self.bounds
        wide, high = max(east - west, 1.0), max((north - south) * self.stretch, 1.0)
        return round(min(max(wide / (1.25 * high), 1.2), 4.0), 2)

    @property
    def json(self) -> str:
        """Return the chart as JSON that a page can hold in a script."""
        values: dict[str, Any] = asdict(self) | {"prefix": self.prefix}
        values["stations"] = [[s.name, *_rounded(s.x, s.y), s.about, s.rank] for s in self.stations]
        values["places"] = [[p.number, *_rounded(p.x, p.y), p.text] for p in self.places]
        return json.dumps(values, separators=(",", ":")).replace("<", "\\u003c")


def _rounded(*values: float) -> list[float]:
    return [round(value, _DIGITS) for value in values]
