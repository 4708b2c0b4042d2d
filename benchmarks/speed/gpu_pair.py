"""The same robots on the CPU, which is the reference, and on Warp: how far the two differ. `gpu_parity` counts them."""

from __future__ import annotations

import dataclasses
import os
from typing import Any

import numpy as np

from minexplore.envs.robot_batch import RobotBatch
from minexplore.extra.warp import require_device
from minexplore.physics.robot import RobotParams, free_joint_qpos
from minexplore.task import TaskParams
from minexplore.world import World

RANGE_LIMIT_M = 1e-3
_NEAR_M = 1e-4  # within which two places are taken to be one
_SCATTER_EVERY, _HELD = 60, 8  # control steps


class Pair:
    """The same robots on the CPU and on a device; floor zones have no noise, whose generators differ."""

    def __init__(self, world: World, count: int, device: str, task: TaskParams | None = None) -> None:
        """Make both."""
        from minexplore.extra.warp.batch import WarpBatch
        from minexplore.extra.warp.graph import Replayed

        calm = [dataclasses.replace(zone, speed_noise_mps=0.0) for zone in world.floor_zones]
        self.world = dataclasses.replace(world, floor_zones=calm)
        self.task = task or TaskParams()
        self.count = count
        self.cpu = RobotBatch(self.world, self.task, RobotParams(), count, os.cpu_count() or 1)
        self.warp = WarpBatch(self.world, self.task, RobotParams(), count, require_device(device))
        self.rngs = [np.random.default_rng(i) for i in range(count)]
        self.look = Replayed(self.warp.device, lambda: self.warp.look("drives"))
        self.push = Replayed(self.warp.device, self._push)

    def _push(self) -> None:
        self.warp.drive()
        self.warp.describe()

    def scatter(self, rng: np.random.Generator, clearance_m: float = 0.4) -> None:
        """Place the robots at rest at random places of the mine, with nothing seen."""
        places = self.world.places_m(clearance_m)
        for robot, place in enumerate(places[rng.integers(len(places), size=self.count)]):
            self.cpu.stepper.restart(robot)
            pose = free_joint_qpos(self.cpu.T_world_mine, RobotParams(), place[0], place[1], rng.uniform(-np.pi, np.pi))
            self.cpu.qpos[robot, :7] = pose
        self.cpu.seen[:] = False
        for name in ("cells_seen", "steps", "stalled", "collisions"):
            getattr(self.cpu, name)[:] = 0
            self.warp.arrays[name].zero_()
        self.warp.arrays["seen"].zero_()

    def share_state(self) -> None:
        """Give both the CPU's state, rounded to 32 bits."""
        self.cpu.qpos[:] = self.cpu.qpos.astype(np.float32)
        self.cpu.qvel[:] = self.cpu.qvel.astype(np.float32)
        self.warp.physics.set_state(self.cpu.qpos, self.cpu.qvel, np.zeros_like(self.cpu.qvel))

    def share_counts(self) -> None:
        """Give the device what the CPU's robots have seen, and how long they drove."""
        seen = self.cpu.seen[:, self.cpu.grid.reachable]
        bits = np.zeros((self.count, 32 * self.warp.arrays["seen"].shape[1]), dtype=bool)
        bits[:, : seen.shape[1]] = seen
        self.warp.arrays["seen"].assign(np.packbits(bits, axis=1, bitorder="little").view(np.uint32))
        for name in ("cells_seen", "steps", "stalled", "collisions"):
            self.warp.arrays[name].assign(getattr(self.cpu, name).astype(np.int32))

    def seen(self) -> np.ndarray:
        """Return which reachable cells (robots, cells) the device's robots have seen."""
        words = np.ascontiguousarray(self.warp.arrays["seen"].numpy())
        bits = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little")
        return bits[:, : self.cpu.grid.total].astype(bool)

    def forget_faults(self) -> None:
        """Forget what went wrong on the device, and let all robots drive."""
        self.warp.arrays["drives"].fill_(True)
        self.warp.arrays["fault"].zero_()
        self.warp.physics.data.overflow.zero_()

    def faults(self) -> dict[str, int]:
        """Return of how many robots the state was not finite, the place outside of the mine, or contacts left out."""
        from minexplore.extra.warp.kernels.faults import NOT_FINITE, OUTSIDE

        fault = self.warp.arrays["fault"].numpy()
        return {
            "not_finite": int(((fault & int(NOT_FINITE)) != 0).sum()),
            "outside": int(((fault & int(OUTSIDE)) != 0).sum()),
            "overflows": int(np.count_nonzero(self.warp.physics.overflows())),
        }


def hard_driving(count: int, step: int, seed: int) -> np.ndarray:
    """Return full throttle with turns that change every `_HELD` steps, (count, 2) float32."""
    rng = np.random.default_rng([seed, step // _HELD])
    return np.column_stack([rng.choice([1.0, 1.0, 1.0, -1.0], count), rng.uniform(-1, 1, count)]).astype(np.float32)


def compare_looks(pair: Pair, rays: int, seed: int = 0) -> dict[str, Any]:
    """Cast at least so many rays from equal poses and mark their cells; return how far the two differ."""
    rng, beams = np.random.default_rng(seed), pair.task.beams
    every = np.arange(pair.count)
    apart, cells, looks = [], 0, 0
    pair.warp.arrays["drives"].fill_(True)
    while looks * beams < rays:
        pair.scatter(rng)
        pair.share_state()
        ranges, new = pair.cpu._look(every)
        pair.look()
        apart.append(np.abs(pair.warp.arrays["ranges"].numpy() - ranges).ravel())
        cells += int((pair.seen() != pair.cpu.seen[:, pair.cpu.grid.reachable]).sum())
        cells += int((pair.warp.arrays["gained"].numpy() != new).sum())
        looks += pair.count
    difference = np.concatenate(apart)
    return {
        "rays": len(difference),
        "largest_difference_m": float(difference.max()),
        "rays_beyond_1_mm": int((difference > RANGE_LIMIT_M).sum()),
        "cells_that_differ": cells,
    }


def compare_steps(pair: Pair, steps: int, seed: int = 0) -> dict[str, Any]:
    """Drive at least so many control steps, each from equal states; return how far the two differ after each."""
    rng, a = np.random.default_rng(seed), pair.warp.arrays
    pair.forget_faults()
    found = dict.fromkeys(("control_steps", "with_contact", "flags_that_differ", "rewards_compared"), 0)
    moved, rewards = [], 0.0
    for step in range(-(-steps // pair.count)):
        if step % _SCATTER_EVERY == 0:
            pair.scatter(rng)
        pair.share_state()
        pair.share_counts()
        action = hard_driving(pair.count, step, seed)
        a["action"].assign(action)
        outcome = pair.cpu.step(action, pair.rngs)
        pair.warp.step()
        same = a["touched"].numpy().astype(bool) == outcome.info["collision"]
        moved.append(np.linalg.norm(pair.warp.physics.data.qpos.numpy()[:, :3] - pair.cpu.qpos[:, :3], axis=1))
        equal = same & (a["cells_seen"].numpy() == pair.cpu.cells_seen)
        rewards = max(rewards, float(np.abs(a["reward"].numpy() - outcome.reward)[equal].max(initial=0.0)))
        found["control_steps"] += pair.count
        found["with_contact"] += int(outcome.info["collision"].sum())
        found["flags_that_differ"] += int((~same).sum())
        found["rewards_compared"] += int(equal.sum())
    apart = np.concatenate(moved)
    return {
        **found,
        "largest_reward_difference": rewards,
        "places_beyond_0.1_mm": int((apart > _NEAR_M).sum()),
        "largest_distance_m": float(apart.max()),
        **pair.faults(),
    }


def stress(pair: Pair, contacts: int, seed: int = 0) -> dict[str, Any]:
    """Ram robots into rock for at least so many control steps with contact; return what escaped or was not finite."""
    rng, a = np.random.default_rng(seed), pair.warp.arrays
    pair.forget_faults()
    done, step, clearance_m, iterations = 0, 0, np.inf, 0
    while done < contacts:
        if step % _SCATTER_EVERY == 0:
            pair.scatter(rng)
            pair.share_state()
        turns = rng.uniform(-0.2, 0.2, pair.count)
        a["action"].assign(np.column_stack([np.ones(pair.count), turns]).astype(np.float32))
        pair.push()
        done += int(a["touched"].numpy().sum())
        clearance_m = min(clearance_m, float(_clearance_at(pair.world, a["pose"].numpy()[:, :2]).min()))
        iterations = max(iterations, int(pair.warp.physics.data.solver_niter.numpy().max()))
        step += 1
    return {
        "contacts": done,
        "control_steps": step * pair.count,
        "least_clearance_m": clearance_m,
        "largest_iterations": iterations,
        **pair.faults(),
    }


def _clearance_at(world: World, places_m: np.ndarray) -> np.ndarray:
    """Return the map's clearance (m) at places (n, 2), m in the mine frame; -1 where they are not finite or outside."""
    at = np.floor((np.nan_to_num(places_m, nan=-1e9) - world.origin_m) / world.cell_m).astype(int)
    rows, cols = world.clearance_m.shape
    inside = (at >= 0).all(axis=1) & (at[:, 1] < rows) & (at[:, 0] < cols)
    return np.where(inside, world.clearance_m[np.where(inside, at[:, 1], 0), np.where(inside, at[:, 0], 0)], -1.0)


def drive_episodes(env: Any, policy: Any, seed: int) -> list[list[float]]:
    """Return return and coverage of the first episode of each robot of a vector environment with arrays.

    Robot i has the seed `seed + i`; `policy` is one of `baselines.policies.policy_lookup`.
    """
    count = env.num_envs
    observation, info = env.reset(seed=seed)
    policy.reset(np.arange(count), np.arange(seed, seed + count))
    total, coverage, over = np.zeros(count), np.zeros(count), np.zeros(count, dtype=bool)
    while not over.all():
        observation, reward, _, truncated, info = env.step(policy.act(observation, info))
        total += np.where(over, 0.0, reward)
        coverage = np.where(over, coverage, info["coverage"])
        over |= truncated
    return np.column_stack([total, coverage]).tolist()
