"""Planes fitted to the points of each voxel: normals, and residuals as defined in ISO 4287."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.sorting import stable_order

_FLAT_M = 1e-6  # a smaller RMS residual is the rounding of the eigenvalue of a flat voxel; it depends on the processor


@dataclass(frozen=True)
class VoxelPlanes:
    """Planes of the voxels that hold enough points.

    `cell` (k, 3): voxel indices in lexical order. `centre` (k, 3): m. `normal` (k, 3): unit, sign arbitrary. `sigma`
    (k,): RMS residual, m. `residual` (n,): m, of the points used, sorted by voxel; voxel i has the `count[i]` residuals
    from index `start[i]`.
    """

    cell: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    sigma: np.ndarray
    residual: np.ndarray
    start: np.ndarray
    count: np.ndarray

    def holding(self, min_points: int) -> VoxelPlanes:
        """Return the planes of the voxels that hold at least so many points."""
        kept = self.count >= min_points
        count = self.count[kept]
        return VoxelPlanes(
            self.cell[kept],
            self.centre[kept],
            self.normal[kept],
            self.sigma[kept],
            self.residual[np.repeat(kept, self.count)],
            np.cumsum(count) - count,
            count,
        )


@dataclass(frozen=True)
class Residuals:
    """Residuals to planes in voxels of one size, m: mean, RMS, mean peak-to-valley per voxel, 95th percentile."""

    window_m: float
    ra_m: float
    rq_m: float
    rz_m: float
    p95_m: float
    voxels: int


def fit_voxel_planes(points: np.ndarray, size_m: float | tuple[float, float, float], min_points: int) -> VoxelPlanes:
    """Fit a plane by least squares to the points of each voxel of a grid through the origin.

    Parameters
    ----------
    points : (n, 3) m
    size_m : float or 3 floats
        Edge of a voxel.
    min_points : int
        Voxels with fewer points are left out.
    """
    size = np.broadcast_to(np.asarray(size_m, float), 3)
    order, key = _in_order(points, size)
    start = np.flatnonzero(np.diff(key, prepend=-1))
    count = np.diff(start, append=len(key))
    kept = count >= min_points
    order, start, count = order[np.repeat(kept, count)], start[kept], count[kept]
    if not len(order):
        empty = np.zeros((0, 3))
        return VoxelPlanes(empty.astype(int), empty, empty, np.zeros(0), np.zeros(0), count, count)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    used = points.take(order, axis=0)  # by rows: the three numbers of a point lie together
    cell = np.floor(used[first] / size).astype(np.int64)
    middle = (cell + 0.5) * size
    local, mean = [], np.empty_like(middle)
    for axis in range(3):
        from_middle = used[:, axis] - np.repeat(middle[:, axis], count)
        mean[:, axis] = np.add.reduceat(from_middle, first) / count
        from_middle -= np.repeat(mean[:, axis], count)
        local.append(from_middle)
    del used
    spread = np.empty((len(count), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            spread[:, i, j] = spread[:, j, i] = np.add.reduceat(local[i] * local[j], first) / count
    values, vectors = np.linalg.eigh(spread)
    normal = vectors[:, :, 0]
    residual, y, z = local
    for axis, of in enumerate(local):
        of *= np.repeat(normal[:, axis], count)
    residual += z
    residual += y
    sigma = np.sqrt(np.where(values[:, 0] > _FLAT_M**2, values[:, 0], 0.0))
    return VoxelPlanes(cell, middle + mean, normal, sigma, residual, first, count)


def _in_order(points: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the order of points by their cells (x, y, z), equal ones as they were, and the cells' sorted numbers."""
    # Axis by axis: arrays of one number a point pass through the processor's cache several times faster.
    cells = (np.floor(at / edge).astype(np.int64) for at, edge in zip(points.T, size.tolist(), strict=True))
    x, y, z = (of - of.min() if len(of) else of for of in cells)
    number = (x * (y.max(initial=0) + 1) + y) * (z.max(initial=0) + 1) + z
    if number.max(initial=0) <= np.iinfo(np.int32).max:
        number = number.astype(np.int32)  # half the bytes to sort
    order = stable_order(number)
    return order, number.take(order)


def sweep_residuals(points: np.ndarray, windows_m: tuple[float, ...], min_points: int) -> list[Residuals]:
    """Return the residuals for each voxel size; sizes at which no voxel has enough points are left out."""
    fitted = (residuals_of(fit_voxel_planes(points, window, min_points), window) for window in windows_m)
    return [found for found in fitted if found is not None]


def residuals_of(planes: VoxelPlanes, window_m: float) -> Residuals | None:
    """Return the residuals to the planes of voxels of one size; None without a plane."""
    if not len(planes.count):
        return None
    size = np.abs(planes.residual)
    peak = np.maximum.reduceat(planes.residual, planes.start) - np.minimum.reduceat(planes.residual, planes.start)
    return Residuals(
        window_m,
        float(size.mean()),
        float(np.sqrt((size**2).mean())),
        float(peak.mean()),
        float(np.percentile(size, 95)),
        len(planes.count),
    )


def normal_scatter_deg(planes: VoxelPlanes) -> np.ndarray:
    """Return each voxel's angle, deg, between its normal and the mean normal of its 3 x 3 x 3 neighbourhood.

    The sign of a normal is arbitrary, so neighbours' normals are flipped to the voxel's side before averaging. Voxels
    without a neighbour are left out.
    """
    low = planes.cell.min(axis=0) - 1
    span = planes.cell.max(axis=0) - low + 2
    key = _keys(planes.cell - low, span)
    total = np.zeros_like(planes.normal)
    neighbours = np.zeros(len(key), dtype=int)
    for step in np.ndindex(3, 3, 3):
        wanted = _keys(planes.cell - low + np.array(step) - 1, span)
        at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        present = key[at] == wanted
        other = planes.normal[at]
        side = np.where(np.einsum("ij,ij->i", other, planes.normal) < 0, -1.0, 1.0)
        total += np.where(present, side, 0.0)[:, None] * other
        neighbours += present
    has_neighbour = neighbours > 1
    mean = total[has_neighbour] / np.linalg.norm(total[has_neighbour], axis=1, keepdims=True)
    cosine = np.abs(np.einsum("ij,ij->i", mean, planes.normal[has_neighbour]))
    return np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))


def _keys(cell: np.ndarray, span: np.ndarray) -> np.ndarray:
    return (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]
