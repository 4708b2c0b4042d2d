"""Planes fitted to the points of each voxel: normals, and residuals as defined in ISO 4287."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.geometry.sorting import stable_order

_PAIRS = (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)
_BLOCK = 1 << 15
_FLAT_M = 1e-6  # a smaller RMS residual is the rounding of the eigenvalue of a flat voxel; it depends on the processor


@dataclass(frozen=True)
class VoxelPlanes:
    """Planes of the voxels that hold enough points.

    `cell` (k, 3): voxel indices in lexical order. `centre` (k, 3): mean of the points, m. `normal` (k, 3): unit, sign
    arbitrary. `sigma` (k,): RMS residual, m. `count` (k,): points.
    """

    cell: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    sigma: np.ndarray
    count: np.ndarray

    def holding(self, min_points: int) -> VoxelPlanes:
        """Return the planes of the voxels that hold at least so many points."""
        kept = self.count >= min_points
        return VoxelPlanes(*(of[kept] for of in vars(self).values()))


@dataclass(frozen=True)
class Residuals:
    """Residuals to planes in voxels of one size, m: mean, RMS, mean peak-to-valley per voxel, 95th percentile."""

    window_m: float
    ra_m: float
    rq_m: float
    rz_m: float
    p95_m: float
    voxels: int


@dataclass(frozen=True)
class _VoxelSums:
    """Voxels of edge `size` (3,) m that hold points, and the moments of these.

    `cell` (k, 3): indices in lexical order. `count` (k,): points. `mean` (k, 3): of the points from the voxel's middle,
    m. `scatter` (k, 6): sums of products of distances from the mean, m2: xx, xy, xz, yy, yz, zz.
    """

    size: np.ndarray
    cell: np.ndarray
    count: np.ndarray
    mean: np.ndarray
    scatter: np.ndarray

    def take(self, numbers: np.ndarray) -> _VoxelSums:
        """Return the voxels of these numbers."""
        return _VoxelSums(self.size, self.cell[numbers], self.count[numbers], self.mean[numbers], self.scatter[numbers])

    def planes(self) -> VoxelPlanes:
        """Fit a plane to the points of each voxel."""
        spread = np.empty((len(self.count), 3, 3))
        for (i, j), products in zip(_PAIRS, self.scatter.T, strict=True):
            spread[:, i, j] = spread[:, j, i] = products / self.count
        values, vectors = np.linalg.eigh(spread)
        sigma = np.sqrt(np.where(values[:, 0] > _FLAT_M**2, values[:, 0], 0.0))
        return VoxelPlanes(self.cell, (self.cell + 0.5) * self.size + self.mean, vectors[:, :, 0], sigma, self.count)


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
    voxels, _ = _sort_points(points, size_m)
    return voxels.take(np.flatnonzero(voxels.count >= min_points)).planes()


def sweep_planes(
    points: np.ndarray, windows_m: tuple[float, ...], min_points: int
) -> list[tuple[VoxelPlanes, Residuals | None]]:
    """Fit planes to points (n, 3) m in voxels of each size; return them and the residuals, None without a plane.

    Points are sorted by the smallest voxel. A larger one that is a multiple of it has the sums of those within it.
    """
    found: dict[float, tuple[VoxelPlanes, Residuals | None]] = {}
    while left := [window for window in windows_m if window not in found]:
        least = min(left)
        small, local = _sort_points(points, least)
        for window in left:
            times = round(window / least)
            if np.isclose(times * least, window, rtol=1e-9):
                found[window] = _fit_window(small, local, window, times, min_points)
    return [found[window] for window in windows_m]


def sweep_residuals(points: np.ndarray, windows_m: tuple[float, ...], min_points: int) -> list[Residuals]:
    """Return the residuals for each voxel size; sizes at which no voxel has enough points are left out."""
    return [found for _, found in sweep_planes(points, windows_m, min_points) if found is not None]


def _sort_points(points: np.ndarray, size_m: float | tuple[float, float, float]) -> tuple[_VoxelSums, list[np.ndarray]]:
    """Return the voxels, and the points by voxel as three arrays (n,) of distances from its mean, m."""
    size = np.broadcast_to(np.asarray(size_m, float), 3)
    # Axis by axis: arrays of one number a point pass through the processor's cache several times faster.
    order, first, count = _in_order(
        [np.floor(at / edge).astype(np.int64) for at, edge in zip(points.T, size.tolist(), strict=True)]
    )
    used = points.take(order, axis=0)  # by rows: the three numbers of a point lie together
    cell = np.floor(used[first] / size).astype(np.int64)
    middle = (cell + 0.5) * size
    local, mean = [], np.empty_like(middle)
    for axis in range(3):
        from_middle = used[:, axis] - np.repeat(middle[:, axis], count)
        mean[:, axis] = _sums(from_middle, first) / count
        from_middle -= np.repeat(mean[:, axis], count)
        local.append(from_middle)
    scatter = np.column_stack([_sums(local[i] * local[j], first) for i, j in _PAIRS])
    return _VoxelSums(size, cell, count, mean, scatter), local


def _fit_window(
    small: _VoxelSums, local: list[np.ndarray], window_m: float, times: int, min_points: int
) -> tuple[VoxelPlanes, Residuals | None]:
    """Fit planes in voxels whose edge is so many times that of the small ones, by which the points are sorted."""
    order, first, parts = _in_order(list((small.cell // times).T))
    kept = _sums(small.count[order], first) >= min_points
    order, parts = order[np.repeat(kept, parts)], parts[kept]
    first, part = np.cumsum(parts) - parts, small.take(order)
    cell, count = part.cell[first] // times, _sums(part.count, first)
    # From the middle of the large voxel, which is whole numbers of half edges away: no digits are lost.
    shift = part.mean + (2 * (part.cell - np.repeat(times * cell, parts, axis=0)) + 1 - times) * (part.size / 2)
    mean = np.column_stack([_sums(part.count * along, first) / count for along in shift.T])
    shift -= np.repeat(mean, parts, axis=0)
    between = [part.count * shift[:, i] * shift[:, j] for i, j in _PAIRS]
    scatter = np.column_stack([_sums(of + within, first) for of, within in zip(between, part.scatter.T, strict=True)])
    planes = _VoxelSums(times * small.size, cell, count, mean, scatter).planes()
    if not len(cell):
        return planes, None
    plane = np.zeros((len(small.count), 4))  # of each small voxel: the normal, and how far its mean is from the plane
    plane[order, :3] = np.repeat(planes.normal, parts, axis=0)
    plane[order, 3] = np.einsum("ij,ij->i", shift, plane[order, :3])
    residual = _residuals(local, plane, small.count)
    start = np.cumsum(small.count) - small.count
    high, low = (of.reduceat(of.reduceat(residual, start)[order], first) for of in (np.maximum, np.minimum))
    if len(order) < len(small.count):
        used = np.zeros(len(small.count), bool)
        used[order] = True
        residual = residual[np.repeat(used, small.count)]
    size = np.abs(residual, out=residual)
    return planes, Residuals(
        window_m,
        float(size.mean()),
        float(np.sqrt((size**2).mean())),
        float((high - low).mean()),
        float(np.percentile(size, 95)),
        len(count),
    )


def _residuals(local: list[np.ndarray], plane: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the distances (n,) m of points from the planes of their voxels, in blocks that the cache holds."""
    residual = np.empty(len(local[0]))
    ends = np.cumsum(count)
    borders = np.unique(np.append(np.searchsorted(ends, np.arange(0, len(residual), _BLOCK)), len(count)))
    for a, b in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True):
        points = slice(ends[a] - count[a], ends[b - 1])
        *normal, offset = (np.repeat(of, count[a:b]) for of in plane[a:b].T)
        for along, of in zip(normal, local, strict=True):
            along *= of[points]
            offset += along
        residual[points] = offset
    return residual


def _sums(values: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return the sums of the runs of values that begin at `first`."""
    return np.add.reduceat(values, first) if len(first) else np.zeros(0, values.dtype)


def _in_order(cells: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the order of cells (three arrays (n,), equal ones as they were), where each cell begins, and its count."""
    x, y, z = (of - of.min() if len(of) else of for of in cells)
    number = (x * (y.max(initial=0) + 1) + y) * (z.max(initial=0) + 1) + z
    if number.max(initial=0) <= np.iinfo(np.int32).max:
        number = number.astype(np.int32)  # half the bytes to sort
    order = stable_order(number)
    first = np.flatnonzero(np.diff(number.take(order), prepend=-1))
    return order, first, np.diff(first, append=len(order))


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


def planes_at(points: np.ndarray, planes: VoxelPlanes, size_m: float) -> np.ndarray:
    """Return the number (n,) of the plane of the voxel that holds each point (n, 3) m; -1 without one."""
    cell = np.floor(points / size_m).astype(np.int64)
    if not (len(cell) and len(planes.cell)):
        return np.full(len(cell), -1)
    low = cell.min(axis=0)
    span = cell.max(axis=0) - low + 1
    known, wanted = _keys(planes.cell - low, span), _keys(cell - low, span)
    at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    return np.where(known[at] == wanted, at, -1)


def _keys(cell: np.ndarray, span: np.ndarray) -> np.ndarray:
    return (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]
