"""The same rays at what a bundle has, and at the triangles of a file that was read back by Open3D."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.floors.volume_arrays import FloorSpans
from pipeline.errors import GeometryError
from pipeline.export.frames import apply
from pipeline.geometry.raycast import RayCaster
from pipeline.types import Points3

RAYS = 10_000
AGREE_M = 0.001
_CLEAR_M = 0.5  # of starts from walls, in plan
_HEIGHTS_M = (0.3, 1.5)  # of starts above the floor
_EDGE_M = 2e-4  # a ray that meets something else so far beside itself passes an edge; places are rounded to 1e-5 m
_RANGE_M = 200.0  # beyond it nothing is compared: the longest drift of a view
_ROUNDS = 5  # of new rays for those at edges
_LOW_SHARE = 0.5  # of the free height over a floor, where that is lower

Draw = Callable[[int, np.random.Generator], Points3]  # starts (count, 3) m, mine frame
Cast = Callable[[Points3, Points3], np.ndarray]  # starts, unit directions -> ranges (n,) m


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

    def __init__(self, draw: Draw, exact: Cast) -> None:
        """Take what draws starts, and what casts rays at the bundle."""
        self._draw, self._exact = draw, exact

    def compare(self, triangles: np.ndarray, seed: int) -> RayMatch:
        """Cast rays at the bundle, and at triangles (n, 3, 3) m of the mine frame.

        A ray that passes an edge of the bundle within 0.2 mm is replaced by a new one: the rounding of places decides
        what it hits. The bundle alone decides which rays these are.

        Raises
        ------
        GeometryError
            If there are no triangles, or no place where a robot can stand.
        """
        found_by, rng = cast_at(triangles), np.random.default_rng(seed)
        differences, at_edges, wanted = [np.zeros(0)], 0, RAYS
        for _ in range(_ROUNDS):
            starts, ahead = self._draw(wanted, rng), rng.normal(size=(wanted, 3))
            ahead /= np.linalg.norm(ahead, axis=1)[:, None]
            exact = self._exact(starts, ahead)
            off = np.abs(exact - found_by(starts, ahead))
            differ = np.flatnonzero(off > AGREE_M)
            edges = differ[self._is_at_edge(starts[differ], ahead[differ], exact[differ])]
            differences.append(np.delete(off, edges))
            at_edges, wanted = at_edges + len(edges), len(edges)
            if not wanted:
                break
        every = np.concatenate(differences)
        return RayMatch(len(every), int((every <= AGREE_M).sum()), round(float(every.max()), 6), AGREE_M, at_edges)

    def _is_at_edge(self, starts: np.ndarray, ahead: np.ndarray, exact: np.ndarray) -> np.ndarray:
        """Return which rays (n,) at the bundle meet something else `_EDGE_M` beside themselves."""
        if not len(starts):
            return np.zeros(0, bool)
        across = np.cross(ahead, np.eye(3)[np.abs(ahead).argmin(axis=1)])
        across /= np.linalg.norm(across, axis=1)[:, None]
        upright = np.cross(ahead, across)
        beside = [sign * _EDGE_M * side for side in (across, upright) for sign in (-1, 1)]
        ranges = [self._exact(starts + shift, ahead) for shift in beside]
        return np.abs(np.array(ranges) - exact).max(axis=0) > AGREE_M


def starts_in_plan(free: BaseGeometry) -> Draw:
    """Return what draws starts over the floor of a mine that has a plan.

    Raises
    ------
    GeometryError
        When it draws, if no place is far enough from the walls.
    """

    def draw(count: int, rng: np.random.Generator) -> Points3:
        standing = free.buffer(-_CLEAR_M)
        if standing.is_empty:
            raise GeometryError(f"rays: no place of the workings is {_CLEAR_M} m from all walls")
        pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(standing))
        corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
        chosen = rng.choice(len(pieces), count, p=shapely.area(pieces) / shapely.area(pieces).sum())
        weights = rng.dirichlet(np.ones(3), count)
        places = (weights[:, :, None] * corners[chosen]).sum(axis=1)
        return np.column_stack([places, rng.uniform(*_HEIGHTS_M, count)])

    return draw


def starts_on_spans(spans: FloorSpans) -> Draw:
    """Return what draws starts over the floors of a volume where a robot can stand; errors as of `starts_in_plan`."""

    def draw(count: int, rng: np.random.Generator) -> Points3:
        standing = np.flatnonzero((spans.storey >= 0) & (spans.clearance_m > _CLEAR_M))
        if not len(standing):
            raise GeometryError(f"rays: no place of the floors is {_CLEAR_M} m from all walls")
        chosen = rng.choice(standing, count)
        above = np.minimum(rng.uniform(*_HEIGHTS_M, count), _LOW_SHARE * spans.headroom_m[chosen])
        return np.asarray(spans.roomiest_m[chosen] + np.outer(above, [0.0, 0.0, 1.0]))

    return draw


def cast_at(triangles: np.ndarray) -> Cast:
    """Return what casts rays at triangles (n, 3, 3) m; `GeometryError` if there are none."""
    caster = RayCaster(triangles)
    return lambda starts, ahead: np.minimum(caster.cast(starts, ahead), _RANGE_M)


def cast_at_model(model: mujoco.MjModel, T_world_mine: np.ndarray, groups: tuple[int, ...]) -> Cast:
    """Return what casts rays at the geoms of some groups of a model."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    flags, hit = np.zeros(mujoco.mjNGROUP, np.uint8), np.zeros(1, np.int32)
    flags[list(groups)] = 1

    def cast(starts: Points3, ahead: Points3) -> np.ndarray:
        places, along = apply(T_world_mine, starts), ahead @ T_world_mine[:3, :3].T
        ranges = np.array(
            [
                mujoco.mj_ray(model, data, place, way, flags, 1, -1, hit, None)
                for place, way in zip(places, along, strict=True)
            ]
        )
        return np.where((ranges < 0) | (ranges > _RANGE_M), _RANGE_M, ranges)

    return cast
