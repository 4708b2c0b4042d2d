"""Physics of many robots, each alone in the mine: every robot is stepped in the local model of the tile it is on."""

from __future__ import annotations

import os
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
from mujoco.batch import Batch

from minexplore.physics.local_models import LocalModels
from minexplore.tiles import Tile, group_by_tile

_ROBOTS_PER_CALL = 16  # of one tile that a thread steps in one call
# A batch takes 0.5 MB, and 1.2 ms to make. Without a limit a process grew to 4 GB in the embedded mine.
_KEPT_BATCHES = 512
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_NUMBERS = np.arange(_ROBOTS_PER_CALL, dtype=np.int32)
_Group = tuple[Tile, np.ndarray]  # a tile, and the robots to step in its model


class PhysicsStepper:
    """The integration states of n robots, and what advances them.

    A row of `state` holds the whole integration state of one robot, so it does not matter in which batch it advances:
    a robot that drives to another tile takes its row along. `qpos` and `qvel` are views of it.
    """

    def __init__(self, models: LocalModels, count: int, threads: int, place_m: np.ndarray) -> None:
        """Give every robot the initial state of the model at a place (2,) m of the mine frame."""
        self.models, self._threads, self._process = models, threads, os.getpid()
        tile = models.tiles_of(place_m[None])[0]
        model = models.model(tuple(tile.tolist()))
        data = mujoco.MjData(model)
        self._initial = np.zeros(mujoco.mj_stateSize(model, _STATE))
        mujoco.mj_getState(model, data, self._initial, _STATE)
        self.state = np.tile(self._initial, (count, 1))
        self.qpos, self.qvel = self.state[:, 1 : 1 + model.nq], self.state[:, 1 + model.nq : 1 + model.nq + model.nv]
        first = _find_controls(model, data)
        self.ctrl = self.state[:, first : first + model.nu]
        self._batches: OrderedDict[tuple[int, ...], Batch] = OrderedDict()  # by thread, tile, alone; oldest use first
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def restart(self, robot: int) -> None:
        """Give a robot the initial state again."""
        self.state[robot] = self._initial

    def advance(self, robots: np.ndarray, places_m: np.ndarray, steps: int) -> np.ndarray:
        """Advance robots (k,) at places (k, 2) m, mine frame; return which touched rock (k,) bool.

        Raises
        ------
        RuntimeError
            If MuJoCo warns of a robot's physics; the message names the robot and its state.
        """
        tiles = self.models.tiles_of(places_m)
        if len(robots) == 1:  # there is nothing to group, nor to deal out to threads
            self._forget(_KEPT_BATCHES)
            return self._advance_group(0, tuple(tiles[0].tolist()), robots, steps)
        groups = self._group(robots, tiles)
        groups.sort(key=lambda group: -len(group[1]))
        self._forget(max(_KEPT_BATCHES, 2 * len(groups)))
        touched = np.zeros(len(self.state), dtype=bool)

        def run(thread: int) -> None:
            for tile, rows in groups[thread :: self._threads]:
                touched[rows] = self._advance_group(thread, tile, rows, steps)

        if self._process != os.getpid():  # a fork takes no threads along: without new ones the child waits for ever
            self._process = os.getpid()
            self._pool = ThreadPoolExecutor(self._threads) if self._pool is not None else None
        if self._pool is None:
            run(0)
        else:
            list(self._pool.map(run, range(self._threads)))
        return touched[robots]

    def _group(self, robots: np.ndarray, tiles: np.ndarray) -> list[_Group]:
        """Return the robots of each tile, at most as many together as one call steps."""
        return [
            (tile, robots[members[at : at + _ROBOTS_PER_CALL]])
            for tile, members in group_by_tile(tiles)
            for at in range(0, len(members), _ROBOTS_PER_CALL)
        ]

    def _forget(self, most: int) -> None:
        """Drop the batches that were used longest ago, but `most`."""
        while len(self._batches) > most:
            self._batches.popitem(last=False)

    def _advance_group(self, thread: int, tile: Tile, rows: np.ndarray, steps: int) -> np.ndarray:
        """Step robots of one tile; return which had a contact with rock in any step (k,) bool."""
        count = len(rows)
        own = rows if count > 1 else rows.item()
        batch = self._batch(thread, tile, alone=count == 1)
        batch.state[:count] = self.state[own]
        ids = None if count == batch.nsim else _NUMBERS[:count]
        record = batch.rollout(steps, record=("sensordata",), ids=ids)["sensordata"]
        self.state[own] = batch.state[:count]
        if np.count_nonzero(batch.warning[:count]):
            robot = rows[int(batch.warning[:count].reshape(count, -1).any(axis=1).argmax())]
            raise RuntimeError(f"robot {robot}: MuJoCo warns of its physics at state {self.qpos[robot].tolist()}")
        touched: np.ndarray = record[..., 0].any(axis=1)
        return touched

    def _batch(self, thread: int, tile: Tile, alone: bool) -> Batch:
        """Return the batch of a thread and a tile; a robot alone has one of its own, which takes no list of rows."""
        key = (thread, *tile, alone)
        batch = self._batches.get(key)
        if batch is None:
            other = self._batches.get((thread, *tile, not alone))
            model = self.models.model(tile) if other is None else other.model
            batch = self._batches[key] = Batch(model, 1 if alone else _ROBOTS_PER_CALL, 1, False)
        self._batches.move_to_end(key)
        return batch

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None


def _find_controls(model: mujoco.MjModel, data: mujoco.MjData) -> int:
    """Return where the controls begin in the integration state."""
    state = np.zeros(mujoco.mj_stateSize(model, _STATE))
    data.ctrl[:] = np.pi
    mujoco.mj_getState(model, data, state, _STATE)
    data.ctrl[:] = 0.0
    return int(np.flatnonzero(state == np.pi)[0])
