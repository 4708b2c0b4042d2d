"""Where an episode begins, and the seed of its noise, as `reset(options=...)` states them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from minexplore.bundle import TOPOLOGY
from minexplore.world import World

_PLACES = ("pose", "cell", "station")  # options of which an episode takes at most one


@dataclass(frozen=True)
class EpisodeStart:
    """What options of a reset fix; None is drawn as without them.

    `place_m` is (x, y) or (x, y, z), m, mine frame, and `yaw_rad` counter-clockwise from east. `goal` is a place of
    `minexplore.tasks.ways.Ways`.
    """

    place_m: tuple[float, ...] | None = None
    yaw_rad: float | None = None
    noise_seed: int | None = None
    goal: int | None = None

    def pose(self, drawn: list[float], robot: int, rng: np.random.Generator) -> list[float]:
        """Return x, y, yaw and, where it is fixed, z; robot i goes on with random numbers of `noise_seed + i`."""
        x, y, yaw, *z = drawn
        if self.place_m is not None:
            x, y, *z = self.place_m
        if self.noise_seed is not None:
            rng.bit_generator.state = np.random.PCG64(self.noise_seed + robot).state
        return [x, y, yaw if self.yaw_rad is None else self.yaw_rad, *z]


def source_of(rng: np.random.Generator, robot: int, start: EpisodeStart | None) -> np.random.Generator:
    """Return what a robot's sensors take their random numbers from: its own, or those that its start fixes."""
    fixed = start is not None and start.noise_seed is not None
    return np.random.default_rng(start.noise_seed + robot) if fixed else rng  # type: ignore[union-attr, operator]


def start_of(options: Mapping[str, Any] | None, world: World, radius_m: float) -> EpisodeStart | None:
    """Return where options of a reset let episodes begin, or None if they do not say.

    Raises
    ------
    ValueError
        If a value is none of its kind, several places are given, or the robot does not fit there.
    """
    asked = {name: value for name, value in (options or {}).items() if name in (*_PLACES, "noise_seed")}
    if not asked:
        return None
    seed = asked.get("noise_seed")
    if seed is not None and (not isinstance(seed, int | np.integer) or isinstance(seed, bool) or seed < 0):
        raise ValueError(f"options: noise_seed = {seed!r:.80}: want a whole number of 0 or more")
    given = [name for name in _PLACES if name in asked]
    if len(given) > 1:
        raise ValueError(f"options: {given[0]} and {given[1]}: want one of {', '.join(_PLACES)}")
    noise_seed = None if seed is None else int(seed)
    if not given:
        return EpisodeStart(noise_seed=noise_seed)
    name, value = given[0], asked[given[0]]
    place, yaw = _READERS[name](world, value)
    _require_room(name, value, place, world, radius_m)
    return EpisodeStart(place, yaw, noise_seed)


def _pose_of(world: World, value: Any) -> tuple[tuple[float, ...], float | None]:
    x, y, yaw, *z = _numbers("pose", value, (3, 4) if world.has_heights else (3,), "x, y, yaw, m and rad, mine frame")
    return (x, y, *z), yaw


def _cell_of(world: World, value: Any) -> tuple[tuple[float, ...], float | None]:
    row, column = _numbers("cell", value, (2,), "row and column of World.clearance_m")
    rows, columns = world.clearance_m.shape
    if row % 1 or column % 1 or not (0 <= row < rows and 0 <= column < columns):
        raise ValueError(f"options: cell = {value!r:.80}: want whole numbers below {rows} and {columns}")
    x, y = world.origin_m + (np.array([column, row]) + 0.5) * world.cell_m
    return (float(x), float(y)), None


def goal_of(world: World, value: Any) -> tuple[float, ...]:
    """Return the place (2,) or (3,) m, mine frame, of a goal: a station's name, or numbers.

    Raises
    ------
    ValueError
        If there is no such station, or the numbers are not those of a place.
    """
    if isinstance(value, str):
        return _station_of(world, value, "goal")[0]
    counts = (2, 3) if world.has_heights else (2,)
    return tuple(_numbers("goal", value, counts, "a station's name, or x and y, m, mine frame", 3))


def _station_of(world: World, value: Any, name: str = "station") -> tuple[tuple[float, ...], float | None]:
    nodes = json.loads(world.read(TOPOLOGY))["nodes_m"]
    if not isinstance(value, str) or value not in nodes:
        known = ", ".join(list(nodes)[:5])
        raise ValueError(f"options: {name} = {value!r:.80}: want one of {known}, ... ({len(nodes)})")
    return tuple(map(float, nodes[value])), None


_READERS = {"pose": _pose_of, "cell": _cell_of, "station": _station_of}


def _numbers(name: str, value: Any, counts: tuple[int, ...], want: str, with_height: int = 4) -> list[float]:
    """Return finite numbers, as many as one of `counts`."""
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.ndim != 1 or len(found) not in counts or not np.isfinite(found).all():
        more = ", and in a volume z, m" if with_height in counts else ""
        raise ValueError(f"options: {name} = {value!r:.80}: want {want}{more}")
    return [float(number) for number in found]


def _require_room(name: str, value: Any, place_m: tuple[float, ...], world: World, radius_m: float) -> None:
    """Refuse a place in rock, or nearer to it than the robot is wide."""
    column, row = np.floor((np.array(place_m[:2]) - world.origin_m) / world.cell_m).astype(int).tolist()
    rows, columns = world.clearance_m.shape
    clear_m = float(world.clearance_m[row, column]) if 0 <= row < rows and 0 <= column < columns else 0.0
    if clear_m < radius_m:
        raise ValueError(
            f"options: {name} = {value!r:.80}: {clear_m:.2f} m from rock; the robot needs {radius_m:g} m, as in "
            f"World.places_m({radius_m:g})"
        )
