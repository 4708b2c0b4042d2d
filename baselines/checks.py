"""What an honest results file must obey: the environment's facts, the robot's speed, its range, the reward's sum."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from baselines.protocol import params_facts
from baselines.result_file import SAMPLE_STEPS, Episode, Head
from baselines.speed import noise_mps, top_speed_mps
from baselines.statistics import sample_times
from minexplore.reward import CAP, COLLISION_PENALTY, COVERAGE_GAIN, IDLE_PENALTY, MILESTONES
from minexplore.vector import MineVectorEnv

_NOISE_SD = 5.0  # standard deviations that the noise of mud and water may add to a distance
_ROUNDING_M = 0.02  # of a place written in centimetres
_RETURN_TOLERANCE = 1e-3
_AT_REST_M = 0.1  # between samples of a robot that stands still
_PATH_FACTOR = 1.1  # of the commanded top speed; the dip and the noise add less over an episode

Bound = Callable[[float], int]


def head_faults(head: Head, env: MineVectorEnv) -> Iterator[str]:
    """Yield what in a head contradicts its environment."""
    world = env.world.record["world_sha256"]
    if head.world_sha256 != world:
        yield f"world {head.world_sha256[:12]} is not {head.env}'s, {world[:12]}"
    yield from _params_faults(f"the task is not {head.env}'s", head.task, params_facts(env.task))
    if head.robot:
        yield from _params_faults(f"the robot is not {head.env}'s", head.robot, params_facts(env.robot))
    if head.cells != env.robots.grid.total:
        yield f"{head.cells} reachable cells, the world has {env.robots.grid.total}"
    if len(set(head.seeds)) < len(head.seeds):
        yield "a seed comes twice"


def _params_faults(message: str, claimed: dict[str, Any], true: dict[str, Any]) -> Iterator[str]:
    changed = [k for k in true if claimed.get(k) != true[k]] or [k for k in claimed if k not in true]
    if changed:
        yield f"{message}: {changed[0]} = {claimed.get(changed[0])}, it is {true.get(changed[0])}"


def episode_faults(head: Head, episode: Episode, env: MineVectorEnv, bound: Bound | None) -> Iterator[str]:
    """Yield why an episode is impossible."""
    times, seen = sample_times(episode, env.task.control_s), np.array(episode.seen)
    if episode.steps > env.task.max_steps:
        yield f"{episode.steps} steps, an episode has at most {env.task.max_steps}"
    elif not len(times) == len(seen) == len(episode.path_cm):
        yield f"{len(seen)} samples of coverage, {len(episode.path_cm)} places; {episode.steps} steps have {len(times)}"
    else:
        yield from _coverage_faults(head, times, seen, bound)
        yield from _end_faults(episode, env)
        yield from _path_faults(episode, env, times, seen)
        yield from _return_faults(head, episode, seen)


def _coverage_faults(head: Head, times: np.ndarray, seen: np.ndarray, bound: Bound | None) -> Iterator[str]:
    if (np.diff(seen) < 0).any() or seen[0] < 1:
        yield "coverage falls"
    if seen.max() > head.cells:
        yield f"{seen.max()} cells seen of {head.cells}"
    for time_s, cells in zip(times.tolist(), seen.tolist(), strict=True):
        if bound is not None and cells > bound(time_s):
            yield f"{cells} cells after {time_s:g} s, no robot can have seen more than {bound(time_s)}"
            return


def _end_faults(episode: Episode, env: MineVectorEnv) -> Iterator[str]:
    task = env.task
    if episode.steps == task.max_steps:
        return
    samples = max(1, task.stall_steps // SAMPLE_STEPS - 1)
    moves = np.linalg.norm(np.diff(np.array(episode.path_cm) / 100, axis=0)[-samples:-1], axis=1)
    if episode.steps < task.stall_steps or moves.max(initial=0.0) > _AT_REST_M:
        yield f"it ends after {episode.steps} of {task.max_steps} steps without standing still"


def _path_faults(episode: Episode, env: MineVectorEnv, times: np.ndarray, seen: np.ndarray) -> Iterator[str]:
    spawn, places = env.world.record["spawn"], np.array(episode.path_cm) / 100
    from_spawn_m = float(np.linalg.norm(places[0] - spawn["anchor_m"]))
    if from_spawn_m > spawn["radius_m"] + _ROUNDING_M:
        yield f"it begins at {places[0].tolist()}, {from_spawn_m:.1f} m from the spawn"
    rock = _in_rock(places, env)
    if rock.any():
        first = int(rock.argmax())
        yield f"after {times[first]:g} s it is in rock, at {places[first].tolist()}"
        return
    yield from _speed_faults(episode, env, times, places)
    yield from _range_faults(places, seen, env)


def _in_rock(places: np.ndarray, env: MineVectorEnv) -> np.ndarray:
    """Return which places (n, 2) m lie in rock or outside the map."""
    world = env.world
    at = np.floor((places - world.origin_m) / world.cell_m).astype(int)
    inside = ((at >= 0) & (at < world.clearance_m.shape[::-1])).all(axis=1)
    at[~inside] = 0
    return ~inside | (world.clearance_m[at[:, 1], at[:, 0]] <= 0)


def _speed_faults(episode: Episode, env: MineVectorEnv, times: np.ndarray, places: np.ndarray) -> Iterator[str]:
    world, task = env.world, env.task
    speed, noise = top_speed_mps(world, task, places[:, 0]), noise_mps(world, task, places[:, 0])
    spread = np.maximum(noise[1:], noise[:-1]) * np.sqrt(np.diff(times) * task.control_s)
    limit = np.maximum(speed[1:], speed[:-1]) * np.diff(times) + _NOISE_SD * spread + _ROUNDING_M
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    if (moved > limit).any():
        k = int((moved - limit).argmax())
        yield f"from {times[k]:g} to {times[k + 1]:g} s it drives {moved[k]:.2f} m, a robot at most {limit[k]:.2f} m"
    longest = _PATH_FACTOR * task.max_forward_mps * times[-1] + 1
    if not moved.sum() - _ROUNDING_M * len(moved) <= episode.path_m <= longest:
        yield f"a path of {episode.path_m} m in {times[-1]:g} s, its samples lie {moved.sum():.1f} m apart"


def _range_faults(places: np.ndarray, seen: np.ndarray, env: MineVectorEnv) -> Iterator[str]:
    """Yield a sample that claims more cells than lie within the beams' range of the path so far."""
    grid, task = env.robots.grid, env.task
    row, col = np.nonzero(grid.reachable)
    cells = grid.origin_m + (np.column_stack([col, row]) + 0.5) * grid.cell_m
    between = task.max_forward_mps * SAMPLE_STEPS * task.control_s / 2
    reach = task.range_m[1] + between + grid.cell_m / np.sqrt(2)
    near = np.zeros(len(cells), dtype=bool)
    for k, place in enumerate(places):
        near |= np.linalg.norm(cells - place, axis=1) <= reach
        if seen[k] > near.sum():
            yield f"{seen[k]} cells seen, only {near.sum()} lie within {reach:.1f} m of its path so far"
            return


def _return_faults(head: Head, episode: Episode, seen: np.ndarray) -> Iterator[str]:
    new, useful = int(seen[-1] - seen[0]), episode.steps - episode.idle
    if episode.idle > episode.steps or episode.collided > episode.steps:
        yield f"{episode.idle} idle and {episode.collided} colliding steps of {episode.steps}"
        return
    growing = int((np.diff(seen) > 0).sum())
    if not growing <= useful <= new:
        yield f"{useful} steps saw a new cell, {new} cells are new, in {growing} of its samples"
    bonus = sum(b for share, b in MILESTONES if seen[0] < share * head.cells <= seen[-1])
    want = new * COVERAGE_GAIN / head.cells - episode.idle * IDLE_PENALTY + bonus - episode.collided * COLLISION_PENALTY
    if episode.returned > CAP:
        yield f"return {episode.returned}, the reward allows at most {CAP}"
    if abs(want - episode.returned) > _RETURN_TOLERANCE:
        yield f"return {episode.returned}, its cells, steps and collisions give {want:.4f}"
