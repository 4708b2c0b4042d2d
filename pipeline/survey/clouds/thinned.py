"""Points thinned block by block to one of each voxel, so that memory does not grow with the scan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import InputError
from pipeline.survey.clouds.voxels import REACH, cells_at, keys_of

LEAST_POINTS = 100
_SAMPLES = 20_000
_NEIGHBOURS = 8
_PENDING = 4_000_000  # rows that are merged at once


@dataclass(frozen=True)
class ThinnedCloud:
    """The mean place (n, 3) m of the points in each voxel, and how many (n,) they are, of `total` in all.

    `time_s` (n,) is that of the first point of each, NaN where the file has none.
    """

    points_m: np.ndarray
    count: np.ndarray
    total: int
    time_s: np.ndarray

    def __len__(self) -> int:
        """Return the number of voxels with points."""
        return len(self.points_m)

    def some(self, rows: np.ndarray) -> ThinnedCloud:
        """Return some of the voxels."""
        return ThinnedCloud(self.points_m[rows], self.count[rows], self.total, self.time_s[rows])


def thin(blocks: Iterable[np.ndarray], voxel_m: float, most: int, coarsen: bool = False) -> ThinnedCloud:
    """Return the means of blocks of points (n, 3) m in voxels; with `coarsen` these double until `most` suffice.

    A fourth column of the blocks is the points' times, s.

    Raises
    ------
    InputError
        If fewer than 100 voxels or more than `most` have points, or a point lies too far from the origin.
    """
    keys, sums = np.zeros(0, np.int64), np.zeros((0, 5))
    waiting: list[tuple[np.ndarray, np.ndarray]] = []
    total = rows = 0
    for rows_of_file in blocks:
        block, time_s = rows_of_file[:, :3], rows_of_file[:, 3:]
        total += len(block)
        if len(block) and np.abs(block).max() > REACH * voxel_m:
            raise InputError(
                f"reaches {np.abs(block).max():.0f} m from its origin, at most {REACH * voxel_m:.0f} m; --unit states "
                "its unit"
            )
        values = np.full((len(block), 5), np.nan)
        values[:, :3], values[:, 3], values[:, 4 : 4 + time_s.shape[1]] = block, 1, time_s
        waiting.append(_summed(keys_of(cells_at(block, voxel_m)), values))
        rows += len(waiting[-1][0])
        if rows > max(_PENDING, len(keys)):
            keys, sums, voxel_m = _few(*_merged(keys, sums, waiting), voxel_m, most, coarsen)
            waiting, rows = [], 0
            if len(keys) > most:
                break
    keys, sums, voxel_m = _few(*_merged(keys, sums, waiting), voxel_m, most, coarsen)
    if len(keys) > most:
        raise InputError(f"its points fill more than {most:,} voxels of {voxel_m:g} m; --voxel states a larger size")
    if len(keys) < LEAST_POINTS:
        raise InputError(
            f"its points fill {len(keys)} voxels of {voxel_m:g} m, at least {LEAST_POINTS} are needed; "
            "--unit states its unit"
        )
    return ThinnedCloud(sums[:, :3] / sums[:, 3:4], sums[:, 3], total, sums[:, 4])


def _few(
    keys: np.ndarray, sums: np.ndarray, voxel_m: float, most: int, coarsen: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return voxels, their sums and their size: doubled until there are no more than `most`, if they may coarsen."""
    while coarsen and len(keys) > most:
        voxel_m *= 2
        keys, sums = _summed(keys_of(cells_at(sums[:, :3] / sums[:, 3:4], voxel_m)), sums)
    return keys, sums, voxel_m


def _merged(
    keys: np.ndarray, sums: np.ndarray, more: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    return _summed(np.concatenate([keys, *(k for k, _ in more)]), np.concatenate([sums, *(s for _, s in more)]))


def _summed(keys: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each number once, with the sum of its rows, and with the time of the first of them."""
    order = np.argsort(keys, kind="stable")
    keys, values = keys[order], values[order]
    first = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)])
    sums = np.add.reduceat(values, first, axis=0) if len(first) else values
    sums[:, 4] = values[first, 4]
    return keys[first], sums


def spacing_of(points_m: np.ndarray) -> float:
    """Return how far apart the points of most of the surface are, m: nine of ten lie denser.

    It is that of a square grid with as many points as lie within the eighth neighbour's distance.
    """
    chosen = points_m[:: max(1, len(points_m) // _SAMPLES)]
    far = cKDTree(points_m).query(chosen, _NEIGHBOURS + 1)[0][:, -1]
    return float(np.quantile(far, 0.9) * np.sqrt(np.pi / _NEIGHBOURS))
