"""Stage 6's work on the rock: sample the meshes that the MJCF names, and report texture and walls from the points."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from shapely import Polygon

from minexplore.bundle import ROOF, WALLS
from pipeline.metrics.clearance import WallGaps, measure_walls
from pipeline.metrics.digits import repeatable
from pipeline.metrics.planefit import Residuals, fit_voxel_planes
from pipeline.metrics.published import REAL, REAL_SWEEP
from pipeline.metrics.sampling import faces_near, sample_triangles, with_noise
from pipeline.metrics.texture import (
    Scores,
    TextureAxes,
    bump_rq_m,
    published_score,
    published_wavelength_m,
    roof_irregularity_m,
    roof_unevenness_m,
    roughness_integral_m2,
    strict_score,
    sweep_walls,
    turned,
    wall_heterogeneity_m,
    wall_jaggedness_deg,
    wall_wavelength_m,
)
from pipeline.mjcf.bundle import smooth_triangles, visible_triangles
from pipeline.params.validation import TextureReportParams
from pipeline.types import DriftNetwork

_HEAT_M, _HEAT_POINTS = 0.5, 12
_BAND_M = 0.05  # half the height of the band of wall that counts as robot height
_WALL_POINTS = 400_000
_MOST_FACES = 2_000_000


@dataclass(frozen=True)
class TextureReport:
    """Both readings of the six axes and their scores, the residuals over voxel sizes, and sigma along the mine.

    `published_axes` are of points with the paper's noise, `strict_axes` of the mesh as it is; `roof_unevenness_m` is
    the other reading of the roof's axis. `heat` rows are easting, northing, mean sigma (m) of 0.5 m voxels. `flat`
    and `flat_strict` are the scores of the smooth surface, measured in the same way: what an axis gives to no texture.
    """

    published_axes: TextureAxes
    strict_axes: TextureAxes
    published: Scores
    strict: Scores
    residuals: list[Residuals]
    roof_unevenness_m: float
    bump_rms_m: float
    heat: list[tuple[float, float, float]]
    flat: Scores
    flat_strict: Scores


@dataclass(frozen=True)
class _Measured:
    """The two readings of one surface's axes, its residuals over voxel sizes, and the points they were taken from."""

    as_paper: TextureAxes
    as_is: TextureAxes
    sweep: list[Residuals]
    everywhere: np.ndarray
    wall: np.ndarray
    roof: np.ndarray


def report_texture(
    model: mujoco.MjModel, free: Polygon, network: DriftNetwork, params: TextureReportParams
) -> TextureReport:
    """Measure the visible rock of a compiled world on the paper's six axes, and the smooth surface beside it."""
    walls, roof = (visible_triangles(model, piece) for piece in (WALLS, ROOF))
    smooth_walls, smooth_roof = (smooth_triangles(model, piece) for piece in (WALLS, ROOF))
    rock = _measure(walls, roof, free, network, params)
    flat = _measure(smooth_walls, smooth_roof, free, network, _fewer(params))
    sigma = fit_voxel_planes(rock.wall, 0.5, 30).sigma
    return repeatable(TextureReport(
        rock.as_paper, rock.as_is, published_score(REAL, rock.as_paper), strict_score(REAL, rock.as_is), rock.sweep,
        roof_unevenness_m(rock.roof), float(np.sqrt((sigma**2).mean())) if len(sigma) else 0.0,
        _heat(rock.everywhere), _short(published_score(REAL, flat.as_paper)), _short(strict_score(REAL, flat.as_is)),
    ))  # fmt: skip


def _short(scores: Scores) -> Scores:
    """Return scores of four decimals: angles between normals of a plane are rounding errors, repeated to no digit."""
    return Scores({k: round(v, 4) for k, v in scores.axes.items()}, round(scores.overall, 4))


def _fewer(params: TextureReportParams) -> TextureReportParams:
    """Return the parameters for a quarter of the stretches at the same density: a smooth surface is alike all over."""
    part = max(1, params.stretches // 4)
    wall, roof = (max(1000, n * part // params.stretches) for n in (params.wall_points, params.roof_points))
    return params.model_copy(update={"stretches": part, "wall_points": wall, "roof_points": roof})


def _measure(
    walls: np.ndarray, roof: np.ndarray, free: Polygon, network: DriftNetwork, params: TextureReportParams
) -> _Measured:
    """Measure a surface, given as the triangles (n, 3, 3) of its walls and roof, m."""
    rng = np.random.default_rng(params.seed)
    everywhere, _ = sample_triangles(walls, _count(walls, params.wall_points, params.points_per_m2), rng)
    places = _places(network, params.stretches)
    near, far_up = (faces_near(_fine(c), places, params.stretch_radius_m) for c in (walls, roof))
    wall, wall_normal = sample_triangles(near, _count(near, params.wall_points, params.points_per_m2), rng)
    roof, roof_normal = sample_triangles(far_up, _count(far_up, params.roof_points, params.points_per_m2), rng)
    noise = (params.noise_normal_m, params.noise_in_plane_m, rng)
    noisy_wall = _between(with_noise(wall, wall_normal, *noise), params.wall_z_m)
    noisy_roof = _between(with_noise(roof, roof_normal, *noise), params.roof_z_m)
    wall, roof = _between(wall, params.wall_z_m), _between(roof, params.roof_z_m)
    along_m = wall_wavelength_m(wall[:: max(1, len(wall) // _WALL_POINTS)], free)
    wall, roof, noisy_wall, noisy_roof = map(turned, (wall, roof, noisy_wall, noisy_roof))
    sweep = sweep_walls(wall)
    as_paper = _axes(
        noisy_wall, sweep_walls(noisy_wall), noisy_roof,
        published_wavelength_m(_between(everywhere, params.wall_z_m)),
    )  # fmt: skip
    return _Measured(as_paper, _axes(wall, sweep, roof, along_m), sweep, everywhere, wall, roof)


def texture_metrics(report: TextureReport) -> dict[str, Any]:
    """Return the report's figures for `metrics.json`."""
    rounded = {
        kind: {"overall": round(scores.overall, 4), **{k: round(v, 4) for k, v in scores.axes.items()}}
        for kind, scores in (("published", report.published), ("strict", report.strict))
    }
    measured = {
        f"measured_{kind}": {k: round(v, 6) for k, v in dataclasses.asdict(axes).items()}
        for kind, axes in (("published", report.published_axes), ("strict", report.strict_axes))
    }
    return {
        **rounded,
        **measured,
        "flat_walls": {
            kind: scores.axes for kind, scores in (("published", report.flat), ("strict", report.flat_strict))
        },
        # Two readings of one rock. `rq_ratio` is the RMS over all points, as in the published sweep of windows.
        # `bump_ratio` is the mean over 0.5 m voxels, as the published bump Rq: a voxel with only the edge of a wall
        # counts in full and is smooth. The default world's mean sigma is 32 mm in the quarter of the voxels with the
        # fewest points, 82 mm in the fullest; a fifth of the points leaves fewer edges with 30, and reads 18 % more.
        "rq_ratio": {
            f"at_{100 * ours.window_m:.0f}_cm": round(ours.rq_m / real.rq_m, 4)
            for ours in report.residuals
            for real in REAL_SWEEP
            if real.window_m == ours.window_m
        },
        "bump_ratio": round(report.strict_axes.bump_rq_m / REAL.bump_rq_m, 4),
        "bump_rms_ratio": round(report.bump_rms_m / REAL.bump_rq_m, 4),
        "roof_unevenness_m": round(report.roof_unevenness_m, 4),
    }


def report_walls(model: mujoco.MjModel, free: Polygon, network: DriftNetwork, height_m: float, seed: int) -> WallGaps:
    """Compare the visible walls at a height with the walls that collide."""
    walls = visible_triangles(model, WALLS)
    z = walls[:, :, 2]
    band = walls[(z.max(axis=1) > height_m - _BAND_M) & (z.min(axis=1) < height_m + _BAND_M)]
    points, _ = sample_triangles(_fine(band), _WALL_POINTS, np.random.default_rng(seed))
    return measure_walls(_between(points, (height_m - _BAND_M, height_m + _BAND_M))[:, :2], free, network)


def _axes(walls: np.ndarray, sweep: list[Residuals], roof: np.ndarray, wavelength_m: float) -> TextureAxes:
    return TextureAxes(
        wall_jaggedness_deg(walls), bump_rq_m(walls), roughness_integral_m2(sweep), wavelength_m,
        roof_irregularity_m(roof), wall_heterogeneity_m(walls),
    )  # fmt: skip


def _places(network: DriftNetwork, count: int) -> np.ndarray:
    """Return places (n, 2) m at even shares of all stations, the first and the last left out."""
    stations = np.array([p for leg in network.legs for p in leg.stations_m])
    return stations[np.linspace(0, len(stations) - 1, count + 2).round().astype(int)[1:-1]]


def _count(corners: np.ndarray, most: int, per_m2: float) -> int:
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return max(1000, min(most, int(per_m2 * np.linalg.norm(sides, axis=1).sum() / 2)))


def _fine(corners: np.ndarray, longest_m: float = 3.0) -> np.ndarray:
    """Split triangles until none is longer than `longest_m`, so that a place can be told of each.

    It stops at two million: a mesh in the wrong units would be split until no memory is left.
    """
    while 0 < len(corners) < _MOST_FACES:
        sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = sides.max(axis=1) > longest_m
        if not long.any():
            break
        at = sides[long].argmax(axis=1)[:, None]
        a, b, c = (np.take_along_axis(corners[long], ((at + k) % 3)[:, :, None], axis=1)[:, 0] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([corners[~long], np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return corners


def _between(points: np.ndarray, z_m: tuple[float, float]) -> np.ndarray:
    return points[(points[:, 2] >= z_m[0]) & (points[:, 2] <= z_m[1])]


def _heat(points: np.ndarray) -> list[tuple[float, float, float]]:
    planes = fit_voxel_planes(points, _HEAT_M, _HEAT_POINTS)
    column, index = np.unique(planes.cell[:, :2], axis=0, return_inverse=True)
    index = index.ravel()
    sigma = np.bincount(index, planes.sigma) / np.bincount(index)
    return [
        (round(float(x), 2), round(float(y), 2), round(float(s), 4))
        for (x, y), s in zip((column + 0.5) * _HEAT_M, sigma, strict=True)
    ]
