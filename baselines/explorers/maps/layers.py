"""A robot's own map of a mine with heights: layers by the robot's height, and rock only where it cannot be a floor.

Passages that pass over each other are metres apart in height, so a robot that maps them in layers never merges them. A
beam that ends ahead may have met rock, or a floor that rises: from its sensor's height a robot cannot tell them apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from baselines.explorers.maps.own_map import FINE, FREE, ROCK, UNKNOWN, OwnMap

LAYER_M = 1.5  # of height from layer to layer
_HELD_M = 1.95  # a layer holds floors so near to its level: passages over each other are 4 m apart, and one is not held
OWN_M = 1.1  # a layer's own floors are so near to its level; the others are there for the rock beside its own
_LINKED = 2  # layers so near in number can hold the same floor
# A floor that rises by 20 deg ends a beam at 1.4 m: nearer ends are rock. A drift's floor is level across it, so beside
# the way that a robot drives its floor is known as far as walls may be.
_SURE_M, _ACROSS_M = 1.4, 5.0
_MOVING_M = 0.05  # in a control step
_STEP_M, _HEAD_M = 0.25, 1.0  # lower than this over the floor a beam's end is floor, higher than this it is roof


@dataclass(frozen=True)
class Stance:
    """Where a robot stands: place (2,) m, height m, and its axes ahead and to the left (2, 3), mine frame.

    `across_m` is how far to its sides its plane is the floor.
    """

    place: np.ndarray
    height_m: float
    axes: np.ndarray
    across_m: float = _SURE_M

    @property
    def slope(self) -> np.ndarray:
        """Return the rise (2,) per metre east and north of the plane that the robot stands on."""
        normal = np.cross(self.axes[0], self.axes[1])
        return -normal[:2] / normal[2]


def stances_of(info: dict[str, Any]) -> Iterator[Stance]:
    """Yield the stance of each robot by `pose_m_rad`, `height_m`, `pitch_rad` and `roll_rad` of an info."""
    for (x, y, yaw), height, pitch, roll in zip(
        info["pose_m_rad"], info["height_m"], info["pitch_rad"], info["roll_rad"], strict=True
    ):
        ahead = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        level = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        share = np.sin(roll) / np.cos(pitch)
        left = np.sqrt(1 - share**2) * level + share * np.cross(ahead, level)
        yield Stance(np.array([x, y]), float(height), np.stack([ahead, left]))


class LayerMap(OwnMap):
    """One layer: a map of what is near its level, and how high the floor of its cells is.

    `height_m[i, j]` is the floor of a coverage cell, by the robot that was nearest to it, else NaN. `ground_m` is
    the same of fine cells that a robot has been near to. `unsure` is rock that may be a floor that rises.
    """

    def __init__(self, cell_m: float, level_m: float) -> None:
        """Start with an empty map of a level."""
        super().__init__(cell_m)
        self.level_m = level_m
        self.height_m, self._apart_m = np.zeros((0, 0)), np.zeros((0, 0))
        self.ground_m, self._beside_m = np.zeros((0, 0)), np.zeros((0, 0))
        self.unsure, self._doubted = np.zeros((0, 0), dtype=bool), np.zeros((0, 0), dtype=bool)

    def add_scan(self, stance: Stance, bearings: np.ndarray, ranges: np.ndarray, sensor_m: float, far_m: float) -> None:
        """Add beams of a robot at bearings (k,) rad from ahead; `sensor_m` is the height at which they start."""
        along = np.cos(bearings)[:, None] * stance.axes[0] + np.sin(bearings)[:, None] * stance.axes[1]
        ends = stance.place + along[:, :2] * ranges[:, None]
        self._grow_to(np.vstack([ends, stance.place]))
        self._note_floor(stance, float(ranges.max()) + self.cell_m)
        steps = np.arange(0.0, far_m, self.fine_m / 2)
        reach = np.minimum(steps, np.maximum(ranges - self.fine_m / 4, 0.0)[:, None])
        held = self._holds(stance.height_m + along[:, None, 2] * reach)
        row, col = self.at((stance.place + along[:, None, :2] * reach[..., None])[held], self.fine_m)
        self.seen[row // FINE, col // FINE] = True
        self.fine[row, col] = np.where(self.fine[row, col] == ROCK, ROCK, FREE)
        hit = (ranges < far_m - 0.05) & self._holds(stance.height_m + along[:, 2] * ranges)
        row, col = self.at((ends + along[:, :2] * (self.fine_m / 4))[hit], self.fine_m)
        above = stance.height_m + sensor_m + along[hit, 2] * ranges[hit] - self.ground_m[row, col]
        known = np.isfinite(above)
        sure = np.where(known, (above > _STEP_M) & (above < _HEAD_M), ranges[hit] < _SURE_M)
        far = ~known & ~sure & (self.fine[row, col] != ROCK) & ~self._doubted[row, col]
        self.fine[row[far], col[far]], self.unsure[row[far], col[far]] = ROCK, True
        self.fine[row[sure], col[sure]], self.unsure[row[sure], col[sure]] = ROCK, False

    def _holds(self, heights: np.ndarray) -> np.ndarray:
        """Return which heights, m, of a floor the layer holds."""
        return np.abs(heights - self.level_m) < _HELD_M

    def doubt(self) -> bool:
        """Forget the rock that is unsure, until a robot is beside it; return whether there was any."""
        if not self.unsure.any():
            return False
        self.fine[self.unsure] = UNKNOWN
        self._doubted |= binary_dilation(self.unsure, np.ones((3, 3)))
        self.unsure[:] = False
        return True

    def _note_floor(self, stance: Stance, reach_m: float) -> None:
        """Take the plane on which a robot stands as the floor of what is nearest to it yet."""
        self._take_plane(stance, self.height_m, self._apart_m, self.cell_m, reach_m, reach_m)
        self._take_plane(stance, self.ground_m, self._beside_m, self.fine_m, _SURE_M, stance.across_m)

    def _take_plane(
        self,
        stance: Stance,
        heights: np.ndarray,
        apart_m: np.ndarray,
        cell_m: float,
        along_m: float,
        across_m: float,
    ) -> None:
        """Write the plane's heights into the cells so far along and across the heading, where no robot was nearer."""
        row, col = (int(v[0]) for v in self.at(stance.place[None], cell_m))
        reach = int(np.ceil(max(along_m, across_m) / cell_m))
        (first, end), (left, right) = (
            (max(at - reach, 0), min(at + reach + 1, size)) for at, size in zip((row, col), heights.shape, strict=True)
        )
        window = (slice(first, end), slice(left, right))
        low = self.low * round(self.cell_m / cell_m)
        east = (np.arange(left, right) + low[0] + 0.5) * cell_m - stance.place[0]
        north = ((np.arange(first, end) + low[1] + 0.5) * cell_m - stance.place[1])[:, None]
        away = np.hypot(east, north)
        plane = stance.height_m + stance.slope[0] * east + stance.slope[1] * north
        (ahead_x, ahead_y), (left_x, left_y) = stance.axes[:, :2]
        inside = (np.abs(ahead_x * east + ahead_y * north) <= along_m) & (
            np.abs(left_x * east + left_y * north) <= across_m
        )
        nearer = inside & (away <= apart_m[window])
        heights[window] = np.where(nearer, plane, heights[window])
        apart_m[window] = np.where(nearer, away, apart_m[window])

    def _grow_to(self, places: np.ndarray) -> None:
        before, held = self.low, self.seen.size
        super()._grow_to(places)
        for name, factor, empty in (
            ("height_m", 1, np.nan),
            ("_apart_m", 1, np.inf),
            ("ground_m", FINE, np.nan),
            ("_beside_m", FINE, np.inf),
            ("unsure", FINE, False),
            ("_doubted", FINE, False),
        ):
            old = getattr(self, name)
            shape = tuple(factor * size for size in self.seen.shape)
            if old.shape == shape:
                continue
            new = np.full(shape, empty, dtype=old.dtype)
            col, row = (before - self.low) * factor if held else (0, 0)
            new[row : row + old.shape[0], col : col + old.shape[1]] = old
            setattr(self, name, new)

    def floor_of(self, cells: np.ndarray) -> np.ndarray:
        """Return the floor (k,) m of coverage cells (k, 2), column and row from the mine frame's origin, else NaN."""
        col, row = (np.asarray(cells).reshape(-1, 2) - self.low).T
        inside = (row >= 0) & (col >= 0) & (row < self.seen.shape[0]) & (col < self.seen.shape[1])
        found = np.full(len(row), np.nan)
        found[inside] = self.height_m[row[inside], col[inside]]
        return found

    def has_seen(self, cells: np.ndarray) -> np.ndarray:
        """Return which coverage cells (k, 2), column and row from the mine frame's origin, are seen."""
        col, row = (np.asarray(cells).reshape(-1, 2) - self.low).T
        inside = (row >= 0) & (col >= 0) & (row < self.seen.shape[0]) & (col < self.seen.shape[1])
        found = np.zeros(len(row), dtype=bool)
        found[inside] = self.seen[row[inside], col[inside]]
        return found


class LayeredMap:
    """A map by layers; `layer_of` has the layer that each robot is in. Heights count from the first robot's start."""

    def __init__(self, cell_m: float) -> None:
        """Start with no layer."""
        self.layers: dict[int, LayerMap] = {}
        self.layer_of: dict[int, int] = {}
        self._cell_m = cell_m
        self._start_m: float | None = None
        self._last: dict[int, np.ndarray] = {}  # each robot's place

    def add_scan(
        self,
        stance: Stance,
        bearings: np.ndarray,
        ranges: np.ndarray,
        sensor_m: float,
        far_m: float,
        robot: int = 0,
    ) -> None:
        """Add beams to the layers that hold the floor where the robot is; see `LayerMap.add_scan`."""
        self._start_m = stance.height_m if self._start_m is None else self._start_m
        moved = stance.place - self._last.get(robot, stance.place)
        self._last[robot] = stance.place
        if abs(moved @ stance.axes[0, :2]) > _MOVING_M:
            stance = replace(stance, across_m=_ACROSS_M)
        layer = self.layer_of[robot] = round((stance.height_m - self._start_m) / LAYER_M)
        for number in range(layer - _LINKED, layer + _LINKED + 1):
            level_m = self._start_m + number * LAYER_M
            if number != layer and abs(stance.height_m - level_m) >= _HELD_M:
                continue
            if number not in self.layers:
                self.layers[number] = LayerMap(self._cell_m, level_m)
            self.layers[number].add_scan(stance, bearings, ranges, sensor_m, far_m)

    def doubt(self, layers: Iterable[int]) -> bool:
        """Forget the rock of layers that may be a floor that rises; return whether there was any."""
        return any([self.layers[number].doubt() for number in layers])

    def beside(self, layer: int) -> list[int]:
        """Return the numbers of the other layers that can hold the same floors as one."""
        return [number for number in sorted(self.layers) if 0 < abs(number - layer) <= _LINKED]

    def near_robots(self) -> set[int]:
        """Return the numbers of the layers that robots are in, and of those beside them."""
        return {number for layer in self.layer_of.values() for number in (layer, *self.beside(layer))}

    def has_own_floor(self, layer: int) -> np.ndarray:
        """Return which coverage cells (rows, cols) of a layer have its own floors."""
        own = self.layers[layer]
        with np.errstate(invalid="ignore"):
            return np.abs(own.height_m - own.level_m) < OWN_M

    def seen_elsewhere(self, layer: int, cells: np.ndarray) -> np.ndarray:
        """Return which coverage cells (k, 2) of a layer another layer has seen, at about the same height."""
        found = np.zeros(len(cells), dtype=bool)
        floor = self.layers[layer].floor_of(cells)
        for other in self.beside(layer):
            near = np.abs(self.layers[other].floor_of(cells) - floor) < OWN_M
            found |= near & self.layers[other].has_seen(cells)
        return found
