"""Points thinned block by block to one of each voxel, so that memory does not grow with the scan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from minesurveys.clouds.point_blocks import PointBlock, mean_colours
from minesurveys.errors import InputError
from pipeline.survey.clouds.voxels import REACH, cells_at, keys_of

LEAST_POINTS = 100
_PLACES = 4  # columns of sums: x, y, z and 1 of each point; red, green, blue and 1 of those with colours follow
_SAMPLES = 20_000
_NEIGHBOURS = 8
_PENDING = 4_000_000  # rows that are merged at once


@dataclass(frozen=True)
class ThinnedCloud:
    """The mean place (n, 3) m of the points in each voxel, and how many (n,) they are, of `total` in all.

    `rgb` (n, 3) is their mean colour, black of a voxel without one, and `time_s` (n,) the time of the first point, NaN
    of one without; (0, 3) and (0,) if no point has any.
    """

    points_m: np.ndarray
    count: np.ndarray
    total: int
    rgb: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), np.uint8))
    time_s: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        """Return the number of voxels with points."""
        return len(self.points_m)

    def some(self, rows: np.ndarray) -> ThinnedCloud:
        """Return some of the voxels."""
        rgb, time_s = (each[rows] if len(each) else each for each in (self.rgb, self.time_s))
        return ThinnedCloud(self.points_m[rows], self.count[rows], self.total, rgb, time_s)


@dataclass(frozen=True)
class _Voxels:
    """Numbers of voxels (n,), sums over the points in each (n, 4 or 8), and the first point's time (n, 0 or 1)."""

    keys: np.ndarray
    sums: np.ndarray
    time_s: np.ndarray

    def means(self) -> np.ndarray:
        """Return the mean places (n, 3), m."""
        return np.asarray(self.sums[:, :3] / self.sums[:, 3:_PLACES])


def thin(blocks: Iterable[PointBlock], voxel_m: float, most: int, coarsen: bool = False) -> ThinnedCloud:
    """Return the means of blocks of points, m, in voxels; with `coarsen` these double until `most` suffice.

    A voxel has the mean of the colours that are not black.

    Raises
    ------
    InputError
        If fewer than 100 voxels or more than `most` have points, or a point lies too far from the origin.
    """
    voxels = _Voxels(np.zeros(0, np.int64), np.zeros((0, _PLACES)), np.zeros((0, 0)))
    waiting: list[_Voxels] = []
    total = rows = 0
    for block in blocks:
        total += len(block)
        if len(block) and np.abs(block.points).max() > REACH * voxel_m:
            raise InputError(
                f"reaches {np.abs(block.points).max():.6g} m from its origin, at most {REACH * voxel_m:.0f} m; --unit "
                "states its unit"
            )
        waiting.append(_voxels_of(block, voxel_m))
        rows += len(waiting[-1].keys)
        if rows > max(_PENDING, len(voxels.keys)):
            voxels, voxel_m = _few(_merged([voxels, *waiting]), voxel_m, most, coarsen)
            waiting, rows = [], 0
            if len(voxels.keys) > most:
                break
    voxels, voxel_m = _few(_merged([voxels, *waiting]), voxel_m, most, coarsen)
    count = len(voxels.keys)
    if count > most:
        raise InputError(f"its points fill more than {most:,} voxels of {voxel_m:g} m; --voxel states a larger size")
    if count < LEAST_POINTS:
        raise InputError(
            f"its points fill {count} voxels of {voxel_m:g} m, at least {LEAST_POINTS} are needed; "
            "--unit states its unit"
        )
    sums = voxels.sums
    rgb = mean_colours(sums[:, _PLACES:-1], sums[:, -1]) if sums.shape[1] > _PLACES else np.zeros((0, 3), np.uint8)
    return ThinnedCloud(voxels.means(), sums[:, 3], total, rgb, voxels.time_s.reshape(-1))


def _voxels_of(block: PointBlock, voxel_m: float) -> _Voxels:
    columns = [block.points, np.ones(len(block))]
    if block.colours is not None:
        columns += [block.colours, np.asarray(block.colours.any(axis=1))]
    times = np.zeros((len(block), 0)) if block.times is None else block.times[:, None]
    return _summed(keys_of(cells_at(block.points, voxel_m)), np.column_stack(columns), times)


def _few(voxels: _Voxels, voxel_m: float, most: int, coarsen: bool) -> tuple[_Voxels, float]:
    """Return voxels and their size: doubled until there are no more than `most`, if they may coarsen."""
    while coarsen and len(voxels.keys) > most:
        voxel_m *= 2
        voxels = _summed(keys_of(cells_at(voxels.means(), voxel_m)), voxels.sums, voxels.time_s)
    return voxels, voxel_m


def _merged(parts: list[_Voxels]) -> _Voxels:
    keys = np.concatenate([part.keys for part in parts])
    return _summed(keys, _joined([part.sums for part in parts], 0.0), _joined([part.time_s for part in parts], np.nan))


def _joined(parts: list[np.ndarray], missing: float) -> np.ndarray:
    """Return all rows; some of the clouds of a zip file may have colours or times."""
    wide = max(part.shape[1] for part in parts)
    padded = (
        part if part.shape[1] == wide else np.pad(part, ((0, 0), (0, wide - part.shape[1])), constant_values=missing)
        for part in parts
    )
    return np.concatenate(list(padded))


def _summed(keys: np.ndarray, sums: np.ndarray, time_s: np.ndarray) -> _Voxels:
    """Return each number once, with the sum of its rows, and with the time of the first of them."""
    order = np.argsort(keys, kind="stable")
    keys, sums = keys[order], sums[order]
    first = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)])
    return _Voxels(keys[first], np.add.reduceat(sums, first, axis=0) if len(first) else sums, time_s[order[first]])


def spacing_of(points_m: np.ndarray) -> float:
    """Return how far apart the points of most of the surface are, m: nine of ten lie denser.

    It is that of a square grid with as many points as lie within the eighth neighbour's distance.
    """
    chosen = points_m[:: max(1, len(points_m) // _SAMPLES)]
    far = cKDTree(points_m).query(chosen, _NEIGHBOURS + 1)[0][:, -1]
    return float(np.quantile(far, 0.9) * np.sqrt(np.pi / _NEIGHBOURS))
