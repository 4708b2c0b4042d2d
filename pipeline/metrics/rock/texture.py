"""The texture axes of a rock surface, and two scores: the published score and the strict score.

A new axis is a function and a line of `AXES`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from pipeline.geometry.cells import plan_cells
from pipeline.geometry.polyline import rings_of
from pipeline.geometry.sorting import stable_order
from pipeline.metrics.rock.planefit import (
    Residuals,
    VoxelPlanes,
    fit_voxel_planes,
    normal_scatter_deg,
    sweep_planes,
)
from pipeline.metrics.rock.profile import arc_windows, project_on_rings, tapered

WINDOWS_M = (0.10, 0.15, 0.20, 0.30, 0.50, 1.00, 2.00)
_JAG_M, _BUMP_M = 0.30, 0.50  # the paper's
_MIN_POINTS = 30
_SWEEP_MIN_POINTS = 20  # 0.10 m voxels hold about 30 of the sample's points
_SLAB_M, _SLAB_POINTS, _RESAMPLED = 0.05, 400, 1024
_BAND_M = (0.05, 2.0)
_ROOF_CELL_M, _ROOF_POINTS = 0.5, 25
_RING_M = (1.65, 1.85)
_ARC_STEP_M, _ARC_WINDOW_M = 0.025, 8.0
_TURN_RAD = 0.4
_FLAT_SCORE = 0.9


TextureAxes = dict[str, float | None]
"""A figure for each axis of `AXES`; None where the surface gives none."""


@dataclass(frozen=True)
class WallSweep:
    """Residuals of walls to the planes of voxels of 0.10 to 2.00 m, and the planes of two sizes that axes read."""

    residuals: list[Residuals]
    jags: VoxelPlanes
    bumps: VoxelPlanes


@dataclass(frozen=True)
class RockPoints:
    """What an axis is measured on: points (n, 3) m of walls and roof, the walls' planes, the dominant wavelength."""

    walls: np.ndarray
    sweep: WallSweep
    roof: np.ndarray
    wavelength_m: float | None


@dataclass(frozen=True)
class Axis:
    """A texture axis: its title, its measure, the real scan's figure, and the paper's for its model and its score."""

    title: str
    measure: Callable[[RockPoints], float | None]
    real: float
    paper_model: float | None = None
    paper_score: float | None = None


@dataclass(frozen=True)
class Scores:
    """The similarity of each axis, 0 to 1, None without a figure, and the geometric mean of the `measured` axes."""

    axes: dict[str, float | None]
    overall: float | None
    measured: int


def is_uninformative(flat_score: float | None) -> bool:
    """Return whether flat walls score above 0.9 on an axis, so that the axis does not measure texture."""
    return flat_score is not None and flat_score > _FLAT_SCORE


def rotate_about_z(points: np.ndarray) -> np.ndarray:
    """Return points (n, 3) rotated by 0.4 rad about the vertical, so that voxels lie at this angle to the mine.

    Mines are often drawn along the axes. A border between voxels then cuts a wall into halves that are each too smooth:
    bump Rq of a 60 m mine was 7 % less at 0 than at 0.3, 0.5 and 1 rad. For the embedded mine it is the same.
    """
    cos, sin = math.cos(_TURN_RAD), math.sin(_TURN_RAD)
    return points @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def wall_jaggedness_deg(planes: VoxelPlanes) -> float | None:
    """Return the mean angle between normals of 0.30 m voxels and the mean normals around them; None without."""
    angles = normal_scatter_deg(planes) if len(planes.count) > 1 else np.zeros(0)
    return float(angles.mean()) if len(angles) else None


def bump_rq_m(planes: VoxelPlanes) -> float | None:
    """Return the mean RMS plane residual of 0.50 m voxels with a residual from 0.1 mm to 0.5 m; None without."""
    kept = planes.sigma[(planes.sigma > 1e-4) & (planes.sigma < 0.5)]
    return float(kept.mean()) if len(kept) else None


def sweep_walls(walls: np.ndarray) -> WallSweep:
    """Fit planes to walls in voxels of 0.10 to 2.00 m, of each size once."""
    planes, residuals = zip(*sweep_planes(walls, WINDOWS_M, _SWEEP_MIN_POINTS), strict=True)
    jags, bumps = (planes[WINDOWS_M.index(window)].holding(_MIN_POINTS) for window in (_JAG_M, _BUMP_M))
    return WallSweep([found for found in residuals if found is not None], jags, bumps)


def roughness_integral_m2(sweep: list[Residuals]) -> float | None:
    """Return the integral of Ra over the voxel size by the trapezoidal rule; None for one size or none."""
    return float(np.trapezoid([r.ra_m for r in sweep], [r.window_m for r in sweep])) if len(sweep) > 1 else None


def roof_irregularity_m(roof: np.ndarray) -> float | None:
    """Return the RMS residual of roof points to a quadratic fitted in each 0.5 m cell of the plan; None without."""
    if not len(roof):
        return None
    col, row = (np.floor(at / _ROOF_CELL_M).astype(np.int64) for at in roof.T[:2])
    number = (row - row.min()) * (np.ptp(col) + 1) + col - col.min()
    order = stable_order(number)
    start = np.flatnonzero(np.diff(number[order], prepend=-1))
    count = np.diff(start, append=len(order))
    squares, used = 0.0, 0
    for n in np.unique(count[count >= _ROOF_POINTS]).tolist():  # cells of as many points, at once
        x, y, z = roof[order[start[count == n, None] + np.arange(n)]].transpose(2, 0, 1)
        x, y = x - x.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)
        q, _ = np.linalg.qr(np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2))
        fitted = q @ (q.transpose(0, 2, 1) @ z[:, :, None])
        squares += float(((z - fitted[:, :, 0]) ** 2).sum())
        used += z.size
    return math.sqrt(squares / used) if used else None


def roof_unevenness_m(roof: np.ndarray) -> float:
    """Return the alternative reading of the roof axis: the RMS of the cells' mean heights about one quadratic."""
    cells = plan_cells(roof[:, :2], _ROOF_CELL_M)
    cell, index = cells.at, cells.of_place
    count = np.bincount(index)
    keep = count >= _ROOF_POINTS
    if keep.sum() < 7:
        return 0.0
    x, y = ((cell[keep] - cell[keep].mean(axis=0)) * _ROOF_CELL_M).T
    z = (np.bincount(index, roof[:, 2]) / count)[keep]
    q, _ = np.linalg.qr(np.column_stack([np.ones(len(z)), x, y, x * x, x * y, y * y]))
    return float(np.sqrt(((z - q @ (q.T @ z)) ** 2).mean()))


def wall_heterogeneity_m(walls: np.ndarray) -> float | None:
    """Return the s.d. of the plane residual over 0.25 m cells of wall at z = 1.75 +- 0.10 m; None without cells."""
    low, high = _RING_M
    ring = walls[(walls[:, 2] >= low) & (walls[:, 2] < high)] - [0.0, 0.0, low]
    sigma = fit_voxel_planes(ring, (0.25, 0.25, high - low + 1e-6), 20).sigma
    return float(sigma.std()) if len(sigma) else None


def published_wavelength_m(walls: np.ndarray) -> float | None:
    """Return the strongest wavelength from 0.05 to 2 m as the paper finds it; None without a slab of 400 points.

    It sorts the points of all walls in a 5 cm slab along the slab's principal axis, so most steps go from one wall to
    another. On a long mine 1,024 samples resolve little below 2 m. The measure is kept for comparison.
    """
    lengths = np.geomspace(*_BAND_M, 400)
    total = np.zeros(len(lengths))
    for xy in _slabs(walls):
        centred = xy - xy.mean(axis=0)
        along, across = (centred @ np.linalg.eigh(np.cov(centred.T))[1][:, ::-1]).T
        order = np.argsort(along)
        at = np.linspace(along[order[0]], along[order[-1]], _RESAMPLED)
        offset = tapered(np.interp(at, along[order], across[order]))
        frequency = np.fft.rfftfreq(_RESAMPLED, at[1] - at[0])
        total += np.interp(1 / lengths, frequency, np.abs(np.fft.rfft(offset)), right=0.0)
    return float(lengths[total.argmax()]) if total.any() else None


def wall_wavelength_m(walls: np.ndarray, free: Polygon) -> float | None:
    """Return the strongest wavelength from 0.05 to 2 m along the walls themselves; None without 8 m of wall.

    The points of each 5 cm slab are placed by arc length along the nearest wall of the plan, so that walls never mix.
    """
    lengths = np.geomspace(*_BAND_M, 400)
    total = np.zeros(len(lengths))
    level = np.floor(walls[:, 2] / _SLAB_M).astype(int)
    nearest, along, offset = project_on_rings(rings_of(free), walls[:, :2])
    offset = np.where(shapely.contains_xy(free, walls[:, 0], walls[:, 1]), offset, -offset)
    for k in np.unique(nearest):
        for value in np.unique(level[nearest == k]):
            slab = (nearest == k) & (level == value)
            for part in arc_windows(along[slab], offset[slab], _ARC_STEP_M, _ARC_WINDOW_M):
                spectrum = np.abs(np.fft.rfft(tapered(part), 4 * len(part)))
                total += np.interp(1 / lengths, np.fft.rfftfreq(4 * len(part), _ARC_STEP_M), spectrum)
    return float(lengths[total.argmax()]) if total.any() else None


def _slabs(walls: np.ndarray) -> list[np.ndarray]:
    level = np.floor(walls[:, 2] / _SLAB_M).astype(int)
    order = np.argsort(level, kind="stable")
    _, start = np.unique(level[order], return_index=True)
    return [walls[part, :2] for part in np.split(order, start[1:]) if len(part) >= _SLAB_POINTS]


# From the text files of the paper's repository (Badri1401/MineXplore, commit 3f7fe7c): scan 12M, first 2,000,000
# returns.
AXES: dict[str, Axis] = {
    "wall_jaggedness_deg": Axis(
        "wall jaggedness", lambda rock: wall_jaggedness_deg(rock.sweep.jags), 37.477, 26.246, 0.9758
    ),
    "bump_rq_m": Axis("bump Rq", lambda rock: bump_rq_m(rock.sweep.bumps), 0.055162, 0.019943, 0.8189),
    "roughness_integral_m2": Axis(
        "roughness integral", lambda rock: roughness_integral_m2(rock.sweep.residuals), 0.149121, 0.050549, 0.7978
    ),
    "dominant_wavelength_m": Axis("dominant wavelength", lambda rock: rock.wavelength_m, 1.75749, 1.463839, 0.9936),
    "roof_irregularity_m": Axis(
        "roof irregularity", lambda rock: roof_irregularity_m(rock.roof), 0.128520, 0.019789, 0.5088
    ),
    "wall_heterogeneity_m": Axis(
        "wall heterogeneity", lambda rock: wall_heterogeneity_m(rock.walls), 0.010008, 0.003202, 0.7782
    ),
}
REAL: Mapping[str, float] = {name: axis.real for name, axis in AXES.items()}


def measure_axes(rock: RockPoints) -> TextureAxes:
    """Return the figure of each axis for a surface."""
    return {name: axis.measure(rock) for name, axis in AXES.items()}


def published_score(model: TextureAxes) -> Scores:
    """Score as the paper does: ratios to the real scan are clipped to 1.5, and a factor of 5 is one s.d."""
    return _score(model, 5.0, 1.5)


def strict_score(model: TextureAxes) -> Scores:
    """Score without clipping; a factor of 2, up or down, is one s.d."""
    return _score(model, 2.0, math.inf)


def axis_ratios(model: TextureAxes) -> dict[str, float | None]:
    """Return model / real of each axis; None where the model has no figure."""
    return {name: None if (figure := model[name]) is None else figure / axis.real for name, axis in AXES.items()}


def _score(model: TextureAxes, factor: float, most: float) -> Scores:
    def similarity(ratio: float) -> float:
        return math.exp(-0.5 * (math.log(min(ratio, most)) / math.log(factor)) ** 2) if ratio > 0 else 0.0

    axes = {name: None if ratio is None else similarity(ratio) for name, ratio in axis_ratios(model).items()}
    measured = [score for score in axes.values() if score is not None]
    return Scores(axes, math.prod(measured) ** (1 / len(measured)) if measured else None, len(measured))
