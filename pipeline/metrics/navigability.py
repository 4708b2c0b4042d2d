"""Whether every column of the plan's free space is open in the world: one vertical ray per pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import mujoco
import numpy as np
from jaxtyping import Float64

from pipeline.types import Frame, Mask, Points2

_ASIDE_M = 0.001


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
    places = frame.to_mine(np.column_stack([cols, rows]) + 0.5)
    starts = np.column_stack([places, np.full(len(places), height_m + 0.2)])
    starts = starts @ T_world_mine[:3, :3].T + T_world_mine[:3, 3]
    down = -T_world_mine[:3, 2].copy()
    groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    groups[[floor_group, rock_group]] = 1
    hit = np.zeros(1, dtype=np.int32)
    is_floor = np.append(model.geom_group == floor_group, False)  # index -1: no hit
    open_ = np.empty(len(starts), dtype=bool)
    for i, start in enumerate(starts):
        mujoco.mj_ray(model, data, start, down, groups, 1, -1, hit)
        if hit[0] < 0:  # along the border of two boxes, which 32 bits leave a hair apart
            mujoco.mj_ray(model, data, start + _ASIDE_M * T_world_mine[:3, 0], down, groups, 1, -1, hit)
        open_[i] = is_floor[hit[0]]
    depth = _depth_m(free, frame)[rows, cols]
    band = tolerance_m + np.sqrt(0.5) / frame.px_per_m
    blocked = ~open_
    deep = blocked & (depth > band)
    return Navigability(
        columns=len(starts),
        blocked=int(deep.sum()),
        blocked_at_wall=int((blocked & ~deep).sum()),
        blocked_at_wall_share=round(float((blocked & ~deep).mean()), 6),
        wall_band_m=round(float(band), 4),
        deepest_blocked_m=round(float(depth[blocked].max(initial=0.0)), 4),
        blocked_places_m=places[blocked],
        blocked_depths_m=depth[blocked],
    )


def _depth_m(free: Mask, frame: Frame) -> np.ndarray:
    """Return the distance, m, from each free pixel's centre to the edge of the nearest rock pixel."""
    padded = np.pad(free.astype(np.uint8), 1)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    return np.maximum(distance - 0.5, 0.0) / frame.px_per_m
