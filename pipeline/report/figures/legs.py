"""Legs of a volume on a map and in a long section, coloured by how their walls, roofs and floors are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from minesurveys.frames import Source
from pipeline.report.chart import Chart, ChartGrid, ChartStation

_WIDE_IN = 9.0
_SECTION_IN = 3.0  # the tallest section whose heights are drawn larger
_TIMES = (10, 5, 2)


def times_as_high(wide_m: float, high_m: float) -> int:
    """Return how many times as large heights are drawn, so that a long mine's section is not a line."""
    return next((k for k in _TIMES if k * high_m / wide_m * _WIDE_IN < _SECTION_IN), 1)


def long_axis(places_m: np.ndarray) -> np.ndarray:
    """Return the direction (2,) along which places (k, 2) spread most, towards the east."""
    _, vectors = np.linalg.eigh(np.cov(places_m.T))
    axis = vectors[:, -1]
    return axis if (axis[0], axis[1]) > (0, 0) else -axis


_SIDES = ("left", "right", "up", "down")


@dataclass(frozen=True)
class DrawnLegs:
    """Legs of a volume in the mine frame.

    Attributes
    ----------
    names : rows of two names
        Of the stations of each leg.
    ends_m : (m, 2, 3) float64, m
    across : (m, 2, 2) float64
        Horizontal unit vector to the left at either end.
    lrud_m : (m, 2, 4) float64, m
    known : (m, 2, 4) uint8
        How these distances are known.
    is_surveyed : bool
        Whether stations were surveyed; else the legs follow floors, and their distances are those of the world.
    unnamed : frozenset of str
        Places between stations, where splays hit a wall: they are on no map.
    """

    names: Sequence[tuple[str, str]]
    ends_m: np.ndarray
    across: np.ndarray
    lrud_m: np.ndarray
    known: np.ndarray
    is_surveyed: bool = True
    unnamed: frozenset[str] = frozenset()

    @property
    def lengths_m(self) -> np.ndarray:
        """Return the lengths (m,) m."""
        return np.linalg.norm(np.diff(self.ends_m, axis=1)[:, 0], axis=1)

    @property
    def middles_m(self) -> np.ndarray:
        """Return the places (m, 3) m half-way."""
        return np.asarray(self.ends_m.mean(axis=1))

    def shares(self) -> dict[str, tuple[float, float, float]]:
        """Return the shares of the length at which walls, roof and floor are measured, interpolated and assumed.

        Each half of a leg counts as the station at its end; walls count by side.
        """
        weight = self.lengths_m[:, None] / 2
        kinds = {"walls": self.known[:, :, :2], "roof": self.known[:, :, 2:3], "floor": self.known[:, :, 3:]}
        found = {}
        for name, known in kinds.items():
            whole = weight.sum() * 2
            sums = [float((weight * (known == how).mean(axis=2)).sum() / whole) for how in reversed(Source)]
            found[name] = (sums[0], sums[1], sums[2])
        return found

    def widths_m(self) -> tuple[np.ndarray, int]:
        """Return the width (k,) m at each station where both walls were measured, and the number of all stations."""
        names = np.array(self.names, dtype=object).reshape(-1)
        width = self.lrud_m[:, :, :2].sum(axis=2).reshape(-1)
        stations = np.array([name not in self.unnamed for name in names.tolist()])
        measured = stations & (self.known[:, :, :2] == Source.MEASURED).all(axis=2).reshape(-1)
        widths = {name: value for name, value in zip(names[measured], width[measured].tolist(), strict=True)}
        return np.array(list(widths.values())), len(set(names[stations].tolist()))

    def stations(self, grid: ChartGrid, datum_m: float) -> dict[str, tuple[np.ndarray, str, int]]:
        """Return the place (3,) m of each station, what is known about it, and the number of its legs."""
        found: dict[str, tuple[np.ndarray, str, int]] = {}
        for pair, ends, sections, known in zip(self.names, self.ends_m, self.lrud_m, self.known, strict=True):
            for name, place, section, how in zip(pair, ends, sections, known, strict=True):
                if name in self.unnamed:
                    continue
                _, text, legs = found.get(name, (place, "", 0))
                if not text:
                    x, y, z = place.tolist()
                    sides = "; " + ", ".join(
                        f"{side} {metres:.2f} m ({Source(int(k)).name.lower()})"
                        for side, metres, k in zip(_SIDES, section.tolist(), how.tolist(), strict=True)
                    )
                    text = f"{grid.text(x, y)}, elevation {z + datum_m:,.1f} m{sides if self.is_surveyed else ''}"
                found[name] = (place, text, legs + 1)
        return found


def quads_from_above(legs: DrawnLegs) -> list[list[float]]:
    """Return four quads for each leg, one a side and end, with how walls, roof and floor are known there."""
    places, middle = legs.ends_m[:, :, :2], legs.ends_m[:, :, :2].mean(axis=1)
    rows = []
    for side, sign in ((0, 1.0), (1, -1.0)):
        walls = places + sign * legs.across * legs.lrud_m[:, :, side, None]
        between = walls.mean(axis=1)
        for end in (0, 1):
            corners = np.stack([places[:, end], walls[:, end], between, middle], axis=1).reshape(-1, 8)
            rows.append(np.column_stack([corners.round(2), legs.known[:, end][:, [side, 2, 3]]]))
    return _rows(np.stack(rows, axis=1).reshape(-1, 11))


def section_chart(legs: DrawnLegs, datum_m: float, grid: ChartGrid) -> tuple[Chart, float]:
    """Return the long section across the direction in which a mine is longest, and the bearing of that, deg.

    Of each half leg the part under the survey line is coloured as its floor is known, the part over it as its roof, if
    the legs are surveyed.
    """
    along = long_axis(legs.ends_m.reshape(-1, 3)[:, :2])
    x, z = legs.ends_m[:, :, :2] @ along, legs.ends_m[:, :, 2] + datum_m
    rows = []
    for column, sign in ((2, 1.0), (3, -1.0)):
        edge = z + sign * legs.lrud_m[:, :, column]
        for end in (0, 1):
            corners = [x[:, end], z[:, end], x[:, end], edge[:, end], x.mean(axis=1), edge.mean(axis=1)]
            quad = np.column_stack([*corners, x.mean(axis=1), z.mean(axis=1)]).round(2)
            rows.append(np.column_stack([quad, *[legs.known[:, end, column]] * 3]))
    roofs, floors = z + legs.lrud_m[:, :, 2], z - legs.lrud_m[:, :, 3]
    bounds = float(x.min()), float(floors.min()), float(x.max()), float(roofs.max())
    wide, high = max(bounds[2] - bounds[0], 1.0), max(bounds[3] - bounds[1], 1.0)
    stations = [
        ChartStation(name, float(place[:2] @ along), float(place[2]) + datum_m, text, count != 2)
        for name, (place, text, count) in legs.stations(grid, datum_m).items()
        if legs.is_surveyed or count != 2
    ]
    lines = _rows(np.stack([x, z], axis=2).reshape(-1, 4).round(2))
    chart = Chart(
        bounds,
        [("floor", "Known") if legs.is_surveyed else ("plain", "Plain")],
        _rows(np.stack(rows, axis=1).reshape(-1, 11)),
        lines,
        stations=stations,
        stretch=times_as_high(wide, high),
    )
    return chart, float(np.degrees(np.arctan2(along[0], along[1])) % 360)


def _rows(values: np.ndarray) -> list[list[float]]:
    """Return rows of numbers as lists, whole ones as such: they are shorter in JSON."""
    return [[int(v) if v == int(v) else round(v, 2) for v in row] for row in values.tolist()]
