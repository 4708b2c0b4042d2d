"""What an honest results file must obey: the environment's facts, the seeds, what is in sight, the reward."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from baselines.protocol import params_facts, seeds_of
from baselines.reference import Reference
from baselines.result_file import Episode, Head
from baselines.sight import Sight
from baselines.statistics import sample_count, sample_times
from baselines.way import Way, spare_m, way_faults, way_of
from minexplore.reward import CAP, COLLISION_PENALTY, COVERAGE_GAIN, IDLE_PENALTY, MILESTONES
from minexplore.vector import MineVectorEnv

_RETURN_TOLERANCE = 1e-5  # a return is written with six decimals
# With noise in beams and floors, honest episodes along the same path mostly differ in a fourteenth or more of these
# samples. Robots of one place that soon stand still at the same rock may agree in fewer. Two known tours of the
# entrance agreed in all 49, 0.9 m apart.
_TELLING_SAMPLES = 10
_BESIDE_CM = 50

Bound = Callable[[float], int]


def file_faults(head: Head, episodes: list[Episode], env: MineVectorEnv) -> Iterator[str]:
    """Yield what in a file contradicts its environment or the protocol."""
    world = env.world.record["world_sha256"]
    if head.world_sha256 != world:
        yield f"world {head.world_sha256[:12]} is not {head.env}'s, {world[:12]}"
    yield from _params_faults(f"the task is not {head.env}'s", head.task, params_facts(env.task))
    yield from _params_faults(f"the robot is not {head.env}'s", head.robot, params_facts(env.robot))
    if head.cells != env.robots.grid.total:
        yield f"{head.cells} reachable cells, the world has {env.robots.grid.total}"
    yield from _seed_faults(head.seeds, seeds_of(head.env))
    yield from _repeated_faults(episodes)


def _repeated_faults(episodes: list[Episode]) -> Iterator[str]:
    """Yield episodes that repeat another one: the same way, or one beside it with the same new cells."""
    ways: dict[object, int] = {}
    curves: dict[object, list[Episode]] = {}
    for episode in episodes:
        same = ways.setdefault(tuple(episode.path_cm), episode.seed)
        if same != episode.seed and len(set(episode.path_cm)) >= _TELLING_SAMPLES:
            yield f"seeds {same} and {episode.seed} drive the same way"
        gains = np.diff(episode.seen)[1:]
        if (gains > 0).sum() < _TELLING_SAMPLES:
            continue
        alike = curves.setdefault(tuple(gains.tolist()), [])
        for other in alike:
            apart = np.subtract(episode.path_cm, other.path_cm) if len(episode.path_cm) == len(other.path_cm) else None
            if apart is not None and np.abs(apart).max() < _BESIDE_CM:
                yield f"seeds {other.seed} and {episode.seed} see the same number of new cells at every time"
        alike.append(episode)


def _seed_faults(seeds: list[int], wanted: tuple[int, ...]) -> Iterator[str]:
    missing, extra = sorted(set(wanted) - set(seeds)), sorted(set(seeds) - set(wanted))
    protocol = f"the protocol's are {wanted[0]} to {wanted[-1]}"
    if len(set(seeds)) < len(seeds):
        yield f"a seed comes twice; {protocol}, each once"
    elif missing or extra:
        yield f"seeds: {protocol}; missing {missing or 'none'}, extra {extra or 'none'}"
    elif seeds != list(wanted):
        yield f"seeds: {protocol}, in this order"


def _params_faults(message: str, claimed: dict[str, Any], true: dict[str, Any]) -> Iterator[str]:
    changed = [k for k in true if claimed.get(k) != true[k]] or [k for k in claimed if k not in true]
    if changed:
        yield f"{message}: {changed[0]} = {claimed.get(changed[0])}, it is {true.get(changed[0])}"


def episode_faults(episode: Episode, number: int, reference: Reference, bound: Bound | None) -> Iterator[str]:
    """Yield why an episode is impossible; `number` is the place of its seed among the protocol's."""
    env = reference.env
    if episode.steps > env.task.max_steps:
        yield f"{episode.steps} steps, an episode has at most {env.task.max_steps}"
        return
    samples = sample_count(episode.steps)
    if not samples == len(episode.seen) == len(episode.path_cm):
        yield (
            f"{len(episode.seen)} samples of coverage, {len(episode.path_cm)} places; "
            f"{episode.steps} steps have {samples}"
        )
        return
    seen, way = np.array(episode.seen), way_of(episode, reference)
    yield from _coverage_faults(episode, seen, number, reference, bound)
    yield from _return_faults(episode, seen, way, env.robots.grid.total)
    faults = list(way_faults(episode, way, number, reference))
    yield from faults
    if not faults:
        yield from _sight_faults(episode, seen, way, reference.sight)


def _coverage_faults(
    episode: Episode, seen: np.ndarray, number: int, reference: Reference, bound: Bound | None
) -> Iterator[str]:
    first, total = int(reference.first_seen[number]), reference.env.robots.grid.total
    if (np.diff(seen) < 0).any():
        yield "coverage falls"
    if seen[0] != first:
        yield f"it begins with {seen[0]} cells seen, the environment gives this seed {first}"
    if seen.max() > total:
        yield f"{seen.max()} cells seen of {total}"
    times = sample_times(episode, reference.env.task.control_s)
    for time_s, cells in zip(times.tolist(), seen.tolist(), strict=True):
        if bound is not None and cells > bound(time_s):
            yield f"{cells} cells after {time_s:g} s, no robot can have seen more than {bound(time_s)}"
            return


def _sight_faults(episode: Episode, seen: np.ndarray, way: Way, sight: Sight) -> Iterator[str]:
    """Yield a sample that claims more cells than were in line of sight of the way: so far, since the last, or after."""
    driven = way.most_m.clip(max=way.moved_m + spare_m(episode, way))
    in_view = np.zeros((len(way.moved_m), sight.total), dtype=bool)
    so_far = np.zeros(sight.total, dtype=bool)
    for k, (start, end) in enumerate(zip(way.places_m[:-1], way.places_m[1:], strict=True)):
        in_view[k] = sight.cells_between(start, end, float(driven[k]))
        so_far |= in_view[k]
        most, now, new = int(so_far.sum()), int(seen[k + 1]), int(seen[k + 1] - seen[k])
        if now > most:
            yield f"{now} cells seen after {way.times_s[k + 1]:g} s, only {most} were in sight of its way so far"
            return
        if new > in_view[k].sum():
            times = f"from {way.times_s[k]:g} to {way.times_s[k + 1]:g} s"
            yield f"{new} new cells {times}, only {in_view[k].sum()} were in sight"
            return
    after = np.logical_or.accumulate(in_view[::-1])[::-1].sum(axis=1)
    late = seen[-1] - seen[:-1] > after
    if late.any():
        k = int(late.argmax())
        yield f"{seen[-1] - seen[k]} new cells after {way.times_s[k]:g} s, only {after[k]} were in sight from then on"


def _return_faults(episode: Episode, seen: np.ndarray, way: Way, total: int) -> Iterator[str]:
    """Yield figures that disagree with each other: new cells, steps that saw one, collisions, and the return."""
    if episode.idle > episode.steps or episode.collided > episode.steps:
        yield f"{episode.idle} idle and {episode.collided} colliding steps of {episode.steps}"
        return
    gains, useful = np.diff(seen), episode.steps - episode.idle
    least, most = int((gains > 0).sum()), int(np.minimum(gains, way.steps).sum())
    if not least <= useful <= most:
        yield f"{useful} steps saw a new cell: {gains.sum()} new cells at their times take {least} to {most} steps"
    bonus = sum(b for share, b in MILESTONES if seen[0] < share * total <= seen[-1])
    want = int(gains.sum()) * COVERAGE_GAIN / total - episode.idle * IDLE_PENALTY + bonus
    want -= episode.collided * COLLISION_PENALTY
    if episode.returned > CAP:
        yield f"return {episode.returned}, the reward allows at most {CAP}"
    if abs(want - episode.returned) > _RETURN_TOLERANCE:
        yield f"return {episode.returned}, its cells, steps and collisions give {want:.4f}"
