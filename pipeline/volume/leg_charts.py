"""Legs of a volume on a map and in a long section, coloured by how their walls, roofs and floors are known."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from minesurveys.frames import Source
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.report.chart import Chart, ChartGrid, ChartStation
from pipeline.volume.network import SurveyNetwork

ShownStations = dict[str, tuple[np.ndarray, str, int]]  # place (3,) m, what is known about it, number of its legs

_ON = 1e-9  # of a corner's distance from the middle of its leg, over the leg's length
_WIDE_IN = 9.0
_SECTION_IN = 3.0  # the tallest section whose heights are drawn larger
_TIMES = (10, 5, 2)
_SIDES = ("left", "right", "up", "down")


def times_as_high(wide_m: float, high_m: float) -> int:
    """Return how many times as large heights are drawn, so that a long mine's section is not a line."""
    return next((k for k in _TIMES if k * high_m / wide_m * _WIDE_IN < _SECTION_IN), 1)


def long_axis(places_m: np.ndarray) -> np.ndarray:
    """Return the direction (2,) along which places (k, 2) spread most, towards the east."""
    _, vectors = np.linalg.eigh(np.cov(places_m.T))
    axis = vectors[:, -1]
    return axis if (axis[0], axis[1]) > (0, 0) else -axis


def shares_known(network: SurveyNetwork) -> dict[str, tuple[float, float, float]]:
    """Return the shares of the length at which walls, roof and floor are measured, interpolated and assumed.

    Each half of a leg counts as the station at its end; walls count by side.
    """
    weight = network.lengths_m[:, None] / 2
    kinds = {"walls": network.known[:, :, :2], "roof": network.known[:, :, 2:3], "floor": network.known[:, :, 3:]}
    found = {}
    for name, known in kinds.items():
        whole = weight.sum() * 2
        sums = [float((weight * (known == how).mean(axis=2)).sum() / whole) for how in reversed(Source)]
        found[name] = (sums[0], sums[1], sums[2])
    return found


def measured_widths_m(network: SurveyNetwork, unnamed: Collection[str] = ()) -> tuple[np.ndarray, int]:
    """Return the width (k,) m at each station where both walls were measured, and the number of all stations.

    Places that are `unnamed` are no stations: splays hit a wall there.
    """
    names = np.array(network.names, dtype=object)[network.shots].reshape(-1)
    width = network.lrud_m[:, :, :2].sum(axis=2).reshape(-1)
    stations = np.array([name not in unnamed for name in names.tolist()])
    measured = stations & (network.known[:, :, :2] == Source.MEASURED).all(axis=2).reshape(-1)
    widths = {name: value for name, value in zip(names[measured], width[measured].tolist(), strict=True)}
    return np.array(list(widths.values())), len(set(names[stations].tolist()))


def shown_stations(
    network: SurveyNetwork, datum_m: float, grid: ChartGrid, unnamed: Collection[str] = (), is_surveyed: bool = True
) -> ShownStations:
    """Return the stations that are shown by name.

    Places that are `unnamed` are not. Of legs that follow floors, and are not surveyed, ends and junctions alone are.
    """
    found: ShownStations = {}
    for pair, ends, sections, known in zip(network.shots, network.ends_m, network.lrud_m, network.known, strict=True):
        for name, place, section, how in zip([network.names[k] for k in pair], ends, sections, known, strict=True):
            _, text, legs = found.get(name, (place, "", 0))
            if not text:
                x, y, z = place.tolist()
                sides = "; " + ", ".join(
                    f"{side} {metres:.2f} m ({Source(int(k)).name.lower()})"
                    for side, metres, k in zip(_SIDES, section.tolist(), how.tolist(), strict=True)
                )
                text = f"{grid.text(x, y)}, elevation {z + datum_m:,.1f} m{sides if is_surveyed else ''}"
            found[name] = (place, text, legs + 1)
    return {name: one for name, one in found.items() if name not in unnamed and (is_surveyed or one[2] != 2)}


def quads_from_above(network: SurveyNetwork) -> list[list[float]]:
    """Return four quads for each leg, one a side and end, with how walls, roof and floor are known there."""
    places, middle = network.ends_m[:, :, :2], network.ends_m[:, :, :2].mean(axis=1)
    rows = []
    for side, sign in ((0, 1.0), (1, -1.0)):
        walls = places + sign * network.across * network.lrud_m[:, :, side, None]
        between = walls.mean(axis=1)
        for end in (0, 1):
            corners = np.stack([places[:, end], walls[:, end], between, middle], axis=1).reshape(-1, 8)
            rows.append(np.column_stack([corners.round(2), network.known[:, end][:, [side, 2, 3]]]))
    return _rows(np.stack(rows, axis=1).reshape(-1, 11))


def section_chart(
    network: SurveyNetwork, datum_m: float, stations: ShownStations, is_surveyed: bool = True
) -> tuple[Chart, float]:
    """Return the long section across the direction in which a mine is longest, and the bearing of that, deg.

    Of each half leg the part under the survey line is coloured as its floor is known, the part over it as its roof, if
    the legs are surveyed.
    """
    along = long_axis(network.ends_m.reshape(-1, 3)[:, :2])
    x, z = network.ends_m[:, :, :2] @ along, network.ends_m[:, :, 2] + datum_m
    rows = []
    for column, sign in ((2, 1.0), (3, -1.0)):
        edge = z + sign * network.lrud_m[:, :, column]
        for end in (0, 1):
            corners = [x[:, end], z[:, end], x[:, end], edge[:, end], x.mean(axis=1), edge.mean(axis=1)]
            quad = np.column_stack([*corners, x.mean(axis=1), z.mean(axis=1)]).round(2)
            rows.append(np.column_stack([quad, *[network.known[:, end, column]] * 3]))
    roofs, floors = z + network.lrud_m[:, :, 2], z - network.lrud_m[:, :, 3]
    bounds = float(x.min()), float(floors.min()), float(x.max()), float(roofs.max())
    wide, high = max(bounds[2] - bounds[0], 1.0), max(bounds[3] - bounds[1], 1.0)
    lines = _rows(np.stack([x, z], axis=2).reshape(-1, 4).round(2))
    chart = Chart(
        bounds,
        [("floor", "Known") if is_surveyed else ("plain", "Plain")],
        _rows(np.stack(rows, axis=1).reshape(-1, 11)),
        lines,
        stations=[
            ChartStation(name, float(place[:2] @ along), float(place[2]) + datum_m, text, count != 2)
            for name, (place, text, count) in stations.items()
        ],
        stretch=times_as_high(wide, high),
    )
    return chart, float(np.degrees(np.arctan2(along[0], along[1])) % 360)


def facets_by_known(
    corners_m: np.ndarray, label: np.ndarray, leg: np.ndarray, network: SurveyNetwork
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return triangles (k, 3, 3) m cut in the middle of their legs, how each is known (k,), and its facet (k,).

    A facet of a wall is known as the wall on its side of the leg, at the nearer station.

    Parameters
    ----------
    corners_m : (f, 3, 3) float64, m, mine frame
    label, leg : (f,) int
    network : SurveyNetwork
    """
    start, step = network.ends_m[leg, 0], np.diff(network.ends_m, axis=1)[leg, 0]
    size = np.maximum((step**2).sum(axis=1), 1e-12)
    share = ((corners_m - start[:, None]) * step[:, None]).sum(axis=2) / size[:, None] - 0.5
    triangles, of = _cut(corners_m, share)
    middle = triangles.mean(axis=1)
    late = ((middle - start[of]) * step[of]).sum(axis=1) / size[of] > 0.5
    end = late.astype(int)
    aside = ((middle - network.ends_m[leg[of], end])[:, :2] * network.across[leg[of], end]).sum(axis=1)
    column = np.select([label[of] == FacetLabel.FLOOR, label[of] == FacetLabel.ROOF], [3, 2], np.where(aside > 0, 0, 1))
    return triangles, network.known[leg[of], end, column], of


def _cut(corners_m: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return triangles (f, 3, 3) m cut where a value (f, 3), linear over each, is 0, and the facet of each part."""
    low, high = (off < -_ON).any(axis=1), (off > _ON).any(axis=1)
    mixed = np.flatnonzero(low & high)
    whole = np.setdiff1d(np.arange(len(off)), mixed)
    sign = np.sign(np.where(np.abs(off[mixed]) <= _ON, 0.0, off[mixed]))
    alone = np.where(sign.sum(axis=1) > 0, -1.0, 1.0)  # the side with one corner; with a corner on the cut, either
    first = (sign == alone[:, None]).argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    rows = np.arange(len(mixed))[:, None]
    a, b, c = np.moveaxis(corners_m[mixed][rows, order], 1, 0)
    u, v, w = off[mixed][rows, order].T
    ab, ac = (a + (np.clip(u / (u - other), 0, 1))[:, None] * (to - a) for other, to in ((v, b), (w, c)))
    parts = [corners_m[whole], *(np.stack(part, axis=1) for part in ((a, ab, ac), (ab, b, c), (ab, c, ac)))]
    return np.concatenate(parts), np.concatenate([whole, mixed, mixed, mixed])


def _rows(values: np.ndarray) -> list[list[float]]:
    """Return rows of numbers as lists, whole ones as such: they are shorter in JSON."""
    return [[int(v) if v == int(v) else round(v, 2) for v in row] for row in values.tolist()]
