"""How much room a robot has in each cell of a volume's floors, and on its way to the next one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from minexplore.floors.volume_arrays import WAYS, FacetLabel, FloorSpans, VolumeFacets
from minexplore.physics.robot import RobotParams
from minexplore.volume.standing import neighbours
from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.world.reach import RobotSize

_NO_ROCK_M = 1e3  # clearance where there is no rock at all
_SIDE = 5  # places along a cell's side that are looked at
_WIDE_M = 0.75  # from the middle of a cell to rock: there other places of the cell are not looked at
_FLAT = 10.0  # heights are stretched so much before distances are measured, which then are almost level
_LOW, _HIGH = 0.25, 0.75  # of a low roof's height: what stands for the bottom and the top of the chassis under it
_ALIKE = 3  # decimals: of places with as much room the one nearest to the middle is taken
_BLOCK = 20_000  # spans at a time


@dataclass(frozen=True)
class Room:
    """Of each span, as `FloorSpans` has them: `aside_m` (s, 3), `clearance_m` (s,) and `way_m` (s, 4)."""

    aside_m: np.ndarray
    clearance_m: np.ndarray
    way_m: np.ndarray


def room_of(volume: VolumeFacets, bare: FloorSpans, slope: np.ndarray, robot: RobotSize) -> Room:
    """Return the room in the cells of spans whose floors have slopes (s, 2), rise over run to the east and the north.

    Clearance is the level distance from the bottom and the top of a robot's chassis to rock, which is all that is no
    floor. It is looked for at 5 x 5 places of each cell: 5 cm apart where cells are 0.25 m wide.
    """
    if (volume.label == FacetLabel.FLOOR).all():
        count = len(bare.column)
        return Room(np.zeros((count, 3)), np.full(count, _NO_ROCK_M), np.full((count, len(WAYS)), _NO_ROCK_M))
    scene = _RockBeside(volume)
    step = bare.cell_m / _SIDE
    across = (np.arange(_SIDE) - _SIDE // 2) * step
    north, east = np.meshgrid(across, across, indexing="ij")
    offsets = np.column_stack([east.ravel(), north.ravel()])
    nearest = np.argsort(np.hypot(*offsets.T).round(_ALIKE), kind="stable")  # to the middle
    aside, clearance = np.zeros((len(slope), 3)), np.zeros(len(slope))
    reached = np.zeros((len(slope), _SIDE, _SIDE), np.float32)
    for first in range(0, len(slope), _BLOCK):
        own = slice(first, first + _BLOCK)
        room = _rooms(scene, bare, slope, np.arange(len(slope))[own], offsets)
        inside = _spread(room, np.full(len(room), len(offsets) // 2)) > step  # else rock may lie between
        inside.reshape(len(room), -1)[:, len(offsets) // 2] = True
        seen = np.where(inside, room, -1.0).reshape(len(room), -1).round(_ALIKE)
        roomiest = nearest[seen[:, nearest].argmax(axis=1)]
        aside[own, :2] = offsets[roomiest]
        clearance[own] = room.reshape(len(room), -1)[np.arange(len(room)), roomiest]
        reached[own] = _spread(room, roomiest)
    aside[:, 2] = (aside[:, :2] * slope).sum(axis=1)
    return Room(aside, clearance, _ways(bare, reached, robot))


class _RockBeside:
    """What is rock of a volume, stretched in height."""

    def __init__(self, volume: VolumeFacets) -> None:
        self._middle, self._stretched = volume.vertices.mean(axis=0), np.array([1.0, 1.0, _FLAT])
        vertices = (volume.vertices - self._middle) * self._stretched  # distances are measured in 32 bits
        self._scene = ray_scene(vertices, volume.faces[volume.label != FacetLabel.FLOOR], 1)

    def distance_m(self, places_m: np.ndarray) -> np.ndarray:
        """Return the level distances (n,) m of places (n, 3) m from rock."""
        seen = ((places_m - self._middle) * self._stretched).astype(np.float32)
        found: np.ndarray = self._scene.compute_distance(seen, nthreads=1).numpy()
        return found


def _rooms(scene: _RockBeside, bare: FloorSpans, slope: np.ndarray, own: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the clearance (k, n, n) m at the places of cells; that at the middle for all where it is wide."""
    chassis = RobotParams()
    normal = np.column_stack([-slope[own], np.ones(len(own))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    bottom_m, top_m = chassis.ground_clearance_m, chassis.ground_clearance_m + chassis.height_m
    heights = [np.minimum(height, share * bare.headroom_m[own]) for height, share in ((bottom_m, _LOW), (top_m, _HIGH))]

    def clearance(some: np.ndarray, aside: np.ndarray) -> np.ndarray:
        """Return the clearance (k, m) m of places (m, 2) m beside the middles of some spans."""
        rise = slope[own[some]] @ aside.T
        count = len(some), len(aside)
        beside = np.concatenate([np.broadcast_to(aside, (*count, 2)), rise[..., None]], axis=2)
        places = bare.places_m[own[some], None] + beside
        found = [scene.distance_m((places + (h[some, None] * normal[some])[:, None]).reshape(-1, 3)) for h in heights]
        least: np.ndarray = np.minimum(*found).reshape(count)
        return least

    everywhere = np.arange(len(own))
    room = np.repeat(clearance(everywhere, np.zeros((1, 2))), len(offsets), axis=1)
    narrow = np.flatnonzero(room[:, 0] < _WIDE_M)
    room[narrow] = clearance(narrow, offsets)
    return room.reshape(len(own), _SIDE, _SIDE)


def _spread(room: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the least clearance (k, n, n) on the widest way within its cell from a place (k,) to each other."""
    reached = np.full_like(room, -1.0)
    at = np.arange(len(room)), start // _SIDE, start % _SIDE
    reached[at] = room[at]
    while True:
        wider = np.minimum(maximum_filter(reached, (1, 3, 3), mode="nearest"), room)
        if (wider == reached).all():
            return reached
        reached = wider


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
