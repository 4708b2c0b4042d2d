"""The environment on Warp beside that on the CPU: `make parity-gpu` (docs/evidence/parts/gpu-parity.md).

Every part is measured in blocks, a line a block in `RESULTS`. A run goes on where the last one stopped; blocks of other
code, another world or another device are dropped.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

from baselines.base.environments import find_id
from baselines.base.errors import BaselineError
from baselines.base.markdown import write_table
from baselines.base.progress import Progress
from baselines.policies.policy_lookup import make_policy
from benchmarks.speed.gpu_pair import Pair, compare_looks, compare_steps, drive_episodes, stress
from benchmarks.speed.gpu_parity_page import EPISODES, rows, tables
from minexplore.extra.warp import require_device, require_packages
from minexplore.task import TaskParams
from minexplore.world import find_world, load_world
from pipeline.store.files import write_atomically
from pipeline.store.hashing import import_closure, sha256_file, sha256_named

RESULTS, PAGE = Path("artifacts/proof/gpu_parity"), Path("docs/evidence/parts/gpu-parity.md")
POLICIES = ("wall-following", "ChileanMineEntrance-beams-mlp-42")
_WORLD = "chilean_mine"
# Of a robot in a block at most. Whatever the number of robots, a block drives them long enough to reach the rock.
_RAYS, _STEPS, _CONTACTS = 80, 40, 20
_NO_DEVICE = 3  # exit code


@dataclass(frozen=True)
class Part:
    """A part of the comparison: how many of its `unit` are wanted, and what measures a block by its number."""

    name: str
    unit: str
    wanted: int
    measure: Callable[[int], dict[str, Any]]

    def blocks(self, head: dict[str, Any], folder: Path) -> list[dict[str, Any]]:
        """Return the blocks of an earlier run with the same head and those that are still missing, measured now."""
        path = folder / f"{self.name}.jsonl"
        lines = [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []
        if not lines or lines[0] != head:
            lines = [head]
        progress = Progress(f"parity-gpu: {self.name}", self.wanted, sum(map(self._count, lines[1:])), self.unit)
        try:
            while progress.done < self.wanted:
                lines.append(self.measure(len(lines) - 1))
                write_atomically(path, "".join(json.dumps(line) + "\n" for line in lines).encode())
                progress.add(self._count(lines[-1]))
        finally:
            progress.close()
        return lines[1:]

    def _count(self, block: dict[str, Any]) -> int:
        """Return how many of the unit a block holds."""
        return int(block[self.unit.replace(" ", "_")])


def merge(blocks: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of all blocks: the largest, the least, else the sum; lists are put one behind the other."""
    kinds = {"largest": max, "least": min}
    found: dict[str, Any] = {}
    for name in blocks[0]:
        values = [block[name] for block in blocks]
        together = kinds.get(name.partition("_")[0], sum)
        found[name] = list(chain.from_iterable(values)) if isinstance(values[0], list) else together(values)
    return found


def block_sizes(robots: int, rays: int, steps: int, contacts: int) -> tuple[int, int, int]:
    """Return the rays, control steps and contacts of a block, of all robots together and no more than are wanted."""
    return min(_RAYS * robots, rays), min(_STEPS * robots, steps), min(_CONTACTS * robots, contacts)


class Comparison:
    """What is compared on a device, made when the first block needs it."""

    def __init__(self, device: str, robots: int, env: str) -> None:
        """Take the device's name, the robots of a block, and the environment of whole episodes."""
        self._device, self._robots, self._env = device, robots, env

    @cached_property
    def _pair(self) -> Pair:
        return Pair(load_world(find_world(_WORLD)), self._robots, self._device)

    @cached_property
    def _envs(self) -> tuple[Any, Any]:
        import gymnasium

        import minexplore  # noqa: F401  registers the environments

        kwargs: dict[str, Any] = {"num_envs": self._robots, "vectorization_mode": "vector_entry_point"}
        warp = gymnasium.make_vec(self._env, **kwargs, backend="warp", device=self._device, numpy=True)
        return gymnasium.make_vec(self._env, **kwargs, threads=os.cpu_count() or 1), warp

    def parts(self, asked: argparse.Namespace) -> Iterator[Part]:
        """Yield the parts with the counts of the command line."""
        rays, steps, contacts = block_sizes(asked.robots, asked.rays, asked.steps, asked.contacts)
        yield Part("looks", "rays", asked.rays, lambda block: compare_looks(self._pair, rays, block))
        yield Part("steps", "control steps", asked.steps, lambda block: compare_steps(self._pair, steps, block))
        yield Part("stress", "contacts", asked.contacts, lambda block: stress(self._pair, contacts, block))
        for name in asked.policy:
            yield Part(f"{EPISODES}{name}", "episodes", asked.episodes, partial(self._drive, name))

    def _drive(self, name: str, block: int) -> dict[str, Any]:
        cpu, warp = self._envs
        seed, task = block * self._robots, cpu.unwrapped.task
        found = [drive_episodes(env, make_policy(name, self._robots, task), seed) for env in (cpu, warp)]
        return {"episodes": self._robots, "cpu": found[0], "warp": found[1]}


def main() -> int:
    """Measure what is missing and write `PAGE`; return 1 if anything misses its limit, 3 without a device."""
    parser = argparse.ArgumentParser(prog="parity-gpu", description=__doc__)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--robots", type=int, default=256, help="at a time")
    parser.add_argument("--rays", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--contacts", type=int, default=1_000_000)
    parser.add_argument("--episodes", type=int, default=256)
    parser.add_argument("--env", default="MineXplore/ChileanMineEntrance-v0", help="of the whole episodes")
    parser.add_argument("--policy", nargs="*", default=list(POLICIES), help="of the whole episodes")
    parser.add_argument("--only", nargs="*", metavar="PART", help="measure these now, write no page")
    asked = parser.parse_args()
    if asked.robots < 1:
        parser.error(f"--robots {asked.robots}: want 1 or more")
    try:
        asked.env = find_id(asked.env)
        for name in asked.policy:
            make_policy(name, 1, TaskParams())
    except BaselineError as error:
        parser.error(str(error))
    try:
        require_packages()
        device = require_device(asked.device)
    except (ImportError, ValueError) as error:
        print(f"parity-gpu: {error}", file=sys.stderr)
        return _NO_DEVICE
    parts = {part.name: part for part in Comparison(asked.device, asked.robots, asked.env).parts(asked)}
    if unknown := sorted(set(asked.only or ()) - parts.keys()):
        parser.error(f"--only {' '.join(unknown)}: valid choices are {', '.join(parts)}")
    name = device.name if device.is_cuda else "Warp's CPU device"
    head = {"device": name, "robots": asked.robots, "env": asked.env, **_versions()}
    RESULTS.mkdir(parents=True, exist_ok=True)
    wanted = [part for part in parts.values() if part.wanted and (asked.only is None or part.name in asked.only)]
    lines = rows({part.name: merge(part.blocks(head, RESULTS)) for part in wanted})
    text = tables(lines, name, asked.robots, asked.env)
    if asked.only is None:
        write_table(PAGE, text)
    print(text, end="")
    return int(not all(row.holds for row in lines))


def _versions() -> dict[str, str]:
    """Return MuJoCo Warp's version, and the hashes of the world and of the sources that the figures depend on."""
    root = Path(__file__).resolve().parents[2]
    modules = ("minexplore/extra/warp/env.py", "minexplore/envs/vector.py", "benchmarks/speed/gpu_pair.py")
    sources = {path for module in modules for path in import_closure(root / module, root)}
    return {
        "mujoco_warp": version("mujoco-warp"),
        "world": str(load_world(find_world(_WORLD)).record["world_sha256"]),
        "code": sha256_named({str(path): sha256_file(root / path) for path in sources}),
    }


if __name__ == "__main__":
    sys.exit(main())
