"""A map of its own for every robot, and what it holds by bearing and distance, as the robot sees it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from minexplore.task import TaskParams

RINGS_M = (0.0, 4.0, 8.0, 12.0, 20.0, 32.0, 50.0)  # edges; five times as far as a beam reaches
_ALONG, _ACROSS = 4, 3  # points that stand for a sector
_SEEN_M, _ROCK_M = 2.0, 1.0  # cell sizes
_CELLS = 512  # a map wraps round after 1,024 m of seen cells and 512 m of rock
_SAMPLE_M = 0.9  # between points along a beam

Grid = tuple[np.ndarray, np.ndarray]  # rows and columns, wrapped


class MapObserver:
    """What n robots have seen by their own beams: `observe` takes it in and gives its patch round each robot back.

    It uses nothing but the paper's observation and the robot's true pose, so it may be used in training and in use
    alike. A patch is cut into sectors, a beam's bearing by a ring's distance, in the robot's frame: it tells which
    share of each has been passed by beams, hit as rock, and driven through. Sectors line up with the beams, so that
    "open this way" and "seen already this way" stand side by side.
    """

    def __init__(self, count: int, task: TaskParams) -> None:
        """Start with empty maps."""
        self._near, self._far = task.range_m
        self._beams = 2 * np.pi * np.arange(task.beams) / task.beams
        self.seen, self.rock, self.been = (np.zeros((count, _CELLS, _CELLS), dtype=bool) for _ in range(3))
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
        for grid in (self.seen, self.rock, self.been):
            grid[robots] = False

    def observe(self, observation: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Take in one observation of every robot and return the patches.

        Parameters
        ----------
        observation : (n, beams + 3) float32
        poses : (n, 3)
            x, y, m, and yaw, rad, in the mine frame.

        Returns
        -------
        (n, 3 * beams * rings) float32
            Shares in [0, 1]: seen, rock, been; in each by bearing, then by ring.
        """
        robots = np.arange(len(poses))
        ranges = self._near + observation[:, : len(self._beams)] * (self._far - self._near)
        bearing = poses[:, 2:3] + self._beams
        along = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)  # (n, beams, 2)
        steps = np.arange(0.0, self._far + _SAMPLE_M, _SAMPLE_M)
        reach = np.minimum(steps, ranges[..., None])  # the last point of a beam is its end
        points = poses[:, None, None, :2] + along[:, :, None, :] * reach[..., None]
        self.seen[robots[:, None, None], *_cells(points, _SEEN_M)] = True
        hit = ranges < self._far - 0.1
        robot, beam = np.nonzero(hit)
        ends = poses[robot, :2] + along[robot, beam] * ranges[robot, beam, None]
        self.rock[robot, *_cells(ends, _ROCK_M)] = True
        self.been[robots, *_cells(poses[:, :2], _SEEN_M)] = True
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        turn = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=1)
        places = poses[:, None, :2] + np.einsum("nij,pj->npi", turn, self._points)
        shares = [
            grid[robots[:, None], *_cells(places, cell)].reshape(len(poses), -1, _ALONG * _ACROSS).mean(axis=-1)
            for grid, cell in ((self.seen, _SEEN_M), (self.rock, _ROCK_M), (self.been, _SEEN_M))
        ]
        return np.concatenate(shares, axis=1).astype(np.float32)


def _cells(places: np.ndarray, cell_m: float) -> Grid:
    at = np.floor(places / cell_m).astype(int) % _CELLS
    return at[..., 1], at[..., 0]
