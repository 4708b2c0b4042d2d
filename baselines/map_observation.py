"""A map of its own for every robot, and the patch of it that lies round the robot, turned with it."""

from __future__ import annotations

import numpy as np

from minexplore.task import TaskParams

PATCH = 17  # cells across; odd, so that the robot stands in the middle
_SEEN_M, _ROCK_M = 2.0, 1.0  # cell sizes: 34 m of what was seen, 17 m of where rock was hit
_CELLS = 512  # a map wraps round after 1,024 m of seen cells and 512 m of rock
_SAMPLE_M = 0.9  # between points along a beam

Grid = tuple[np.ndarray, np.ndarray]  # rows and columns, wrapped


class MapObserver:
    """What n robots have seen by their own beams: `observe` takes it in and gives the patches back.

    It uses nothing but the paper's observation and the robot's true pose, so it may be used in training and in use
    alike. A patch tells, in the robot's frame, where beams have passed, where they ended at rock, and where the robot
    has been.
    """

    def __init__(self, count: int, task: TaskParams) -> None:
        """Start with empty maps."""
        self._near, self._far = task.range_m
        self._beams = 2 * np.pi * np.arange(task.beams) / task.beams
        self.seen, self.rock, self.been = (np.zeros((count, _CELLS, _CELLS), dtype=bool) for _ in range(3))
        half = PATCH // 2
        ahead, left = np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1), indexing="ij")
        self._patch = np.stack([ahead.ravel(), left.ravel()], axis=-1).astype(float)
        self.size = 3 * PATCH * PATCH

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
        (n, 3 * PATCH**2) float32
            0 or 1.
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
        offsets = np.einsum("nij,pj->npi", turn, self._patch)
        patches = [
            grid[robots[:, None], *_cells(poses[:, None, :2] + offsets * cell, cell)]
            for grid, cell in ((self.seen, _SEEN_M), (self.rock, _ROCK_M), (self.been, _SEEN_M))
        ]
        return np.concatenate(patches, axis=1).astype(np.float32)


def _cells(places: np.ndarray, cell_m: float) -> Grid:
    at = np.floor(places / cell_m).astype(int) % _CELLS
    return at[..., 1], at[..., 0]
