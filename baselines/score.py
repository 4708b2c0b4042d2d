"""Score results files: recompute every figure, and reject what cannot be: `python -m baselines.score FILE ...`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from baselines.errors import BaselineError, run_command
from baselines.evaluate import print_table
from baselines.oracle.record import bound_of
from baselines.policy import make_policy, policy_sha256
from baselines.protocol import SAMPLE_STEPS, Episode, Head, chain, make_env, run_episodes, task_facts
from baselines.results import read_results
from baselines.speed import top_speed_mps
from baselines.statistics import sample_times
from minexplore.reward import CAP, COLLISION_PENALTY, COVERAGE_GAIN, IDLE_PENALTY, MILESTONES
from minexplore.task import TERRAIN
from minexplore.vector import MineVectorEnv

_NOISE_S = 5.0  # standard deviations that the noise of mud and water may add to a way
_ROUND_M = 0.02  # of a place written in centimetres
_RETURN = 1e-3  # between a return and its recomputation


class RejectedError(BaselineError):
    """A results file says what cannot be."""


def score(path: Path, rerun: int = 0) -> None:
    """Check a results file.

    Parameters
    ----------
    path : Path
    rerun : int
        Episodes to drive again with the policy of that name, or the checkpoint beside the file: they must come out the
        same. Only on machines and versions alike can that be asked.

    Raises
    ------
    RejectedError
        With the episode's seed, the figure, and the limit that it breaks.
    BaselineError
        If the file is none, is cut short, or its world is not here.
    """
    head, episodes = read_results(path)
    env = make_env(head.env, 1)
    try:
        for reason in _faults_of_head(head, env):
            raise RejectedError(f"{path}: {reason}")
        bound = bound_of(head.env, head.world_sha256)
        for episode in episodes:
            for reason in _faults(head, episode, env, bound):
                raise RejectedError(f"{path}: seed {episode.seed}: {reason}")
    finally:
        env.close()
    if rerun:
        _drive_again(path, head, episodes, rerun)


def _faults_of_head(head: Head, env: MineVectorEnv) -> Iterator[str]:
    world, task = env.world.record["world_sha256"], task_facts(env.task)
    if head.world_sha256 != world:
        yield f"world {head.world_sha256[:12]} is not {head.env}'s, {world[:12]}"
    changed = [k for k in task if head.task.get(k) != task[k]] or [k for k in head.task if k not in task]
    if changed:
        yield f"the task is not {head.env}'s: {changed[0]} = {head.task.get(changed[0])}, it is {task.get(changed[0])}"
    if head.cells != env.explorers.grid.total:
        yield f"{head.cells} reachable cells, the world has {env.explorers.grid.total}"
    if len(set(head.seeds)) < len(head.seeds):
        yield "a seed comes twice"


def _faults(head: Head, episode: Episode, env: MineVectorEnv, bound: Callable[[float], int] | None) -> Iterator[str]:
    """Give the reasons why an episode cannot be."""
    task, control = env.task, env.task.control_s
    times, seen = sample_times(episode, control), np.array(episode.seen)
    if episode.steps > task.max_steps:
        yield f"{episode.steps} steps, an episode has at most {task.max_steps}"
        return
    if not len(times) == len(seen) == len(episode.path_cm):
        yield f"{len(seen)} samples of coverage, {len(episode.path_cm)} places; {episode.steps} steps have {len(times)}"
        return
    if (np.diff(seen) < 0).any() or seen[0] < 1:
        yield "coverage falls"
    if seen.max() > head.cells:
        yield f"{seen.max()} cells seen of {head.cells}"
    if bound is not None:
        over = [(t, s) for t, s in zip(times.tolist(), seen.tolist(), strict=True) if s > bound(t)]
        if over:
            yield f"{over[0][1]} cells after {over[0][0]:g} s, no robot can have seen more than {bound(over[0][0])}"
    if episode.steps < task.max_steps:
        rest = np.diff(np.array(episode.path_cm) / 100, axis=0)[-max(1, task.stall_steps // SAMPLE_STEPS - 1) : -1]
        if episode.steps < task.stall_steps or np.linalg.norm(rest, axis=1).max(initial=0.0) > 0.1:
            yield f"it ends after {episode.steps} of {task.max_steps} steps without standing still"
    yield from _faults_of_way(episode, env, times, seen)
    yield from _faults_of_return(head, episode, seen)


def _faults_of_way(episode: Episode, env: MineVectorEnv, times: np.ndarray, seen: np.ndarray) -> Iterator[str]:
    """Give what is wrong with where a robot was: faster than it drives, in rock, too far from what it saw."""
    world, task = env.world, env.task
    way = np.array(episode.path_cm) / 100
    spawn = np.array(world.record["spawn"]["anchor_m"])
    if np.linalg.norm(way[0] - spawn) > world.record["spawn"]["radius_m"] + _ROUND_M:
        yield f"it begins at {way[0].tolist()}, {np.linalg.norm(way[0] - spawn):.1f} m from the spawn"
    at = np.floor((way - world.origin_m) / world.cell_m).astype(int)
    inside = ((at >= 0) & (at < world.clearance_m.shape[::-1])).all(axis=1)
    if not inside.all() or (world.clearance_m[at[:, 1], at[:, 0]] <= 0).any():
        first = (
            int((~inside).argmax()) if not inside.all() else int((world.clearance_m[at[:, 1], at[:, 0]] <= 0).argmax())
        )
        yield f"after {times[first]:g} s it is in rock, at {way[first].tolist()}"
        return
    noise = np.array([TERRAIN.get(g.name, (1.0, 0.0))[1] if task.terrain else 0.0 for g in world.grounds])
    zones, speed = world.zones_at(way[:, 0]), top_speed_mps(world, task, way[:, 0])
    fastest = np.maximum(speed[1:], speed[:-1])
    spread = np.maximum(noise[zones[1:]], noise[zones[:-1]]) * np.sqrt(np.diff(times) * task.control_s)
    far = np.linalg.norm(np.diff(way, axis=0), axis=1)
    most = fastest * np.diff(times) + _NOISE_S * spread + _ROUND_M
    if (far > most).any():
        k = int((far - most).argmax())
        yield f"from {times[k]:g} to {times[k + 1]:g} s it goes {far[k]:.2f} m, a robot {most[k]:.2f} m"
    if not far.sum() - _ROUND_M * len(far) <= episode.path_m <= 1.1 * task.max_forward_mps * times[-1] + 1:
        yield f"a way of {episode.path_m} m in {times[-1]:g} s, its samples lie {far.sum():.1f} m apart"
    yield from _out_of_sight(way, seen, env)


def _out_of_sight(way: np.ndarray, seen: np.ndarray, env: MineVectorEnv) -> Iterator[str]:
    """Say when more cells are claimed than lie within the beams' range of the way so far."""
    grid, task = env.explorers.grid, env.task
    row, col = np.nonzero(grid.reachable)
    cells = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
    between = task.max_forward_mps * SAMPLE_STEPS * task.control_s / 2
    reach = task.range_m[1] + between + grid.cell_m / np.sqrt(2)
    near = np.zeros(len(cells), dtype=bool)
    for k, place in enumerate(way):
        near |= np.linalg.norm(cells - place, axis=1) <= reach
        if seen[k] > near.sum():
            yield f"{seen[k]} cells seen, only {near.sum()} lie within {reach:.1f} m of its way until then"
            return


def _faults_of_return(head: Head, episode: Episode, seen: np.ndarray) -> Iterator[str]:
    new, useful = int(seen[-1] - seen[0]), episode.steps - episode.idle
    if episode.idle > episode.steps or episode.collided > episode.steps:
        yield f"{episode.idle} idle and {episode.collided} colliding steps of {episode.steps}"
        return
    growing = int((np.diff(seen) > 0).sum())
    if not growing <= useful <= new:
        yield f"{useful} steps saw something new, {new} cells are new, in {growing} of its samples"
    bonus = sum(b for share, b in MILESTONES if seen[0] < share * head.cells <= seen[-1])
    want = new * COVERAGE_GAIN / head.cells - episode.idle * IDLE_PENALTY + bonus - episode.collided * COLLISION_PENALTY
    if episode.returned > CAP:
        yield f"return {episode.returned}, the equation allows {CAP}"
    if abs(want - episode.returned) > _RETURN:
        yield f"return {episode.returned}, its cells, steps and collisions make {want:.4f}"


def _drive_again(path: Path, head: Head, episodes: list[Episode], count: int) -> None:
    seeds = head.seeds[:count]
    env = make_env(head.env, len(seeds))
    checkpoint = path.with_name(f"{head.policy}.safetensors")
    policy = make_policy(str(checkpoint) if checkpoint.is_file() else head.policy, len(seeds), env.task)
    if policy_sha256(policy) != head.policy_sha256:
        raise RejectedError(
            f"{path}: policy {head.policy} is {policy_sha256(policy)[:12]} here, not {head.policy_sha256[:12]}"
        )
    found = list(run_episodes(env, policy, seeds, lambda n: None))
    env.close()
    short = head.model_copy(update={"seeds": seeds})
    if chain(short, found) != chain(short, episodes[: len(seeds)]):
        bare = [[e.model_copy(update={"previous": ""}) for e in some] for some in (found, episodes)]
        differs = next(ours.seed for ours, theirs in zip(*bare, strict=False) if ours != theirs)
        raise RejectedError(f"{path}: seed {differs}: driven again it does not come out the same")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.score", description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    parser.add_argument("--rerun", type=int, default=0, metavar="N", help="drive the first N episodes again")
    arguments = parser.parse_args()
    for path in arguments.results:
        score(path, arguments.rerun)
        print_table(path)


if __name__ == "__main__":
    sys.exit(run_command("score", main))
