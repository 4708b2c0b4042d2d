"""Rock round each robot: a fixed number of collision slots a robot, rewritten when it drives onto another tile."""

from dataclasses import dataclass

import mujoco
import numpy as np
import warp as wp

from minexplore.bundle import is_rock
from minexplore.extra.warp.kernels.faults import OUTSIDE
from minexplore.extra.warp.kernels.frames import MineFrame, body_place
from minexplore.physics.local_models import LocalModels, meets
from minexplore.physics.robot import ROCK_BODY
from minexplore.tiles import tiles_at

# On the default mine a tile of 2 m has up to 16 parts within reach, one of 1 m 7, one of 0.5 m 6; all of it is exact.
TILE_M = 1.0
_SLOT = "rock_slot_"


@dataclass(frozen=True)
class SlotTable:
    """Which collision parts a robot on a tile can touch.

    `row[i, j]` is the row of `parts` of the tile in row i, column j, counted from the tile `first` on; -1 where
    the tile has no free place. `parts` (rows, slots) are numbers of collision parts, -1 behind the last.
    """

    first: tuple[int, int]
    row: np.ndarray
    parts: np.ndarray


def list_parts(models: LocalModels) -> SlotTable:
    """Return the parts within reach of every tile that has a free place."""
    world = models.world
    row, col = np.nonzero(world.clearance_m > 0)
    places = world.origin_m + (np.column_stack([col, row]) + 0.5) * world.cell_m
    tiles = np.unique(tiles_at(places, TILE_M), axis=0)
    low, high = models.reach(tiles, TILE_M)
    near = np.stack([meets(part.outline, low, high) for part in models.parts], axis=1)
    slots = max(1, int(near.sum(axis=1).max()))
    parts = np.full((len(tiles), slots), -1, dtype=np.int32)
    tile, part = np.nonzero(near)
    parts[tile, (np.cumsum(near, axis=1) - 1)[tile, part]] = part
    first = tiles.min(axis=0)
    rows = np.full(np.ptp(tiles, axis=0)[::-1] + 1, -1, dtype=np.int32)
    rows[tuple((tiles - first).T[::-1])] = np.arange(len(tiles))
    return SlotTable((int(first[0]), int(first[1])), rows, parts)


@dataclass(frozen=True)
class PartArrays:
    """Every collision part as MuJoCo compiles it: mesh number, place (m) and rotation in the world, bounds (m)."""

    mesh: wp.array
    place: wp.array
    rotation: wp.array
    bounds: wp.array
    radius: wp.array


def part_arrays(models: LocalModels) -> PartArrays:
    """Return the parts on Warp's current device, as MuJoCo compiles them: about their own centres."""
    model = models.spec(None).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geoms = np.array([model.geom(part.name).id for part in models.parts], dtype=int)
    return PartArrays(
        wp.array(model.geom_dataid[geoms], dtype=int),
        wp.array(data.geom_xpos[geoms], dtype=wp.vec3),
        wp.array(data.geom_xmat[geoms].reshape(-1, 3, 3), dtype=wp.mat33),
        wp.array(model.geom_aabb[geoms].reshape(-1, 2, 3), dtype=wp.vec3),
        wp.array(model.geom_rbound[geoms], dtype=float),
    )


def slot_model(models: LocalModels, slots: int) -> tuple[mujoco.MjModel, np.ndarray]:
    """Return the physics model of floor, roof, robot and empty rock slots, and the geoms (slots,) that are slots.

    It holds the meshes of all parts, numbered as in `part_arrays`.
    """
    spec = models.spec(None)
    for sensor in list(spec.sensors):  # contacts are latched on every substep instead
        spec.delete(sensor)
    rock = [geom for geom in spec.geoms if is_rock(geom.name)]
    body, like = spec.body(ROCK_BODY), rock[0]
    for k in range(slots):
        body.add_geom(
            name=f"{_SLOT}{k}",
            type=like.type,
            meshname=like.meshname,
            pos=like.pos,
            friction=like.friction,
            group=like.group,
            contype=like.contype,
            conaffinity=like.conaffinity,
        )
    for geom in rock:
        spec.delete(geom)
    model = spec.compile()
    return model, np.array([model.geom(f"{_SLOT}{k}").id for k in range(slots)], dtype=np.int32)


@wp.kernel(enable_backward=False)
def find_rows(
    frame: MineFrame,
    tile_m: wp.float64,
    first: wp.vec2i,
    rows: wp.array2d[int],
    qpos: wp.array2d[float],
    fault: wp.array[int],
    row: wp.array[int],
    moved: wp.array[bool],
):
    """Find the table's row of each robot's tile, a thread a robot; where there is none, its slots stay as they are."""
    robot = wp.tid()
    place = body_place(frame, qpos, robot)
    i = int(wp.floor(place[1] / tile_m)) - first[1]
    j = int(wp.floor(place[0] / tile_m)) - first[0]
    found = int(-1)
    if i >= 0 and i < rows.shape[0] and j >= 0 and j < rows.shape[1]:
        found = rows[i, j]
    moved[robot] = found >= 0 and found != row[robot]
    if found >= 0:
        row[robot] = found
    else:
        fault[robot] = fault[robot] | OUTSIDE


@wp.kernel(enable_backward=False)
def write_slots(
    parts: wp.array2d[int],
    slots: wp.array[int],
    mesh: wp.array[int],
    place: wp.array[wp.vec3],
    rotation: wp.array[wp.mat33],
    bounds: wp.array2d[wp.vec3],
    radius: wp.array[float],
    row: wp.array[int],
    moved: wp.array[bool],
    geom_dataid: wp.array2d[int],
    geom_aabb: wp.array3d[wp.vec3],
    geom_rbound: wp.array2d[float],
    geom_xpos: wp.array2d[wp.vec3],
    geom_xmat: wp.array2d[wp.mat33],
):
    """Put the parts of a robot's tile into its slots, a thread a robot and slot."""
    robot, slot = wp.tid()
    if not moved[robot]:
        return
    part = parts[row[robot], slot]
    geom = slots[slot]
    if part < 0:
        geom_dataid[robot, geom] = -1
        return
    geom_dataid[robot, geom] = mesh[part]
    geom_xpos[robot, geom] = place[part]
    geom_xmat[robot, geom] = rotation[part]
    geom_rbound[robot, geom] = radius[part]
    for k in range(2):
        geom_aabb[robot, geom, k] = bounds[part, k]
