"""The environment on Warp beside that on the CPU, its reference: `make parity-gpu`, and at small counts the tests."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.stats

from minexplore.robot import RobotParams, free_joint_qpos
from minexplore.robot_batch import RobotBatch
from minexplore.task import TaskParams
from minexplore.warp import require_device, require_packages
from minexplore.world import World, find_world, load_world

OUT = Path("artifacts/proof/gpu_parity.json")
RANGE_LIMIT_M = 1e-3
FLAGS_LIMIT = 0.999
KS_LIMIT = 0.01  # p-value below which two samples are taken to differ


class Pair:
    """The same robots on the CPU and on a device; floor zones have no noise, whose generators differ."""

    def __init__(self, world: World, count: int, device: str, task: TaskParams | None = None) -> None:
        """Make both."""
        from minexplore.warp.batch import WarpBatch

        calm = [dataclasses.replace(zone, speed_noise_mps=0.0) for zone in world.floor_zones]
        self.world = dataclasses.replace(world, floor_zones=calm)
        self.task = task or TaskParams()
        self.count = count
        self.cpu = RobotBatch(self.world, self.task, RobotParams(), count)
        self.warp = WarpBatch(self.world, self.task, RobotParams(), count, require_device(device))
        self.rngs = [np.random.default_rng(i) for i in range(count)]

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


def hard_driving(rng: np.random.Generator, count: int, step: int, held: int = 8, base: int = 0) -> np.ndarray:
    """Return full throttle with turns that change every `held` steps, (count, 2) float32."""
    block = np.random.default_rng([base, step // held])
    return np.column_stack([block.choice([1.0, 1.0, 1.0, -1.0], count), block.uniform(-1, 1, count)]).astype(np.float32)


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
        pair.warp.look("drives")
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
    rng, every = np.random.default_rng(seed), np.arange(pair.count)
    a = pair.warp.arrays
    a["drives"].fill_(True)
    flags, moved, contacts, rewards, compared = 0, [], 0, 0.0, 0
    for step in range(-(-steps // pair.count)):
        if step % 60 == 0:
            pair.scatter(rng)
        pair.share_state()
        pair.share_counts()
        action = hard_driving(rng, pair.count, step, base=seed)
        a["action"].assign(action)
        outcome = pair.cpu.step(action, pair.rngs)
        pair.warp.step()
        touched = a["touched"].numpy().astype(bool)
        same = touched == outcome.info["collision"]
        flags += int(same.sum())
        contacts += int(outcome.info["collision"].sum())
        moved.append(np.linalg.norm(pair.warp.physics.data.qpos.numpy()[:, :3] - pair.cpu.qpos[:, :3], axis=1))
        equal = same & (a["cells_seen"].numpy() == pair.cpu.cells_seen)
        compared += int(equal.sum())
        rewards = max(rewards, float(np.abs(a["reward"].numpy() - outcome.reward)[equal].max(initial=0.0)))
    place = np.concatenate(moved)
    return {
        "control_steps": len(place),
        "with_contact": contacts,
        "flags_that_agree": flags / len(place),
        "rewards_compared": compared,
        "largest_reward_difference": rewards,
        "place_apart_m": {
            "median": float(np.median(place)),
            "p99": float(np.quantile(place, 0.99)),
            "max": float(place.max()),
        },
        "overflows": int(np.count_nonzero(pair.warp.physics.overflows())),
        "faults": int(np.count_nonzero(a["fault"].numpy())),
        "robots": len(every),
    }


def stress(pair: Pair, contacts: int, seed: int = 0) -> dict[str, Any]:
    """Ram robots into rock for at least so many control steps with contact; return what escaped or was not finite."""
    rng = np.random.default_rng(seed)
    a = pair.warp.arrays
    a["drives"].fill_(True)
    done, step = 0, 0
    a["fault"].zero_()
    while done < contacts:
        if step % 60 == 0:
            pair.scatter(rng)
            pair.share_state()
        a["action"].assign(
            np.column_stack([np.ones(pair.count), rng.uniform(-0.2, 0.2, pair.count)]).astype(np.float32)
        )
        pair.warp.drive()
        done += int(a["touched"].numpy().sum())
        step += 1
    pair.warp.describe()
    places = a["pose"].numpy()[:, :2]
    clearance = _clearance_at(pair.world, places)
    fault = a["fault"].numpy()
    return {
        "contacts": done,
        "control_steps": step * pair.count,
        "not_finite": int((~np.isfinite(places)).any(axis=1).sum() + ((fault & 2) != 0).sum()),
        "outside": int(((fault & 4) != 0).sum()),
        "least_clearance_m": float(clearance.min()),
        "overflows": int(np.count_nonzero(pair.warp.physics.overflows())),
    }


def _clearance_at(world: World, places_m: np.ndarray) -> np.ndarray:
    at = np.floor((places_m - world.origin_m) / world.cell_m).astype(int)
    rows, cols = world.clearance_m.shape
    return world.clearance_m[np.clip(at[:, 1], 0, rows - 1), np.clip(at[:, 0], 0, cols - 1)]


def compare_episodes(cpu: Any, warp: Any, policies: tuple[Any, Any], episodes: int, seed: int = 0) -> dict[str, Any]:
    """Drive whole episodes by the same policy on both; return the p-values of a two-sample KS test.

    Parameters
    ----------
    cpu, warp : VectorEnv
        Environments of as many robots, with arrays; each gives at least `episodes` episodes.
    policies : two policies
        One for each, as `baselines` has them: `reset(robots, seeds)`, `act(observation, info)`.
    """
    samples = [_drive_episodes(env, policy, episodes, seed) for env, policy in zip((cpu, warp), policies, strict=True)]
    figures = {}
    for k, name in enumerate(("return", "coverage")):
        one, two = samples[0][:, k], samples[1][:, k]
        figures[name] = {
            "cpu_mean": float(one.mean()),
            "warp_mean": float(two.mean()),
            "ks_p": float(scipy.stats.ks_2samp(one, two).pvalue),
        }
    return {"episodes": len(samples[0]), **figures}


def _drive_episodes(env: Any, policy: Any, episodes: int, seed: int) -> np.ndarray:
    """Return return and coverage (episodes, 2) of each robot's first episode, seeds after seeds."""
    found: list[np.ndarray] = []
    count = env.num_envs
    while len(found) * count < episodes:
        first = seed + len(found) * count
        observation, info = env.reset(seed=first)
        policy.reset(np.arange(count), np.arange(first, first + count))
        total, coverage, over = np.zeros(count), np.zeros(count), np.zeros(count, dtype=bool)
        while not over.all():
            observation, reward, _, truncated, info = env.step(policy.act(observation, info))
            total += np.where(over, 0.0, reward)
            coverage = np.where(over, coverage, info["coverage"])
            over |= truncated
        found.append(np.column_stack([total, coverage]))
    return np.concatenate(found)[:episodes]


def failures(found: dict[str, Any]) -> list[str]:
    """Return what of a whole comparison breaks its limit, a sentence each."""
    looks, steps, pushes = found["looks"], found["steps"], found["stress"]
    checks = [
        (
            looks["rays_beyond_1_mm"] == 0,
            f"{looks['rays_beyond_1_mm']} of {looks['rays']} rays differ by more than 1 mm",
        ),
        (looks["cells_that_differ"] == 0, f"{looks['cells_that_differ']} cells differ at equal poses"),
        (steps["flags_that_agree"] >= FLAGS_LIMIT, f"collision flags agree on {steps['flags_that_agree']:.5f}"),
        (steps["largest_reward_difference"] < 1e-4, f"rewards differ by {steps['largest_reward_difference']:g}"),
        (steps["overflows"] + pushes["overflows"] == 0, "contacts overflowed"),
        (
            pushes["not_finite"] + pushes["outside"] == 0,
            f"{pushes['outside']} robots escaped, {pushes['not_finite']} are not finite",
        ),
    ]
    for policy, figures in found.get("episodes", {}).items():
        for name in ("return", "coverage"):
            p = figures[name]["ks_p"]
            checks.append((p >= KS_LIMIT, f"{policy}: {name} differs (KS, p = {p:.4f})"))
    return [text for holds, text in checks if not holds]


def main() -> int:
    """Compare at the counts of the command line, write `OUT` and tell what fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--robots", type=int, default=1024)
    parser.add_argument("--rays", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--contacts", type=int, default=1_000_000)
    parser.add_argument("--episodes", type=int, default=256)
    parser.add_argument("--env", default="MineXplore/ChileanMineEntrance-v0")
    parser.add_argument("--policy", nargs="*", default=["wall-following"])
    asked = parser.parse_args()
    try:
        require_packages()
        require_device(asked.device)
    except (ImportError, ValueError) as error:
        print(f"parity-gpu: {error}", file=sys.stderr)
        return 3
    pair = Pair(load_world(find_world("chilean_mine")), asked.robots, asked.device)
    found = {
        "device": asked.device,
        "looks": compare_looks(pair, asked.rays),
        "steps": compare_steps(pair, asked.steps),
        "stress": stress(pair, asked.contacts),
    }
    found["episodes"] = {name: _compare_policy(asked, name) for name in asked.policy if asked.episodes}
    OUT.parent.mkdir(parents=True, exist_ok=True)
    OUT.write_text(json.dumps(found, indent=2) + "\n")
    print(json.dumps(found, indent=2))
    broken = failures(found)
    for text in broken:
        print(f"parity-gpu: {text}", file=sys.stderr)
    return 1 if broken else 0


def _compare_policy(asked: argparse.Namespace, name: str) -> dict[str, Any]:
    import gymnasium

    import minexplore  # noqa: F401  registers the environments
    from baselines.policy import make_policy

    count = min(asked.episodes, asked.robots)
    kwargs: dict[str, Any] = {"num_envs": count, "vectorization_mode": "vector_entry_point"}
    cpu = gymnasium.make_vec(asked.env, **kwargs)
    warp = gymnasium.make_vec(asked.env, **kwargs, backend="warp", device=asked.device, numpy=True)
    policies = tuple(make_policy(name, count, cpu.unwrapped.task) for _ in range(2))
    return compare_episodes(cpu, warp, policies, asked.episodes)  # type: ignore[arg-type]


if __name__ == "__main__":
    sys.exit(main())
