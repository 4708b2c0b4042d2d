"""What stands at a station where legs meet: a hub about it, and the sectors on the outside of its bends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
import shapely

from pipeline.survey.passages.bends import LegEnd, outer_sectors
from pipeline.volume.network import SurveyNetwork

LOW, HIGH = 0.6, 0.5  # where the walls end, of the height; how wide the roof is there, of the width
_SIDES = 12
_HUB_M = 1.0  # a wider hub ends where the shortest leg does: beyond are floors of other stations
_LEAST_M = 0.05  # a hub's radius
_BEYOND = 1.05  # of a hub's radius: what reaches no farther is filled by the hub
_STEP_RAD = 0.3  # between corners of a sector: its walls are nearer by 1 % in their middles
_INSIDE = 0.97  # of the legs' walls and roofs, at which those of sectors are: surfaces that coincide leave slivers
_OVERLAP_M = 0.01  # of a sector and the legs beside it: solids that only touch are what booleans are worst at
_WITHIN = 0.5  # of a hub's radius, by which a sector reaches into it

Distance = TypeVar("Distance", float, np.ndarray)
Ends = list[tuple[int, int]]  # legs, by number, and which of their ends is at a station


def joints_at(network: SurveyNetwork, station: int, ends: Ends, feet: list[np.ndarray]) -> Iterator[np.ndarray]:
    """Yield the corners of the convex pieces at a station, level as the sections are that end there.

    Corners (3, k, 3) m are those of the floor, of the walls' upper ends, and of the roof. The first piece is a hub as
    wide as the narrowest leg, and as the plumb legs that stand on it. The others are the sectors on the outside of
    bends, whose walls are as far from the station as they were measured, where that is beyond the hub.

    Parameters
    ----------
    network : SurveyNetwork
    station : int
    ends : list of (int, int)
        The legs that are flat enough to drive on.
    feet : list of (k, 2) float64, m
        The lowest sections of plumb legs, from the station.
    """
    walls = np.array([network.lrud_m[shot, end] for shot, end in ends])
    up, down = walls[:, 2].min(), walls[:, 3].max()
    ways = [network.floors_m[shot, 1 - end, :2] - network.floors_m[shot, end, :2] for shot, end in ends]
    most = max(_HUB_M, min(float(np.hypot(*way)) for way in ways))
    radius = min(max(float(walls[:, :2].min()), _LEAST_M), most)
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    if feet:
        ring = shapely.get_coordinates(shapely.multipoints(np.concatenate([ring, *feet])).convex_hull)[1:]
    place = network.places_m[station]
    yield _prism(place, ring, HIGH * ring, np.full(len(ring), up), down)
    meeting = [_leg_end(network, shot, end, way) for (shot, end), way in zip(ends, ways, strict=True)]
    overlap_rad = _OVERLAP_M / max(float(walls[:, :2].max()), _LEAST_M)
    for sector in outer_sectors(meeting, _STEP_RAD, overlap_rad):
        (near, far), (far_end, near_end) = meeting[sector.one].walls_m, meeting[sector.other].walls_m
        if min(max(near, near_end), most) < _BEYOND * radius:
            continue
        arc = _INSIDE * np.minimum(sector.radii_m(near, near_end), most)[:, None] * sector.directions
        reach = sector.radii_m(min(roof_reach(near, far), most), min(roof_reach(near_end, far_end), most))
        roof = _INSIDE * reach[:, None] * sector.directions
        heights = sector.radii_m(float(walls[sector.one, 2]), float(walls[sector.other, 2]))
        heights -= (1 - _INSIDE) * (heights + down)
        middle = -_WITHIN * radius * sector.directions[len(sector.share) // 2][None]
        yield _prism(
            place,
            np.concatenate([middle, arc]),
            np.concatenate([middle, roof]),
            np.append(heights.min(), heights),
            down,
        )


def roof_reach(near_m: Distance, far_m: Distance) -> Distance:
    """Return how far a flat roof reaches from its station on the side whose wall is `near_m` away, m.

    A roof is over the middle, half as wide as the section, and over its station, where its height was measured.
    """
    found: Distance = np.maximum((near_m - far_m) / 2 + HIGH * (near_m + far_m) / 2, 0.0)
    return found


def _leg_end(network: SurveyNetwork, shot: int, end: int, way: np.ndarray) -> LegEnd:
    """Return a leg as seen from one of its stations."""
    across, (left, right) = network.across[shot, end], network.lrud_m[shot, end, :2].tolist()
    return LegEnd(way, across, (left, right)) if end == 0 else LegEnd(way, -across, (right, left))


def _prism(place: np.ndarray, foot: np.ndarray, roof: np.ndarray, up_m: np.ndarray, down_m: float) -> np.ndarray:
    """Return the corners (3, k, 3) m of a piece, by its floor and roof (k, 2) and the roof's heights (k,) m."""
    low = np.column_stack([foot + place[:2], np.full(len(foot), place[2] - down_m)])
    walls = low + np.column_stack([np.zeros_like(foot), LOW * (up_m + down_m)])
    return np.stack([low, walls, np.column_stack([roof + place[:2], place[2] + up_m])])
