"""How much room a robot has in each cell of a volume's floors, and on its way to the next one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from minexplore.floors.volume_arrays import WAYS, FacetLabel, FloorSpans, VolumeFacets
from minexplore.physics.robot import CASTOR_M, RobotParams
from minexplore.volume.standing import neighbours
from pipeline.geometry.nearest_edges import nearest_edges
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.volume.world.reach import RobotSize

_NO_ROCK_M = 1e3  # clearance where there is no rock at all
_SIDE = 5  # places along a cell's side that are looked at
_NARROW_M, _WIDE_M = 0.17, 0.6  # from the middle of a cell to rock: other places of the cell are looked at in between
_FLAT = 10.0  # heights are stretched so much before distances are measured, which then are almost level
_LOW, _HIGH = 0.25, 0.75  # of a low roof's height: what stands for the bottom and the top of the chassis under it
_ALIKE = 3  # decimals: of places with as much room the one nearest to the middle is taken
_OFF_M = 0.01  # more than two distances are off by together
_EDGE_M = 0.1  # under a floor: where rock is beside that, the floor ends
_BLOCK = 20_000  # spans at a time


@dataclass(frozen=True)
class FloorRoom:
    """Of each span, as `FloorSpans` has them: `aside_m` (s, 3), `clearance_m` (s,) and `way_m` (s, 4)."""

    aside_m: np.ndarray
    clearance_m: np.ndarray
    way_m: np.ndarray


def room_of(volume: VolumeFacets, bare: FloorSpans, slope: np.ndarray, robot: RobotSize) -> FloorRoom:
    """Return the room in the cells of spans whose floors have slopes (s, 2), rise over run to the east and the north.

    Clearance is the level distance from the bottom and the top of a robot's chassis to rock, which is all that is no
    floor. It is also that to an edge of the floor, where there is rock 10 cm under it, and a castor's radius: a robot's
    wheels and castors touch the floor so far within its disc. Of cells where robots stand it is looked for at 5 x 5
    places: 5 cm apart where cells are 0.25 m wide. In a slab distances are those from the walls in plan.
    """
    count = len(slope)
    aside = np.zeros((count, 3))
    if (volume.label == FacetLabel.FLOOR).all():
        return FloorRoom(aside, np.full(count, _NO_ROCK_M), np.full((count, len(WAYS)), _NO_ROCK_M))
    chassis = _Chassis(volume, bare, slope)
    step = bare.cell_m / _SIDE
    across = (np.arange(_SIDE) - _SIDE // 2) * step
    north, east = np.meshgrid(across, across, indexing="ij")
    offsets = np.column_stack([east.ravel(), north.ravel()])
    nearest = np.argsort(np.hypot(*offsets.T).round(_ALIKE), kind="stable")  # to the middle
    clearance = chassis.middle_m.astype(np.float64)
    reached = np.repeat(clearance.astype(np.float32), _SIDE**2).reshape(count, _SIDE, _SIDE)
    own = np.flatnonzero((bare.storey >= 0) & (clearance > _NARROW_M) & (clearance < _WIDE_M))
    for some in np.split(own, range(_BLOCK, len(own), _BLOCK)):
        room = chassis.clearance_m(some, offsets).reshape(len(some), _SIDE, _SIDE)
        inside = _spread(room, np.full(len(some), nearest[0])) > step  # else rock may lie between
        seen = np.where(inside, room, 0.0).reshape(len(some), _SIDE**2).round(_ALIKE)
        roomiest = nearest[seen[:, nearest].argmax(axis=1)]
        aside[some, :2] = offsets[roomiest]
        clearance[some] = room.reshape(len(some), _SIDE**2)[np.arange(len(some)), roomiest]
        reached[some] = _spread(room, roomiest)
    aside[:, 2] = (aside[:, :2] * slope).sum(axis=1)
    return FloorRoom(aside, clearance, _ways(bare, reached, robot))


class _Chassis:
    """The chassis of a robot on the floors of spans, and the rock beside it, whose heights are stretched."""

    def __init__(self, volume: VolumeFacets, bare: FloorSpans, slope: np.ndarray) -> None:
        middle, self._stretched = volume.vertices.mean(axis=0), np.array([1.0, 1.0, _FLAT])
        vertices = volume.vertices - middle
        self._walls, self._roof_m = walls_of_slab(vertices, volume.faces), vertices[:, 2].max()
        self._ends: tuple[np.ndarray, ...]
        robot, self._slope = RobotParams(), slope
        normal = np.column_stack([-slope, np.ones(len(slope))])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        ends = (robot.ground_clearance_m, _LOW), (robot.ground_clearance_m + robot.height_m, _HIGH)
        heights = [np.minimum(height, share * bare.headroom_m) for height, share in ends]
        bottom, top, self._under = (
            bare.places_m - middle + height[:, None] * normal for height in (*heights, np.full(len(slope), -_EDGE_M))
        )
        if self._walls is None:
            rock = volume.faces[volume.label != FacetLabel.FLOOR]
            self._rock = NearestFacets(vertices * self._stretched, rock, 1)
            self._ends, self._edge_m = (bottom, top), self._beside_m(self._under) + CASTOR_M
        else:  # walls are as far from top and bottom, and from below the floor farther
            self._ends, self._edge_m = (top,), np.full(len(slope), np.inf)
        self.middle_m = np.minimum.reduce([*map(self._beside_m, self._ends), self._edge_m])

    def clearance_m(self, spans: np.ndarray, aside_m: np.ndarray) -> np.ndarray:
        """Return the clearance (k, m) m of places (m, 2) m beside the middles of spans (k,)."""
        aside = np.empty((len(spans), len(aside_m), 3))
        aside[:, :, :2], aside[:, :, 2] = aside_m, self._slope[spans] @ aside_m.T
        found: np.ndarray = np.minimum.reduce([self._beside_m(end[spans, None] + aside) for end in self._ends])
        way = np.sqrt(np.square(aside * self._stretched).sum(axis=2))  # an edge may be nearer by so much
        span, place = np.nonzero(self._edge_m[spans, None] - way < found + _OFF_M)
        edge = self._beside_m(self._under[spans[span]] + aside[span, place]) + CASTOR_M
        found[span, place] = np.minimum(found[span, place], edge)
        return found

    def _beside_m(self, places_m: np.ndarray) -> np.ndarray:
        """Return the level distances (...) m of places (..., 3) m from rock."""
        if self._walls is not None:
            walls = nearest_edges(self._walls, places_m[..., :2].reshape(-1, 2)).distance_m
            return np.minimum(walls.reshape(places_m.shape[:-1]), _FLAT * (self._roof_m - places_m[..., 2]))
        seen = places_m * self._stretched
        return self._rock.rough_distances(seen.reshape(-1, 3)).reshape(seen.shape[:-1])


def walls_of_slab(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """Return the walls (k, 2, 2) m in plan of a mesh with a level floor, a level roof and plumb walls; else None."""
    heights = vertices[:, 2]
    low = heights == heights.min()
    corners = low[faces]
    stands = corners.any(axis=1) & ~corners.all(axis=1)
    a, b, c = np.moveaxis(vertices[faces[stands]], 1, 0)
    if (~low & (heights != heights.max())).any() or np.cross(b - a, c - a)[:, 2].any():
        return None
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)[stands]
    return vertices[edges[low[edges].all(axis=2)], :2]


def _spread(room: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the least clearance (k, n, n) on the widest way within its cell from a place (k,) to each other."""
    reached = np.full_like(room, -1.0)
    at = np.arange(len(room)), start // _SIDE, start % _SIDE
    reached[at] = room[at]
    while len(room):
        wider = np.minimum(maximum_filter(reached, (1, 3, 3), mode="nearest"), room)
        if (wider == reached).all():
            break
        reached = wider
    return reached


def _ways(bare: FloorSpans, reached: np.ndarray, robot: RobotSize) -> np.ndarray:
    """Return the least clearance (s, 4) m on the widest way from each span to its neighbours, 0 without one."""
    found = np.zeros((len(reached), len(WAYS)))
    west, east, south, north = (reached[:, :, 0], reached[:, :, -1], reached[:, 0], reached[:, -1])
    borders = (east, west), (north, south), (north[:, -1:], south[:, :1]), (north[:, :1], south[:, -1:])
    for number, (own, others) in enumerate(borders):
        pairs = neighbours(bare, robot.steepest, robot.step_m, robot.height_m, WAYS[number : number + 1])
        one, two = own[pairs[:, 0]], others[pairs[:, 1]]
        wide = np.minimum(one, two).max(axis=1)
        for a, b in ((one[:, 1:], two[:, :-1]), (one[:, :-1], two[:, 1:])):  # across the border and along it
            wide = np.maximum(wide, np.minimum(a, b).max(axis=1, initial=0.0))
        np.maximum.at(found[:, number], pairs[:, 0], wide)
    return found
