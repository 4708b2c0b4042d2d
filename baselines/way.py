"""What a robot's recorded way must obey: its start, the rock, its speed, and where it can have touched the walls."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from baselines.reference import Reference
from baselines.result_file import SAMPLE_STEPS, Episode
from baselines.speed import noise_mps, top_speed_mps
from baselines.statistics import sample_times

_NOISE_SD = 5.0  # standard deviations that the noise of mud and water may add to a distance
_ROUNDING_M = 0.0071  # of a place written in centimetres
_INTO_ROCK_M = 0.03  # that the disc may press into rock; results have 0.012 m at most
_TOUCHING_M = 0.01  # a disc that is this deep in rock touches it, whatever the rounding
_SETTLING_M = 0.02  # that a robot at rest may move beside its stall speed


@dataclass(frozen=True)
class Way:
    """Times (n,) s and places (n, 2) m of an episode's samples, and what lies between each two of them (n - 1,).

    `moved_m` is the straight distance and `most_m` the longest path that the robot can have driven.
    """

    times_s: np.ndarray
    places_m: np.ndarray
    steps: np.ndarray
    moved_m: np.ndarray
    most_m: np.ndarray


def way_of(episode: Episode, reference: Reference) -> Way:
    """Return an episode's way."""
    task, world = reference.env.task, reference.env.world
    times, places = sample_times(episode, task.control_s), np.array(episode.path_cm) / 100
    steps, span = np.rint(np.diff(times) / task.control_s).astype(int), np.diff(times)
    reach = task.max_forward_mps * SAMPLE_STEPS * task.control_s  # a robot may leave its zone between two samples
    east = np.stack([places[:-1, 0] - reach, places[:-1, 0], places[1:, 0], places[1:, 0] + reach])
    speed, noise = (f(world, task, east.ravel()).reshape(east.shape).max(axis=0) for f in (top_speed_mps, noise_mps))
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    most = speed * span + _NOISE_SD * noise * np.sqrt(span * task.control_s) + 2 * _ROUNDING_M
    return Way(times, places, steps, moved, most)


def way_faults(episode: Episode, way: Way, number: int, reference: Reference) -> Iterator[str]:
    """Yield why no robot can have driven a way; `number` is the place of its seed among the protocol's."""
    start = reference.starts_cm[number].tolist()
    if list(episode.path_cm[0]) != start:
        yield f"it begins at {list(episode.path_cm[0])} cm, the environment starts this seed at {start} cm"
    outside = reference.rock.outside(way.places_m)
    if outside.any():
        first = int(outside.argmax())
        yield f"after {way.times_s[first]:g} s it is beyond the map, at {way.places_m[first].tolist()}"
        return
    nearest = reference.rock.distances_m(way.places_m)
    radius = reference.env.robot.radius_m
    if (nearest < radius - _INTO_ROCK_M).any():
        first = int((nearest < radius - _INTO_ROCK_M).argmax())
        at = way.places_m[first].tolist()
        yield (
            f"after {way.times_s[first]:g} s it is in rock: at {at} the rock is {nearest[first]:.2f} m away, "
            f"the robot's radius is {radius} m"
        )
        return
    yield from _speed_faults(episode, way)
    yield from _detour_faults(way, reference)
    yield from _end_faults(episode, way, reference)
    yield from _contact_faults(episode, way, nearest, reference)


def _speed_faults(episode: Episode, way: Way) -> Iterator[str]:
    over = way.moved_m - way.most_m
    if (over > 0).any():
        k = int(over.argmax())
        yield (
            f"from {way.times_s[k]:g} to {way.times_s[k + 1]:g} s it drives {way.moved_m[k]:.2f} m, "
            f"a robot at most {way.most_m[k]:.2f} m"
        )
    least, most = float((way.moved_m - 2 * _ROUNDING_M).clip(0).sum()), float(way.most_m.sum())
    if not least <= episode.path_m <= most:
        yield f"a path of {episode.path_m} m in {way.times_s[-1]:g} s: its samples allow {least:.1f} to {most:.1f} m"


def _detour_faults(way: Way, reference: Reference) -> Iterator[str]:
    """Yield a passage through rock: the way round it is longer than a robot can drive."""
    rock, places = reference.rock, way.places_m
    for k in np.flatnonzero(rock.blocked(places[:-1], places[1:])).tolist():
        around = rock.detour_m(places[k], places[k + 1], float(way.most_m[k]))
        if around > way.most_m[k]:
            yield (
                f"from {way.times_s[k]:g} to {way.times_s[k + 1]:g} s it passes through rock, "
                f"from {places[k].tolist()} to {places[k + 1].tolist()}"
            )
            return


def _end_faults(episode: Episode, way: Way, reference: Reference) -> Iterator[str]:
    """Yield an end before the horizon of a robot that did not stand still, as the task asks."""
    task = reference.env.task
    if episode.steps == task.max_steps:
        return
    last = way.times_s >= way.times_s[-1] - task.stall_steps * task.control_s + 1e-9
    apart = float(np.linalg.norm(way.places_m[last] - way.places_m[-1], axis=1).max())
    still = task.stall_speed_mps * task.stall_steps * task.control_s + _SETTLING_M
    if episode.steps < task.stall_steps or apart > still:
        yield f"it ends after {episode.steps} of {task.max_steps} steps without standing still"


def _contact_faults(episode: Episode, way: Way, nearest: np.ndarray, reference: Reference) -> Iterator[str]:
    """Yield a number of colliding steps that the distances (n,) m to the walls do not allow."""
    radius = reference.env.robot.radius_m
    least = int((nearest[:-1] < radius - _TOUCHING_M).sum())
    clear = (nearest - radius - _ROUNDING_M).clip(0)
    to_wall_and_back = clear[:-1] + clear[1:]
    touching = np.floor(way.steps * (1 - to_wall_and_back / way.most_m)) + 1
    touching[to_wall_and_back > way.moved_m + spare_m(episode, way) + 2 * _ROUNDING_M] = 0
    most = int(touching.clip(0, way.steps).sum())
    if not least <= episode.collided <= most:
        yield f"{episode.collided} colliding steps: by its distance to the walls it has {least} to {most}"


def spare_m(episode: Episode, way: Way) -> float:
    """Return how much further, m, the robot drove than straight from sample to sample, on its whole way."""
    return max(0.0, episode.path_m - float((way.moved_m - 2 * _ROUNDING_M).clip(0).sum()))
