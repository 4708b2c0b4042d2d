"""Points thinned block by block to one of each voxel, so that memory does not grow with the scan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import InputError
from pipeline.scans.colours import mean_colours
from pipeline.survey.clouds.voxels import REACH, cells_at, keys_of

LEAST_POINTS = 100
_PLACES = 4  # columns of sums: x, y, z, and how many; colours follow
_SAMPLES = 20_000
_NEIGHBOURS = 8
_PENDING = 4_000_000  # rows that are merged at once


@dataclass(frozen=True)
class ThinnedCloud:
    """The mean place (n, 3) m of the points in each voxel, and how many (n,) they are, of `total` in all.

    `rgb` (n, 3) is their mean colour, black of a voxel without one; (0, 3) if no point has any.
    """

    points_m: np.ndarray
    count: np.ndarray
    total: int
    rgb: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), np.uint8))

    def __len__(self) -> int:
        """Return the number of voxels with points."""
        return len(self.points_m)

    def some(self, rows: np.ndarray) -> ThinnedCloud:
        """Return some of the voxels."""
        rgb = self.rgb[rows] if len(self.rgb) else self.rgb
        return ThinnedCloud(self.points_m[rows], self.count[rows], self.total, rgb)


def thin(blocks: Iterable[np.ndarray], voxel_m: float, most: int, coarsen: bool = False) -> ThinnedCloud:
    """Return the means of blocks of points in voxels; with `coarsen` these double until `most` suffice.

    Points are (n, 3) m, or (n, 6) with colours. A voxel has the mean of the colours that are not black.

    Raises
    ------
    InputError
        If fewer than 100 voxels or more than `most` have points, or a point lies too far from the origin.
    """
    keys, sums = np.zeros(0, np.int64), np.zeros((0, _PLACES))
    waiting: list[tuple[np.ndarray, np.ndarray]] = []
    total = rows = 0
    for block in blocks:
        total += len(block)
        places = block[:, :3]
        if len(block) and np.abs(places).max() > REACH * voxel_m:
            raise InputError(
                f"reaches {np.abs(places).max():.0f} m from its origin, at most {REACH * voxel_m:.0f} m; --unit states "
                "its unit"
            )
        waiting.append(_summed(keys_of(cells_at(places, voxel_m)), _counted(block)))
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
    rgb = mean_colours(sums[:, _PLACES:-1], sums[:, -1]) if sums.shape[1] > _PLACES else np.zeros((0, 3), np.uint8)
    return ThinnedCloud(sums[:, :3] / sums[:, 3:_PLACES], sums[:, 3], total, rgb)


def _counted(block: np.ndarray) -> np.ndarray:
    """Return what is summed: x, y, z and 1 of each point, then red, green, blue and 1 where it has a colour."""
    places, colours = block[:, :3], block[:, 3:]
    columns = [places, np.ones(len(block))]
    return np.column_stack([*columns, colours, colours.any(axis=1)] if colours.shape[1] else columns)


def _few(
    keys: np.ndarray, sums: np.ndarray, voxel_m: float, most: int, coarsen: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return voxels, their sums and their size: doubled until there are no more than `most`, if they may coarsen."""
    while coarsen and len(keys) > most:
        voxel_m *= 2
        keys, sums = _summed(keys_of(cells_at(sums[:, :3] / sums[:, 3:_PLACES], voxel_m)), sums)
    return keys, sums, voxel_m


def _merged(
    keys: np.ndarray, sums: np.ndarray, more: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    every = [sums, *(s for _, s in more)]
    wide = max(s.shape[1] for s in every)  # some of the clouds of a zip file may have colours
    every = [s if s.shape[1] == wide else np.pad(s, ((0, 0), (0, wide - s.shape[1]))) for s in every]
    return _summed(np.concatenate([keys, *(k for k, _ in more)]), np.concatenate(every))


def _summed(keys: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each number once, with the sum of its rows."""
    order = np.argsort(keys, kind="stable")
    keys, values = keys[order], values[order]
    first = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)])
    return keys[first], np.add.reduceat(values, first, axis=0) if len(first) else values


def spacing_of(points_m: np.ndarray) -> float:
    """Return how far apart the points of most of the surface are, m: nine of ten lie denser.

    It is that of a square grid with as many points as lie within the eighth neighbour's distance.
    """
    chosen = points_m[:: max(1, len(points_m) // _SAMPLES)]
    far = cKDTree(points_m).query(chosen, _NEIGHBOURS + 1)[0][:, -1]
    return float(np.quantile(far, 0.9) * np.sqrt(np.pi / _NEIGHBOURS))
