"""A mine with heights on paper: the plan of each level, a long section, and the grade of each leg."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor
from pipeline.report.figures.mine import outline_path
from pipeline.report.figures.style import GREY, ROCK, STEEL, new_figure
from pipeline.types import DriftNetwork

_MOST_LEVELS = 12  # sheets that have a plan of their own
_WIDE_IN = 9.0
_SECTION_IN = 3.0  # the tallest section whose heights are drawn larger
_TIMES = (10, 5, 2)


@dataclass(frozen=True)
class LegGrade:
    """The elevations of a leg's ends, m, its mean grade, and that of its steepest part; rise over run."""

    name: str
    from_m: float
    to_m: float
    mean: float
    steepest: float


def leg_grades(network: DriftNetwork, floor: Floor, datum_m: float) -> list[LegGrade]:
    """Return the grade of each leg, from the floor under its stations.

    Parameters
    ----------
    network : DriftNetwork
        In the plan, where sheets lie side by side.
    floor : Floor
        With heights.
    datum_m : float
        Elevation of the floor's zero.
    """
    rows = []
    for leg in network.legs:
        height = floor.heights_at(np.array(leg.stations_m)) + datum_m
        run, rise = np.diff(leg.chainage_m), np.diff(height)
        parts = np.abs(rise[run > 0] / run[run > 0])
        total = float(leg.chainage_m[-1] - leg.chainage_m[0])
        mean = float(height[-1] - height[0]) / total if total else 0.0
        rows.append(LegGrade(leg.name, float(height[0]), float(height[-1]), mean, float(parts.max(initial=0.0))))
    return rows


def draw_levels(outline: BaseGeometry, network: DriftNetwork, floor: Floor, datum_m: float) -> Figure:
    """Draw each sheet in its true place over the outline of all, from the highest to the lowest.

    Parameters
    ----------
    outline : shapely.Polygon or shapely.MultiPolygon, m
        The workings in the plan, where sheets lie side by side.
    network : DriftNetwork
    floor : Floor
        With heights. Beyond twelve sheets, neighbours in height share a drawing.
    datum_m : float
    """
    sheets = _sheets_in_place(outline, floor)
    legs = _legs_in_place(network, floor)
    order = sorted(sheets, key=lambda k: -float(floor.spans_m[k].mean()))
    groups = [group.tolist() for group in np.array_split(order, min(len(order), _MOST_LEVELS))]
    west, south, east, north = shapely.union_all(list(sheets.values())).bounds
    columns = 1 if len(groups) == 1 or east - west > 2.5 * (north - south) else 2
    rows = -(-len(groups) // columns)
    high = np.clip(_WIDE_IN / columns * (north - south) / (east - west) + 0.6, 1.6, 6.0)
    figure = new_figure(_WIDE_IN, float(rows * high))
    for number, group in enumerate(groups):
        axis = figure.add_subplot(rows, columns, number + 1)
        for sheet in sheets.values():
            axis.add_patch(PathPatch(outline_path(sheet), facecolor="none", edgecolor=GREY, lw=0.3))
        for k in group:
            axis.add_patch(PathPatch(outline_path(sheets[k]), facecolor="#d9cbbf", edgecolor=ROCK, lw=0.6))
            for places, sheet_of_leg in legs:
                if sheet_of_leg == k:
                    axis.plot(*places[:, :2].T, color=STEEL, lw=0.6)
        low, top = floor.spans_m[group].min() + datum_m, floor.spans_m[group].max() + datum_m
        axis.set_title(f"floor from {low:.1f} to {top:.1f} m", fontsize=8)
        axis.set(xlim=(west - 2, east + 2), ylim=(south - 2, north + 2), aspect="equal")
        axis.tick_params(labelsize=6)
    return figure


def draw_long_section(floor: Floor, height_m: float, datum_m: float) -> Figure:
    """Draw the walls of all drifts, projected on the vertical plane along which the mine is longest.

    Parameters
    ----------
    floor : Floor
        With heights.
    height_m : float
        Of the roof over the floor, where the survey knows none.
    datum_m : float
    """
    feet, heads = (
        np.array([at.vertices[list(edge)] - [*at.offset_m[at.sheet[face]], 0.0] for face, edge in at.wall_edges()])
        for at in (floor, floor.raised(height_m))
    )
    along = long_axis(feet.reshape(-1, 3)[:, :2])
    x, z, top = feet[:, :, :2] @ along, feet[:, :, 2] + datum_m, heads[:, :, 2] + datum_m
    walls = np.stack([np.column_stack([x, x[:, ::-1]]), np.column_stack([z, top[:, ::-1]])], axis=2)
    wide, high = max(float(np.ptp(x)), 1.0), float(top.max() - z.min())
    times = times_as_high(wide, high)
    figure = new_figure(_WIDE_IN, float(np.clip(_WIDE_IN * times * high / wide + 0.9, 2.0, 10.0)))
    axis = figure.add_subplot()
    axis.add_collection(PolyCollection(list(walls), facecolor="#d9cbbf", edgecolor="none", alpha=0.5))
    axis.add_collection(LineCollection(list(np.stack([x, top], axis=2)), colors=GREY, linewidths=0.4))
    axis.add_collection(LineCollection(list(np.stack([x, z], axis=2)), colors=ROCK, linewidths=0.8))
    bearing = np.degrees(np.arctan2(along[0], along[1])) % 360
    axis.set(xlabel=f"distance along bearing {bearing:.0f}°, m", ylabel="elevation, m", aspect=times)
    axis.set(xlim=(x.min() - 2, x.max() + 2), ylim=(z.min() - 1, top.max() + 1))
    axis.set_title("floor brown, roof grey" + (f"; heights {times} times as large" if times > 1 else ""), fontsize=8)
    return figure


def _sheets_in_place(outline: BaseGeometry, floor: Floor) -> dict[int, BaseGeometry]:
    """Return the outline of each sheet, moved back to where it is in the mine."""
    found: dict[int, list[BaseGeometry]] = {}
    for part in shapely.get_parts(outline):
        inside = part.representative_point()
        sheet = int(floor.sheets_at(np.array([[inside.x, inside.y]]))[0])
        found.setdefault(sheet, []).append(shapely.transform(part, lambda xy, k=sheet: xy - floor.offset_m[k]))
    return {sheet: shapely.union_all(parts) for sheet, parts in found.items()}


def _legs_in_place(network: DriftNetwork, floor: Floor) -> list[tuple[np.ndarray, int]]:
    """Return the stations (k, 3) m of each leg on the floor, in the mine frame, and the leg's sheet."""
    rows = []
    for leg in network.legs:
        plan = np.array(leg.stations_m)
        sheet = int(floor.sheets_at(plan[len(plan) // 2][None])[0])
        rows.append((np.column_stack([plan - floor.offset_m[sheet], floor.heights_at(plan)]), sheet))
    return rows


def times_as_high(wide_m: float, high_m: float) -> int:
    """Return how many times as large heights are drawn, so that a long mine's section is not a line."""
    return next((k for k in _TIMES if k * high_m / wide_m * _WIDE_IN < _SECTION_IN), 1)


def long_axis(places_m: np.ndarray) -> np.ndarray:
    """Return the direction (2,) along which places (k, 2) spread most, towards the east."""
    _, vectors = np.linalg.eigh(np.cov(places_m.T))
    axis = vectors[:, -1]
    return axis if (axis[0], axis[1]) > (0, 0) else -axis
