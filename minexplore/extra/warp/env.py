"""The exploration task for many robots on one device: all of a step stays there, and nothing waits for it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
import warp as wp
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from minexplore.bundle import has_rough_floor
from minexplore.envs.call_checks import check_options, numbers_of, spread_seeds
from minexplore.envs.horizon import Timed
from minexplore.envs.vector import check_count, find_mode, task_of
from minexplore.envs.vector_rows import mask_of
from minexplore.extra.warp import require_device
from minexplore.extra.warp.batch import WarpBatch
from minexplore.extra.warp.kernels.faults import MEANINGS
from minexplore.extra.warp.limits import default_robot, overflow_message
from minexplore.physics.robots import RobotChoice
from minexplore.sensing.observation import observation_space
from minexplore.task import TaskParams
from minexplore.world import find_world, load_world

_INFO = {  # of `info`: the array of the batch
    "cells_seen": "cells_seen",
    "coverage": "coverage",
    "collision": "touched",
    "collisions": "collisions",
    "zone": "zone",
    "pose_m_rad": "pose",
    "height_m": "height",
    "pitch_rad": "pitch",
    "roll_rad": "roll",
}
_WORD = 1 << 32


class MineWarpEnv(Timed, VectorEnv):
    """`num_envs` robots on a device, each alone in its own copy of the mine; see `MineEnv` for the task.

    `reset` and `step` return torch tensors on the device: views of the environment's own arrays, which the next call
    overwrites. `step` queues work and waits for nothing, so what goes wrong is noted there: call `check` now and then.
    Physics has 32 bits here, and random numbers are others than on the CPU: trajectories agree in distribution.

    Parameters
    ----------
    num_envs : int
    world, task, robot
        As in `MineEnv`; a robot's `controls` must be linear.
    device : str
        A Warp device: `cuda:0`, or `cpu`, which is slow and there for tests.
    numpy : bool
        Return copies as arrays, as `MineVectorEnv`; every step then waits for the device and is checked.
    autoreset_mode : AutoresetMode or str
        `NEXT_STEP` (default): the step after an episode's last one resets and ignores the action. `SAME_STEP`: the last
        step resets at once; `info["final_obs"]` and `info["final_info"]` hold what robots last saw, a row a robot, true
        where `info["_final_obs"]` is. `DISABLED`: a robot whose episode ended stands still until `reset` is called with
        `options={"reset_mask": ...}`.
    max_episode_steps : int, optional
        Instead of the task's `max_steps`; `gymnasium.make_vec` gives that of the id.
    """

    closed = True  # until there is something to close

    def __init__(
        self,
        num_envs: int = 1,
        world: str | Path | None = None,
        task: TaskParams | dict[str, Any] | None = None,
        robot: RobotChoice = None,
        device: str = "cuda:0",
        numpy: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: None = None,
        max_episode_steps: int | None = None,
    ) -> None:
        """Bring the world onto the device and put the robots into it."""
        check_count("num_envs", num_envs, 1 << 20)
        if render_mode is not None:
            raise ValueError(f"render_mode = {render_mode!r}: the environment on Warp shows nothing; want None")
        self.num_envs, self.render_mode, self._numpy = num_envs, None, numpy
        self.autoreset_mode = find_mode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.task, self.robot = task_of(task, max_episode_steps), default_robot(robot)
        self.device = require_device(device)
        self.world = load_world(find_world(world))
        if self.world.has_heights:
            raise ValueError(
                f"{self.world.folder}: the environment on Warp drives on level floors; this mine has heights"
            )
        if has_rough_floor(self.world.record):
            raise ValueError(f"{self.world.folder}: the environment on Warp drives on level floors; this one is rough")
        self.robots = WarpBatch(self.world, self.task, self.robot, num_envs, self.device)
        self.single_observation_space = observation_space(self.task)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.tensors = {name: wp.to_torch(array) for name, array in self.robots.arrays.items() if name not in _UNSIGNED}
        self._reachable = torch.full((num_envs,), self.robots.grid.total, device=self.tensors["reward"].device)
        self._final = {name: torch.zeros_like(self.tensors[array]) for name, array in _INFO.items()}
        self._final_observation = torch.zeros_like(self.tensors["observation"])
        self._begun = False
        self.closed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset all robots, or those of `options["reset_mask"]`; an int seed gives robot i the seed `seed + i`."""
        self._require_open()
        check_options(options, ("reset_mask",))
        mask = self._mask_of(options)
        if not self._begun and not bool(mask.all()):
            raise gymnasium.error.ResetNeeded("reset_mask: reset all robots before some of them")
        self._seed(spread_seeds(seed, self.num_envs), mask.cpu().numpy())
        self._begun = True
        self.tensors["restarts"].copy_(mask)
        self.tensors["truncated"][mask] = False
        self.tensors["fault"][mask] = 0
        self.robots.physics.data.overflow.zero_()
        wp.synchronize_device(self.device)  # Warp's own stream is done before torch's goes on
        self.robots.restart()
        return self._returned(self.tensors["observation"]), self._info()

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all robots; robots whose episode ended are reset as `autoreset_mode` says.

        Parameters
        ----------
        actions : (n, 2) tensor or array
            Forward speed and turn rate in [-1, 1]; clipped. What is not finite counts as 0 and `check` lists it.

        Raises
        ------
        ValueError
            If the shape is another, or it holds anything but numbers.
        """
        self._require_open()
        if not self._begun:
            raise gymnasium.error.ResetNeeded("call reset before step")
        found = actions if isinstance(actions, torch.Tensor) else torch.as_tensor(numbers_of(actions))
        if tuple(found.shape) != (self.num_envs, 2):
            raise ValueError(f"actions of shape {tuple(found.shape)}: want ({self.num_envs}, 2)")
        if found.dtype == torch.float64:  # in 32 bits, large numbers would not be finite
            found = torch.where(found.isfinite(), found.clamp(-1.0, 1.0), found)
        tensors = self.tensors
        tensors["action"].copy_(found, non_blocking=True)
        extra: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            tensors["drives"].fill_(True)
            self.robots.step()
            extra = self._keep_last()
            tensors["restarts"].copy_(tensors["truncated"])
        else:
            if self.autoreset_mode is AutoresetMode.NEXT_STEP:
                tensors["restarts"].copy_(tensors["truncated"])
            else:
                tensors["restarts"].fill_(False)
            torch.logical_not(tensors["truncated"], out=tensors["drives"])
            self.robots.step()
        self.robots.restart()
        if self._numpy:
            self.check()
        names = ("observation", "reward", "terminated", "truncated")
        return *(self._returned(tensors[name]) for name in names), self._info() | extra  # type: ignore[return-value]

    def check(self) -> None:
        """Wait for the device and look for what went wrong in any step since the last reset of all robots.

        Raises
        ------
        RuntimeError
            Naming the first robot, and what it was: an action or a state that is not finite, or a robot outside of the
            mine; or naming the limit of MuJoCo Warp that was too small.
        """
        fault = self.tensors["fault"].cpu().numpy()
        if fault.any():
            robot = int(np.flatnonzero(fault)[0])
            meanings = "; ".join(text for bit, text in MEANINGS.items() if fault[robot] & bit)
            raise RuntimeError(
                f"robot {robot}: {meanings} ({np.count_nonzero(fault)} of {self.num_envs} robots have faults)"
            )
        physics = self.robots.physics
        message = overflow_message(physics.overflows(), physics.limits)
        if message:
            raise RuntimeError(message)

    def close_extras(self, **kwargs: Any) -> None:
        """Free the device's memory."""
        self.tensors, self._final = {}, {}
        self.robots.forget()
        del self.robots

    def _seed(self, seeds: list[int | None], mask: np.ndarray) -> None:
        """Give robots of a mask keys of their seeds, or of none a random one at the first reset."""
        keys, draws = self.robots.arrays["keys"].numpy().copy(), self.robots.arrays["draws"].numpy().copy()
        fresh = np.random.SeedSequence().generate_state(2 * self.num_envs).reshape(-1, 2)
        for robot in np.flatnonzero(mask).tolist():
            one = seeds[robot]
            if one is not None:
                keys[robot] = one % _WORD, one // _WORD % _WORD
                draws[robot] = 0
            elif not self._begun:
                keys[robot] = fresh[robot]
        self.robots.arrays["keys"].assign(keys)
        self.robots.arrays["draws"].assign(draws)

    def _mask_of(self, options: dict[str, Any] | None) -> torch.Tensor:
        asked = None if options is None else options.get("reset_mask")
        if isinstance(asked, torch.Tensor):
            options = {"reset_mask": asked.cpu().numpy()}
        return torch.as_tensor(mask_of(options, self.num_envs), device=self.tensors["reward"].device)

    def _keep_last(self) -> dict[str, Any]:
        """Copy what robots see before some of them are reset."""
        self._final_observation.copy_(self.tensors["observation"])
        for name, array in _INFO.items():
            self._final[name].copy_(self.tensors[array])
        ended = self.tensors["truncated"]
        last = {name: self._returned(tensor) for name, tensor in self._final.items()}
        last |= {f"_{name}": self._returned(ended) for name in _INFO}
        return {
            "final_obs": self._returned(self._final_observation),
            "_final_obs": self._returned(ended),
            "final_info": last,
            "_final_info": self._returned(ended),
        }

    def _info(self) -> dict[str, Any]:
        info = {name: self._returned(self.tensors[array]) for name, array in _INFO.items()}
        info["cells_reachable"] = self._returned(self._reachable)
        if self._numpy:
            info |= {f"_{name}": np.ones(self.num_envs, dtype=bool) for name in list(info)}
        return info

    def _returned(self, tensor: torch.Tensor) -> Any:
        if not self._numpy:
            return tensor
        return tensor.cpu().numpy().copy()

    def __getstate__(self) -> dict[str, Any]:
        """Refuse copies: the state is the device's."""
        raise TypeError("MineWarpEnv cannot be copied or pickled: make another one")

    def _require_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("the environment is closed: make another one")


_UNSIGNED = ("keys", "draws", "seen", "origins", "ends")
