"""Each robot's own map, sampled by bearing and distance around the robot, as an addition to its observation."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from baselines.base.beams import beam_bearings, beam_ranges
from minexplore.task import TaskParams

RINGS_M = (0.0, 4.0, 8.0, 12.0, 20.0, 32.0, 50.0)  # edges; five times the range of a beam
_ALONG, _ACROSS = 4, 3  # sample points of a sector
_SEEN_M, _ROCK_M = 2.0, 1.0  # cell sizes
_CELLS = 512  # a map repeats after 1,024 m of seen cells and 512 m of rock
_LAYERS, _LAYER_M = 4, 3.0  # a map repeats after 12 m of height; passages over each other are 4 m apart
_BESIDE_M = (
    1.0  # beams enter the layers at this height under and over a robot as well: it drives into one that it knows
)
_SAMPLE_M = 0.9  # between points along a beam

Grid = tuple[np.ndarray, np.ndarray]  # rows and columns, wrapped


class MapObserver:
    """The maps of n robots; `observe` adds an observation to them and returns the patch around each robot.

    The maps use only the paper's observation and the robot's true pose, in training and in evaluation. They have layers
    of height, of which a patch shows the robot's own; a level mine has one. A patch is divided into sectors in the
    robot's frame, one for each beam's bearing and each ring. For each sector it holds the share that beams have passed,
    the share that is rock, and the share that the robot has driven through. Sectors and beams have the same bearings,
    so the range of a beam and what is already seen in its direction can be compared.
    """

    def __init__(self, count: int, task: TaskParams) -> None:
        """Start with empty maps."""
        self._far = task.range_m[1]
        self._task, self._beams = task, beam_bearings(task)
        self.seen, self.rock, self.driven = (np.zeros((count, _LAYERS, _CELLS, _CELLS), dtype=bool) for _ in range(3))
        rings = pairwise(RINGS_M)
        radius = np.array([inner + (outer - inner) * (np.arange(_ALONG) + 0.5) / _ALONG for inner, outer in rings])
        aside = 2 * np.pi / task.beams * ((np.arange(_ACROSS) + 0.5) / _ACROSS - 0.5)
        bearing, radius = np.broadcast_arrays(
            self._beams[:, None, None, None] + aside[:, None], radius[None, :, None, :]
        )
        self._points = np.stack([radius * np.cos(bearing), radius * np.sin(bearing)], axis=-1).reshape(-1, 2)
        self.size = 3 * task.beams * (len(RINGS_M) - 1)

    def forget(self, robots: np.ndarray) -> None:
        """Empty the maps of robots (k,)."""
        for grid in (self.seen, self.rock, self.driven):
            grid[robots] = False

    def observe(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Add one observation of every robot to its map and return the patches.

        Parameters
        ----------
        observation : (n, features) float32
        info : dict
            `pose_m_rad` (n, 3): x, y, m, and yaw, rad, in the mine frame; `height_m` (n,) in a mine with heights.

        Returns
        -------
        (n, 3 * beams * rings) float32
            Shares in [0, 1]: seen, rock, driven; in each by bearing, then by ring.
        """
        poses = info["pose_m_rad"]
        robots = np.arange(len(poses))[:, None]
        height = info.get("height_m", np.zeros(len(poses)))[:, None]
        layers = _layers(height + np.array([-_BESIDE_M, 0.0, _BESIDE_M]))  # (n, 3)
        own, of, into = _layers(height), robots[..., None, None], layers[..., None, None]
        ranges = beam_ranges(observation, self._task)
        bearing = poses[:, 2:3] + self._beams
        along = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)  # (n, beams, 2)
        steps = np.arange(0.0, self._far + _SAMPLE_M, _SAMPLE_M)
        reach = np.minimum(steps, ranges[..., None])  # the last point of a beam is its end
        points = poses[:, None, None, :2] + along[:, :, None, :] * reach[..., None]
        row, col = _cells(points, _SEEN_M)
        self.seen[of, into, row[:, None], col[:, None]] = True
        hit = ranges < self._far - 0.1
        robot, beam = np.nonzero(hit)
        ends = poses[robot, :2] + along[robot, beam] * ranges[robot, beam, None]
        row, col = _cells(ends, _ROCK_M)
        self.rock[robot[:, None], layers[robot], row[:, None], col[:, None]] = True
        row, col = _cells(poses[:, :2], _SEEN_M)
        self.driven[robots, layers, row[:, None], col[:, None]] = True
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        turn = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=1)
        places = poses[:, None, :2] + np.einsum("nij,pj->npi", turn, self._points)
        shares = [
            grid[robots, own, *_cells(places, cell)].reshape(len(poses), -1, _ALONG * _ACROSS).mean(axis=-1)
            for grid, cell in ((self.seen, _SEEN_M), (self.rock, _ROCK_M), (self.driven, _SEEN_M))
        ]
        return np.concatenate(shares, axis=1).astype(np.float32)


def _cells(places: np.ndarray, cell_m: float) -> Grid:
    at = np.floor(places / cell_m).astype(int) % _CELLS
    return at[..., 1], at[..., 0]


def _layers(heights: np.ndarray) -> np.ndarray:
    return np.floor(heights / _LAYER_M).astype(int) % _LAYERS
