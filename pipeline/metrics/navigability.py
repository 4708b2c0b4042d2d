"""Whether every column of the plan's free space is open in the world: one vertical ray per pixel."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import mujoco
import numpy as np
import shapely
from jaxtyping import Float64
from shapely.geometry.base import BaseGeometry

from pipeline.types import Frame, Mask, Points2

_ASIDE_M = 0.001
_CUBE = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
_BOUNDED = [  # kinds of geoms that lie in their mesh or box
    int(kind)
    for kind in (
        *(mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_HFIELD),
        *(mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE),
        *(mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    )
]
_SURELY_M = 0.003  # within or beyond an outline in plan: more than a ray is moved aside, and than rounding


@dataclass(frozen=True)
class Navigability:
    """Number and places of blocked columns.

    A wall may differ from the plan by `wall_band_m`: the simplification tolerance plus half a pixel's diagonal.
    `blocked` counts the columns deeper in the plan's free space than this, `blocked_at_wall` the others.
    `blocked_places_m` and `blocked_depths_m` list both.
    """

    columns: int
    blocked: int
    blocked_at_wall: int
    blocked_at_wall_share: float
    wall_band_m: float
    deepest_blocked_m: float
    blocked_places_m: Points2
    blocked_depths_m: Float64[np.ndarray, " n"]


def cast_columns(
    model: mujoco.MjModel,
    T_world_mine: np.ndarray,
    free: Mask,
    frame: Frame,
    height_m: float,
    tolerance_m: float,
    floor_group: int,
    rock_group: int,
) -> Navigability:
    """Cast a ray down at the centre of every free pixel; a column is open when its ray hits the floor.

    `mj_ray` looks at every geom. It is asked where rock is near in plan, or no box of the floor is surely below; all
    other rays hit the floor.

    Parameters
    ----------
    model : mujoco.MjModel
    T_world_mine : (4, 4)
    free : (rows, cols) bool
        The plan's free space.
    frame : Frame
        The plan's pixel grid.
    height_m : float
        Top of the rock. Rays start above it and ignore the roof, so that no ray starts inside a part.
    tolerance_m : float
        Largest distance, m, by which simplification may have moved a wall.
    floor_group, rock_group : int
        Geom groups.

    Returns
    -------
    Navigability
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rows, cols = np.nonzero(free)
    places, top_m = frame.to_mine(np.column_stack([cols, rows]) + 0.5), height_m + 0.2
    geoms = _Geoms(model, data, T_world_mine)
    pixels = _Pixels(frame, rows, cols, places)
    is_floor = np.append(model.geom_group == floor_group, False)  # index -1: no hit
    group = np.clip(model.geom_group, 0, mujoco.mjNGROUP - 1)  # as MuJoCo reads it
    is_rock = np.isin(group, (floor_group, rock_group)) & ~is_floor[:-1]
    open_ = _over_floor(geoms, np.flatnonzero(is_floor), pixels, top_m)
    open_ &= ~_near_rock(geoms, np.flatnonzero(is_rock), pixels)
    asked = np.flatnonzero(~open_)
    starts = np.column_stack([places[asked], np.full(len(asked), top_m)])
    starts = starts @ T_world_mine[:3, :3].T + T_world_mine[:3, 3]
    down = -T_world_mine[:3, 2].copy()
    groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    groups[[floor_group, rock_group]] = 1
    hit = np.zeros(1, dtype=np.int32)
    for column, start in zip(asked, starts, strict=True):
        mujoco.mj_ray(model, data, start, down, groups, 1, -1, hit)
        if hit[0] < 0:  # along the border of two boxes, which 32 bits leave a hair apart
            mujoco.mj_ray(model, data, start + _ASIDE_M * T_world_mine[:3, 0], down, groups, 1, -1, hit)
        open_[column] = is_floor[hit[0]]
    depth = _depth_m(free, frame)[rows, cols]
    band = tolerance_m + np.sqrt(0.5) / frame.px_per_m
    blocked = ~open_
    deep = blocked & (depth > band)
    return Navigability(
        columns=len(places),
        blocked=int(deep.sum()),
        blocked_at_wall=int((blocked & ~deep).sum()),
        blocked_at_wall_share=round(float((blocked & ~deep).mean()), 6),
        wall_band_m=round(float(band), 4),
        deepest_blocked_m=round(float(depth[blocked].max(initial=0.0)), 4),
        blocked_places_m=places[blocked],
        blocked_depths_m=depth[blocked],
    )


@dataclass(frozen=True)
class _Geoms:
    """The geoms of a model, placed."""

    model: mujoco.MjModel
    data: mujoco.MjData
    T_world_mine: np.ndarray

    def is_seen(self, geom: int) -> bool:
        """Return whether rays hit a geom: MuJoCo leaves out those without colour."""
        material = self.model.geom_matid[geom]
        rgba = self.model.geom_rgba[geom] if material < 0 else self.model.mat_rgba[material]
        return bool(rgba[3])

    def corners(self, geom: int) -> np.ndarray | None:
        """Return points (n, 3), m, mine frame, in whose convex hull a geom lies; None if it has no bounds."""
        model, kind, mesh = self.model, self.model.geom_type[geom], self.model.geom_dataid[geom]
        if kind not in _BOUNDED:
            return None
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            own = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(np.float64)
        else:
            own = model.geom_aabb[geom, :3] + model.geom_aabb[geom, 3:] * _CUBE
        world = own @ self.data.geom_xmat[geom].reshape(3, 3).T + self.data.geom_xpos[geom]
        mine: np.ndarray = (world - self.T_world_mine[:3, 3]) @ self.T_world_mine[:3, :3]
        return mine


class _Pixels:
    """Free pixels in the order of rows and columns, found by their middles."""

    def __init__(self, frame: Frame, rows: np.ndarray, cols: np.ndarray, places: np.ndarray) -> None:
        self._frame, self._places, self.count = frame, places, len(places)
        self._numbers = rows * frame.width_px + cols

    def within(self, outline: BaseGeometry) -> np.ndarray:
        """Return which pixels (k,) have their middles in an outline, m, mine frame."""
        if outline.is_empty:
            return np.zeros(0, np.int64)
        west, south, east, north = outline.bounds
        ends_m = np.array([[west, north], [east, south]])
        (left, top), (right, bottom) = np.floor(self._frame.to_image(ends_m)).astype(np.int64)
        most = self._frame.width_px - 1
        rows = np.arange(max(top, 0), min(bottom, self._frame.height_px - 1) + 1)[:, None] * self._frame.width_px
        if right < 0 or left > most:
            return np.zeros(0, np.int64)
        ends = np.searchsorted(self._numbers, rows + np.array([max(left, 0), min(right, most) + 1]))
        count = ends[:, 1] - ends[:, 0]
        near = np.arange(count.sum()) + np.repeat(ends[:, 0] - np.cumsum(count) + count, count)
        shapely.prepare(outline)
        return near[shapely.contains_xy(outline, *self._places[near].T)]


def _over_floor(geoms: _Geoms, floors: np.ndarray, pixels: _Pixels, top_m: float) -> np.ndarray:
    """Return over which pixels (n,) a ray down from `top_m` surely hits a box among geoms of the floor."""
    over = np.zeros(pixels.count, bool)
    for geom in floors:
        corners = geoms.corners(geom)
        is_box = geoms.model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX and geoms.is_seen(geom)
        if is_box and corners is not None and corners[:, 2].max() < top_m - _SURELY_M:
            over[pixels.within(_hull(corners).buffer(-_SURELY_M))] = True
    return over


def _near_rock(geoms: _Geoms, rocks: np.ndarray, pixels: _Pixels) -> np.ndarray:
    """Return which pixels (n,) one of some geoms may cover in plan."""
    near = np.zeros(pixels.count, bool)
    for geom in rocks:
        corners = geoms.corners(geom)
        near[slice(None) if corners is None else pixels.within(_hull(corners).buffer(_SURELY_M))] = True
    return near


def _hull(corners: np.ndarray) -> BaseGeometry:
    return shapely.convex_hull(shapely.multipoints(corners[:, :2]))


def _depth_m(free: Mask, frame: Frame) -> np.ndarray:
    """Return the distance, m, from each free pixel's centre to the edge of the nearest rock pixel."""
    padded = np.pad(free.astype(np.uint8), 1)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    return np.maximum(distance - 0.5, 0.0) / frame.px_per_m
