"""Physics of all robots by MuJoCo Warp: one model, rock in slots, chassis contacts latched on every substep."""

from typing import Any

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

from minexplore.bundle import ROOF_GEOM, is_rock
from minexplore.extra.warp.kernels.frames import MineFrame
from minexplore.extra.warp.slots import TILE_M, find_rows, list_parts, part_arrays, slot_model, write_slots
from minexplore.physics.local_models import LocalModels

_BATCHED = ("geom_dataid", "geom_aabb", "geom_rbound")
_FLOORS = 2  # zones that a wheel can stand on at once
_PARTS = 8  # of rock that a chassis can touch at once; `overflows` lists robots that touch more, as for what follows
_PAIRS, _CONVEX = 12, 4  # pairs of geoms near each other, and those of chassis and rock, of a robot on average
# MuJoCo Warp iterates until all robots have converged, so one that never does (NaN) would hold up the others a hundred
# times. docs/evidence/parts/gpu-parity.md has the most that contacts took.
_ITERATIONS = 20
_LANES = 32  # threads that share a robot's matrix of 8 x 8; MuJoCo Warp's own 128 and 64 suit larger robots
_ITERATED = mjw.OverflowType.ITERATIONS | mjw.OverflowType.LS_ITERATIONS  # a limit of iterations; nothing was left out


def put_model(model: mujoco.MjModel, **kwargs: Any) -> mjw.Model:
    """Return a model of one robot on Warp's current device, from the arguments of `mjw.put_model`; nothing is printed.

    What does not fit is kept as bits of `mjw.OverflowType`.
    """
    found = mjw.put_model(model, **kwargs)
    found.opt.warn_overflow = 0
    found.block_dim.update_gradient_JTDAJ_dense = found.block_dim.update_gradient_cholesky = _LANES
    return found


class WarpPhysics:
    """The physics of n robots on Warp's current device."""

    def __init__(self, models: LocalModels, count: int, frame: MineFrame) -> None:
        """Make the model with as many slots as the mine's fullest tile needs."""
        self.count, self._frame = count, frame
        self.table = list_parts(models)
        self.slots = self.table.parts.shape[1]
        self.host_model, geoms = slot_model(models, self.slots)
        floor_pairs, rock_pairs = 4 * _FLOORS, self.slots + 1  # of one robot at most; the roof is rock
        self.host_model.opt.iterations = _ITERATIONS
        rows = max(2, count)  # MuJoCo Warp looks for empty mesh slots only where a field has several rows
        self.model = put_model(self.host_model, batch_sizes=dict.fromkeys(_BATCHED, rows))
        self.limits = {
            "naconmax": max(_PAIRS * count, floor_pairs + rock_pairs),
            "naccdmax": max(_CONVEX * count, rock_pairs),
            "njmax": 2 + _FLOORS * (2 * 4 + 2) + 4 * _PARTS,  # dry friction; wheels and castors; chassis
        }
        self.data = mjw.make_data(self.host_model, nworld=count, **self.limits)
        self._rows, self._parts = wp.array(self.table.row, dtype=int), wp.array(self.table.parts, dtype=int)
        self._geoms, self._known = wp.array(geoms, dtype=int), part_arrays(models)
        self.row, self.moved = wp.full(count, -1, dtype=int), wp.zeros(count, dtype=bool)
        self.qpos0 = wp.array(self.host_model.qpos0, dtype=float)
        names = [self.host_model.geom(k).name for k in range(self.host_model.ngeom)]
        self._solid = wp.array([name == ROOF_GEOM or is_rock(name) for name in names], dtype=bool)
        self._chassis = names.index("robot_chassis")

    def fill_slots(self, fault: wp.array) -> None:
        """Give every robot the rock within its reach during one control step."""
        table, known, model, data = self.table, self._known, self.model, self.data
        wp.launch(
            find_rows,
            self.count,
            [self._frame, TILE_M, wp.vec2i(*table.first), self._rows, data.qpos, fault, self.row, self.moved],
        )
        wp.launch(
            write_slots,
            (self.count, self.slots),
            [self._parts, self._geoms, known.mesh, known.place, known.rotation, known.bounds, known.radius]
            + [self.row, self.moved, model.geom_dataid, model.geom_aabb, model.geom_rbound]
            + [data.geom_xpos, data.geom_xmat],
        )

    def advance(self, substeps: int, touched: wp.array) -> None:
        """Step the physics; `touched` is set for robots whose chassis met rock in any substep."""
        data = self.data
        for _ in range(substeps):
            mjw.step(self.model, data)
            contacts = [data.nacon, data.contact.geom, data.contact.worldid, self._solid, self._chassis, touched]
            wp.launch(latch_contacts, data.naconmax, contacts)

    def overflows(self) -> np.ndarray:
        """Return what did not fit (robots,) int, bits of `mjw.OverflowType`; it waits for the device."""
        return self.data.overflow.numpy() & ~int(_ITERATED)

    def set_state(self, qpos: np.ndarray, qvel: np.ndarray, warmstart: np.ndarray) -> None:
        """Bring all robots into a state of MuJoCo's, (robots, nq) and (robots, nv)."""
        for array, values in ((self.data.qpos, qpos), (self.data.qvel, qvel), (self.data.qacc_warmstart, warmstart)):
            array.assign(values.astype(np.float32))


@wp.kernel(enable_backward=False)
def latch_contacts(
    found: wp.array[int],
    geoms: wp.array[wp.vec2i],
    robots: wp.array[int],
    solid: wp.array[bool],
    chassis: int,
    touched: wp.array[bool],
):
    """Note the robots whose chassis touches rock now, a thread a contact of all robots."""
    contact = wp.tid()
    if contact >= found[0]:
        return
    pair = geoms[contact]
    if (pair[0] == chassis and solid[pair[1]]) or (pair[1] == chassis and solid[pair[0]]):
        touched[robots[contact]] = True
