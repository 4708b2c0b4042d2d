"""The work of stage 6 on the rock: sample the meshes of the MJCF, and report texture and walls from the points."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import ROOF, WALLS
from pipeline.errors import ArtifactError
from pipeline.metrics.axes import TextureAxes
from pipeline.metrics.clearance import WallGaps, measure_walls
from pipeline.metrics.digits import repeatable
from pipeline.metrics.planefit import Residuals, fit_voxel_planes
from pipeline.metrics.published import REAL, REAL_SWEEP
from pipeline.metrics.relief import Relief, measure_relief
from pipeline.metrics.sampling import faces_near, sample_triangles, with_noise
from pipeline.metrics.texture import (
    Scores,
    axis_ratios,
    measure_axes,
    published_score,
    published_wavelength_m,
    roof_unevenness_m,
    rotate_about_z,
    strict_score,
    sweep_walls,
    wall_wavelength_m,
)
from pipeline.mjcf.bundle import Unfold, smooth_triangles, visible_triangles
from pipeline.params.validation import TextureReportParams
from pipeline.types import DriftNetwork

_HEAT_M, _HEAT_POINTS = 0.5, 12
_BAND_M = 0.05  # half height of the band of wall around the robot's height
_WALL_POINTS = 400_000
_MOST_FACES = 2_000_000
_FLAT_RADIUS_M = 4.0


@dataclass(frozen=True)
class TextureReport:
    """Both readings of the six axes and their scores, the residuals over voxel sizes, and sigma along the mine.

    `published_axes` are measured on points with the paper's noise, `strict_axes` on points without noise.
    `roof_unevenness_m` is the alternative reading of the roof axis. Rows of `heat` are easting, northing and mean sigma
    of 0.5 m voxels, m. `flat` and `flat_strict` are the scores of the smooth surface, measured in the same way: they
    show what an axis gives without texture.
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
class MeasuredTexture:
    """The two readings of the axes of one surface, its residuals over voxel sizes, and its points."""

    as_paper: TextureAxes
    as_is: TextureAxes
    sweep: list[Residuals]
    everywhere: np.ndarray
    wall: np.ndarray
    roof: np.ndarray


def report_texture(
    model: mujoco.MjModel,
    free: Polygon,
    network: DriftNetwork,
    params: TextureReportParams,
    unfold: Unfold | None = None,
) -> TextureReport:
    """Measure the visible rock of a compiled world on the paper's six axes, and the smooth surface for comparison.

    Rock that follows a floor's heights is measured in the plan.
    """
    walls, roof = (visible_triangles(model, piece, unfold) for piece in (WALLS, ROOF))
    smooth_walls, smooth_roof = (smooth_triangles(model, piece, unfold) for piece in (WALLS, ROOF))
    rock = measure_texture(walls, roof, free, network, params)
    flat = measure_texture(smooth_walls, smooth_roof, free, network, _quarter(params))
    sigma = fit_voxel_planes(rock.wall, 0.5, 30).sigma
    return repeatable(
        TextureReport(
            rock.as_paper,
            rock.as_is,
            published_score(REAL, rock.as_paper),
            strict_score(REAL, rock.as_is),
            rock.sweep,
            roof_unevenness_m(rock.roof),
            float(np.sqrt((sigma**2).mean())) if len(sigma) else 0.0,
            _heat(rock.everywhere),
            _short(published_score(REAL, flat.as_paper)),
            _short(strict_score(REAL, flat.as_is)),
        )
    )


def _short(scores: Scores) -> Scores:
    """Return scores of four decimals: angles between normals of a plane are rounding errors that no machine repeats."""
    return Scores({k: _round(v, 4) for k, v in scores.axes.items()}, _round(scores.overall, 4), scores.measured)


def _round(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _quarter(params: TextureReportParams) -> TextureReportParams:
    """Return the parameters for a quarter of the stretches at the same density; smooth surfaces vary little."""
    part = max(1, params.stretches // 4)
    wall, roof = (max(1000, n * part // params.stretches) for n in (params.wall_points, params.roof_points))
    return params.model_copy(update={"stretches": part, "wall_points": wall, "roof_points": roof})


def measure_texture(
    walls: np.ndarray, roof: np.ndarray, free: Polygon, network: DriftNetwork, params: TextureReportParams
) -> MeasuredTexture:
    """Measure a surface, given as the triangles (n, 3, 3) of its walls and roof, m."""
    rng = np.random.default_rng(params.seed)
    places = stretch_centres(network, params.stretches)
    near_walls, near_roof = (faces_near(_split_long(c), places, params.stretch_radius_m) for c in (walls, roof))
    if not (len(near_walls) and len(near_roof)):
        raise ArtifactError("mine.xml: no visible walls or no roof near the stations; texture needs both")
    everywhere, _ = sample_triangles(walls, _count(walls, params.wall_points, params.points_per_m2), rng)
    wall, wall_normal = sample_triangles(near_walls, _count(near_walls, params.wall_points, params.points_per_m2), rng)
    roof, roof_normal = sample_triangles(near_roof, _count(near_roof, params.roof_points, params.points_per_m2), rng)
    noise = (params.noise_normal_m, params.noise_in_plane_m, rng)
    noisy_wall = _between(with_noise(wall, wall_normal, *noise), params.wall_z_m)
    noisy_roof = _between(with_noise(roof, roof_normal, *noise), params.roof_z_m)
    wall, roof = _between(wall, params.wall_z_m), _between(roof, params.roof_z_m)
    along_m = wall_wavelength_m(wall[:: max(1, len(wall) // _WALL_POINTS)], free)
    wall, roof, noisy_wall, noisy_roof = map(rotate_about_z, (wall, roof, noisy_wall, noisy_roof))
    sweep = sweep_walls(wall)
    as_paper = measure_axes(
        noisy_wall,
        sweep_walls(noisy_wall),
        noisy_roof,
        published_wavelength_m(_between(everywhere, params.wall_z_m)),
    )
    return MeasuredTexture(as_paper, measure_axes(wall, sweep, roof, along_m), sweep, everywhere, wall, roof)


def texture_metrics(report: TextureReport) -> dict[str, Any]:
    """Return the figures of the report for `metrics.json`."""
    rounded = {
        kind: {"overall": _round(scores.overall, 4), **{k: _round(v, 4) for k, v in scores.axes.items()}}
        for kind, scores in (("published", report.published), ("strict", report.strict))
    }
    measured = {
        f"measured_{kind}": {k: _round(v, 6) for k, v in dataclasses.asdict(axes).items()}
        for kind, axes in (("published", report.published_axes), ("strict", report.strict_axes))
    }
    return {
        **rounded,
        # An axis without a figure is null and is left out of the overall score: so many axes of six are in it.
        "axes_measured": {"published": report.published.measured, "strict": report.strict.measured},
        **measured,
        "flat_walls": {
            kind: scores.axes for kind, scores in (("published", report.flat), ("strict", report.flat_strict))
        },
        # A mean over voxels and a mean over points differ. `bump_ratio` uses the mean of the voxels' RMS residuals, as
        # the published bump Rq does: every voxel counts once, even one that holds only a smooth edge of the wall.
        # `rq_ratio` uses the RMS over all points, as the published residuals over voxel sizes do.
        "rq_ratio": {
            f"at_{100 * residuals.window_m:.0f}_cm": round(residuals.rq_m / real.rq_m, 4)
            for residuals in report.residuals
            for real in REAL_SWEEP
            if real.window_m == residuals.window_m
        },
        "bump_ratio": _round(axis_ratios(REAL, report.strict_axes)["bump_rq_m"], 4),
        "bump_rms_ratio": round(report.bump_rms_m / vars(REAL)["bump_rq_m"], 4),
        "roof_unevenness_m": round(report.roof_unevenness_m, 4),
    }


def report_walls(
    model: mujoco.MjModel,
    free: Polygon,
    network: DriftNetwork,
    height_m: float,
    seed: int,
    unfold: Unfold | None = None,
    lines: BaseGeometry | None = None,
) -> WallGaps:
    """Compare the visible walls at a height with the collision walls: `lines`, by default the outline's boundary."""
    walls = visible_triangles(model, WALLS, unfold)
    z = walls[:, :, 2]
    band = walls[(z.max(axis=1) > height_m - _BAND_M) & (z.min(axis=1) < height_m + _BAND_M)]
    points, _ = sample_triangles(_split_long(band), _WALL_POINTS, np.random.default_rng(seed))
    return measure_walls(_between(points, (height_m - _BAND_M, height_m + _BAND_M))[:, :2], free, network, lines)


def report_relief(
    model: mujoco.MjModel,
    free: Polygon,
    network: DriftNetwork,
    stretches: int,
    unfold: Unfold | None = None,
    lines: BaseGeometry | None = None,
) -> Relief:
    """Measure the shape of the visible walls of a compiled world along `lines`, by default the outline's boundary."""
    walls, roof = (visible_triangles(model, piece, unfold) for piece in (WALLS, ROOF))
    return relief_of(walls, roof, free, network, stretches, lines)


def relief_of(
    walls: np.ndarray,
    roof: np.ndarray,
    free: Polygon,
    network: DriftNetwork,
    stretches: int,
    lines: BaseGeometry | None = None,
) -> Relief:
    """Measure walls (n, 3, 3) m; flat faces are searched in walls and roof near evenly spaced stations."""
    places = stretch_centres(network, stretches)
    sample = np.concatenate([faces_near(piece, places, _FLAT_RADIUS_M) for piece in (walls, roof)])
    return measure_relief(walls, sample, free, lines)


def stretch_centres(network: DriftNetwork, count: int) -> np.ndarray:
    """Return `count` places (n, 2), m, spaced evenly over all stations, without the first and the last."""
    stations = np.array([p for leg in network.legs for p in leg.stations_m])
    return stations[np.linspace(0, len(stations) - 1, count + 2).round().astype(int)[1:-1]]


def _count(triangles: np.ndarray, most: int, per_m2: float) -> int:
    sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return max(1000, min(most, int(per_m2 * np.linalg.norm(sides, axis=1).sum() / 2)))


def _split_long(triangles: np.ndarray, longest_m: float = 3.0) -> np.ndarray:
    """Split triangles until no side is longer than `longest_m`, so that a centre locates each triangle.

    It stops at two million triangles, so that a mesh in wrong units does not exhaust the memory.
    """
    while 0 < len(triangles) < _MOST_FACES:
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        long = sides.max(axis=1) > longest_m
        if not long.any():
            break
        at = sides[long].argmax(axis=1)[:, None]
        a, b, c = (np.take_along_axis(triangles[long], ((at + k) % 3)[:, :, None], axis=1)[:, 0] for k in range(3))
        middle = (a + b) / 2
        halves = np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)
        triangles = np.concatenate([triangles[~long], *halves])
    return triangles


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
