"""The same rays at a bundle's geoms by MuJoCo, and at the triangles of a file that was read back by Open3D."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor
from pipeline.errors import GeometryError
from pipeline.export.frames import apply
from pipeline.geometry.raycast import RayCaster

RAYS = 10_000
AGREE_M = 0.001
_CLEAR_M = 0.5  # of starts from walls, in plan
_HEIGHTS_M = (0.3, 1.5)  # of starts above the floor
_EDGE_M = 2e-4  # a ray that meets something else so far beside itself passes an edge; places are rounded to 1e-5 m
_RANGE_M = 200.0  # beyond it nothing is compared: the longest drift of a view
_ROUNDS = 5  # of new rays for those at edges


@dataclass(frozen=True)
class RayMatch:
    """Rays that were cast, those within the limit, the largest difference, and how many at edges were replaced."""

    cast: int
    agree: int
    worst_m: float
    limit_m: float
    at_edges: int

    @property
    def holds(self) -> bool:
        """Return whether all rays agree."""
        return self.cast == self.agree == RAYS


class RayTest:
    """Random rays in a mine's workings, from places where a robot can stand, into all directions."""

    def __init__(self, model: mujoco.MjModel, T_world_mine: np.ndarray, free: BaseGeometry, floor: Floor) -> None:
        self._model, self._T, self._free, self._floor = model, T_world_mine, free, floor
        self._data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)

    def compare(self, triangles: np.ndarray, groups: tuple[int, ...], seed: int) -> RayMatch:
        """Cast rays at the model's geoms of some groups, and at triangles (n, 3, 3) m of the mine frame.

        A ray that passes an edge of the model within 0.2 mm is replaced by a new one: the rounding of places decides
        what it hits. The model alone decides which rays these are.

        Raises
        ------
        GeometryError
            If there are no triangles, or no place where a robot can stand.
        """
        caster, rng = RayCaster(triangles), np.random.default_rng(seed)
        differences, at_edges, wanted = [np.zeros(0)], 0, RAYS
        for _ in range(_ROUNDS):
            starts, ahead = self._draw(wanted, rng)
            exact = self._by_model(starts, ahead, groups)
            found = np.minimum(caster.cast(starts, ahead), _RANGE_M)
            off = np.abs(exact - found)
            differ = np.flatnonzero(off > AGREE_M)
            edges = differ[self._is_at_edge(starts[differ], ahead[differ], exact[differ], groups)]
            differences.append(np.delete(off, edges))
            at_edges, wanted = at_edges + len(edges), len(edges)
            if not wanted:
                break
        every = np.concatenate(differences)
        return RayMatch(len(every), int((every <= AGREE_M).sum()), round(float(every.max()), 6), AGREE_M, at_edges)

    def _draw(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return starts and unit directions (count, 3) m, mine frame."""
        standing = self._free.buffer(-_CLEAR_M)
        if standing.is_empty:
            raise GeometryError(f"rays: no place of the workings is {_CLEAR_M} m from all walls")
        pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(standing))
        corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
        chosen = rng.choice(len(pieces), count, p=shapely.area(pieces) / shapely.area(pieces).sum())
        weights = rng.dirichlet(np.ones(3), count)
        places = (weights[:, :, None] * corners[chosen]).sum(axis=1)
        starts = np.column_stack([places, rng.uniform(*_HEIGHTS_M, count)])
        ahead = rng.normal(size=(count, 3))
        return self._floor.fold(starts), ahead / np.linalg.norm(ahead, axis=1)[:, None]

    def _by_model(self, starts: np.ndarray, ahead: np.ndarray, groups: tuple[int, ...]) -> np.ndarray:
        flags, hit = np.zeros(mujoco.mjNGROUP, np.uint8), np.zeros(1, np.int32)
        flags[list(groups)] = 1
        places, along = apply(self._T, starts), ahead @ self._T[:3, :3].T
        ranges = np.array(
            [
                mujoco.mj_ray(self._model, self._data, place, way, flags, 1, -1, hit, None)
                for place, way in zip(places, along, strict=True)
            ]
        )
        return np.where((ranges < 0) | (ranges > _RANGE_M), _RANGE_M, ranges)

    def _is_at_edge(
        self, starts: np.ndarray, ahead: np.ndarray, exact: np.ndarray, groups: tuple[int, ...]
    ) -> np.ndarray:
        """Return which rays (n,) of the model meet something else `_EDGE_M` beside themselves."""
        if not len(starts):
            return np.zeros(0, bool)
        across = np.cross(ahead, np.eye(3)[np.abs(ahead).argmin(axis=1)])
        across /= np.linalg.norm(across, axis=1)[:, None]
        upright = np.cross(ahead, across)
        beside = [sign * _EDGE_M * side for side in (across, upright) for sign in (-1, 1)]
        ranges = [self._by_model(starts + shift, ahead, groups) for shift in beside]
        return np.abs(np.array(ranges) - exact).max(axis=0) > AGREE_M
