"""The work of stage 6 on the rock's texture: the six axes of the meshes of the MJCF, in draws of stretches."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from minexplore.bundle import ROOF, WALLS
from pipeline.errors import ArtifactError
from pipeline.metrics.digits import repeatable
from pipeline.metrics.rock.draws import mean_axes, mean_sweep, spread_of
from pipeline.metrics.rock.planefit import Residuals, fit_voxel_planes
from pipeline.metrics.rock.published import REAL_SWEEP
from pipeline.metrics.rock.sampling import faces_near, sample_triangles
from pipeline.metrics.rock.texture import (
    REAL,
    RockPoints,
    Scores,
    TextureAxes,
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
from pipeline.params.validation import TextureReportParams
from pipeline.progress import counted
from pipeline.proof.drawn_points import Sampled, number_of_points, sample_pieces
from pipeline.proof.surface import Drifts, SeenRock, between, split_long, stretch_centres

_Heat = list[tuple[float, float, float]]  # easting and northing, m, and mean sigma, m
_WAVELENGTH = "dominant_wavelength_m"  # the axis that is not measured in a draw
_HEAT_M, _HEAT_POINTS = 0.5, 12
_WALL_POINTS = 400_000
_ON_WALLS_M = 2.0  # of wall that a stretch in the middle of a room holds at least


@dataclass(frozen=True)
class TextureReport:
    """Both readings of the six axes and their scores, the residuals over voxel sizes, and sigma along the mine.

    `published_axes` are measured on points with the paper's noise, `strict_axes` on points without noise. Axes,
    residuals, `roof_unevenness_m` (the alternative reading of the roof axis) and `bump_rms_m` are means over `draws`
    sets of stretches, and scores are those of the mean axes. `published_spread` and `strict_spread` are the standard
    deviations of the overall score between draws, None for one draw. Rows of `heat` are easting, northing and mean
    sigma of 0.5 m voxels, m. `flat` and `flat_strict` are the scores of the smooth surface, measured in the same way
    in fewer stretches: they show what an axis gives without texture.
    """

    published_axes: TextureAxes
    strict_axes: TextureAxes
    published: Scores
    strict: Scores
    draws: int
    published_spread: float | None
    strict_spread: float | None
    residuals: list[Residuals]
    roof_unevenness_m: float
    bump_rms_m: float
    heat: list[tuple[float, float, float]]
    flat: Scores
    flat_strict: Scores


@dataclass(frozen=True)
class Draw:
    """The two readings of the axes in one set of stretches, and its residuals over voxel sizes."""

    as_paper: TextureAxes
    as_is: TextureAxes
    sweep: list[Residuals]
    roof_unevenness_m: float
    bump_rms_m: float

    def with_wavelengths(self, published_m: float | None, along_m: float | None) -> Draw:
        """Return the draw with the wavelengths of both readings, which are not measured in a draw."""
        as_paper, as_is = {**self.as_paper, _WAVELENGTH: published_m}, {**self.as_is, _WAVELENGTH: along_m}
        return dataclasses.replace(self, as_paper=as_paper, as_is=as_is)


@dataclass(frozen=True)
class MeasuredTexture:
    """The texture of one surface in each draw of stretches, and the mean sigma along all its walls."""

    draws: list[Draw]
    heat: list[tuple[float, float, float]]

    @property
    def as_paper(self) -> TextureAxes:
        """Return the mean axes of points with the paper's noise."""
        return mean_axes([draw.as_paper for draw in self.draws])

    @property
    def as_is(self) -> TextureAxes:
        """Return the mean axes of points without noise."""
        return mean_axes([draw.as_is for draw in self.draws])

    @property
    def sweep(self) -> list[Residuals]:
        """Return the mean residuals over voxel sizes."""
        return mean_sweep([draw.sweep for draw in self.draws])


def report_texture(rock: SeenRock, params: TextureReportParams) -> TextureReport:
    """Measure the visible rock of a world on the paper's six axes, and the smooth surface for comparison."""
    found = measure_texture(rock.rough(WALLS), rock.rough(ROOF), rock.drifts, params)
    flat = measure_flat_texture(rock, params)
    return repeatable(
        TextureReport(
            found.as_paper,
            found.as_is,
            published_score(found.as_paper),
            strict_score(found.as_is),
            len(found.draws),
            spread_of([published_score(draw.as_paper).overall for draw in found.draws]),
            spread_of([strict_score(draw.as_is).overall for draw in found.draws]),
            found.sweep,
            float(np.mean([draw.roof_unevenness_m for draw in found.draws])),
            float(np.mean([draw.bump_rms_m for draw in found.draws])),
            found.heat,
            _short(published_score(flat.as_paper)),
            _short(strict_score(flat.as_is)),
        )
    )


def measure_flat_texture(rock: SeenRock, params: TextureReportParams) -> MeasuredTexture:
    """Measure the smooth surface of a world at the same density, in one draw of a quarter of the stretches.

    Smooth surfaces vary little.
    """
    one = part_of(params, 4).model_copy(update={"draws": 1})
    return measure_texture(rock.smooth(WALLS), rock.smooth(ROOF), rock.drifts, one)


def _short(scores: Scores) -> Scores:
    """Return scores of four decimals: angles between normals of a plane are rounding errors that no machine repeats."""
    return Scores({k: _round(v, 4) for k, v in scores.axes.items()}, _round(scores.overall, 4), scores.measured)


def _round(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def part_of(params: TextureReportParams, share: int) -> TextureReportParams:
    """Return the parameters for draws of a `share`-th of the stretches and points."""
    part = max(1, params.stretches // share)
    wall, roof = (max(1000, n * part // params.stretches) for n in (params.wall_points, params.roof_points))
    return params.model_copy(update={"stretches": part, "wall_points": wall, "roof_points": roof})


def measure_texture(
    walls: np.ndarray, roof: np.ndarray, drifts: Drifts, params: TextureReportParams
) -> MeasuredTexture:
    """Measure a surface, given as the triangles (n, 3, 3) of its walls and roof, m, in each draw of stretches.

    Both wavelengths are read once: as the paper from the whole mine, along the walls from the first draw, where they
    differ least.
    """
    rng = np.random.default_rng(params.seed)
    pieces = [split_long(piece) for piece in (walls, roof)]
    _require_both(pieces)
    everywhere = sample_triangles(walls, number_of_points(walls, params.wall_points, params.points_per_m2), rng)[0]
    published_m, heat = _read_whole(everywhere, params)
    draws, along_m = _measure_draws(pieces, drifts, params, rng)
    return MeasuredTexture([draw.with_wavelengths(published_m, along_m) for draw in draws], heat)


def _measure_draws(
    pieces: list[np.ndarray], drifts: Drifts, params: TextureReportParams, rng: np.random.Generator
) -> tuple[list[Draw], float | None]:
    """Return the draws without wavelengths, and the wavelength along the walls of the first one."""
    draws, along_m = list[Draw](), None
    for places in counted(draws_of_places(drifts, params), "texture", "draws"):
        near = [faces_near(piece, places, _reach_m(places, drifts, params)) for piece in pieces]
        _require_both(near)
        on_walls, on_roof = sample_pieces(near, params, rng)
        if not draws:
            wall = between(on_walls.points, params.wall_z_m)
            along_m = wall_wavelength_m(wall[:: max(1, len(wall) // _WALL_POINTS)], drifts.free)
        draws.append(_measure_draw(on_walls, on_roof, params, rng))
    return draws, along_m


def _read_whole(walls: np.ndarray, params: TextureReportParams) -> tuple[float | None, _Heat]:
    """Return the wavelength as the paper reads it, and sigma along the mine, of points (n, 3) m of all walls."""
    return published_wavelength_m(between(walls, params.wall_z_m)), _heat(walls)


def _require_both(pieces: list[np.ndarray]) -> None:
    if not all(map(len, pieces)):
        raise ArtifactError("mine.xml: no visible walls or no roof near the stations; texture needs both")


def _measure_draw(walls: Sampled, roofs: Sampled, params: TextureReportParams, rng: np.random.Generator) -> Draw:
    """Measure one draw without wavelengths: with the paper's noise, and as it is."""
    noisy = [cloud.with_noise(params, rng) for cloud in (walls, roofs)]
    as_paper = measure_axes(_rock_points(noisy[0], noisy[1], params))
    rock = _rock_points(walls.points, roofs.points, params)
    sigma = rock.sweep.bumps.sigma
    bump_rms_m = float(np.sqrt((sigma**2).mean())) if len(sigma) else 0.0
    return Draw(as_paper, measure_axes(rock), rock.sweep.residuals, roof_unevenness_m(rock.roof), bump_rms_m)


def _rock_points(walls: np.ndarray, roof: np.ndarray, params: TextureReportParams) -> RockPoints:
    walls, roof = (
        rotate_about_z(between(points, z_m)) for points, z_m in ((walls, params.wall_z_m), (roof, params.roof_z_m))
    )
    return RockPoints(walls, sweep_walls(walls), roof, None)


def texture_metrics(report: TextureReport) -> dict[str, Any]:
    """Return the figures of the report for `metrics.json`."""
    rounded = {
        kind: {"overall": _round(scores.overall, 4), **{k: _round(v, 4) for k, v in scores.axes.items()}}
        for kind, scores in (("published", report.published), ("strict", report.strict))
    }
    measured = {
        f"measured_{kind}": {k: _round(v, 6) for k, v in axes.items()}
        for kind, axes in (("published", report.published_axes), ("strict", report.strict_axes))
    }
    return {
        **rounded,
        # An axis without a figure is null and is left out of the overall score: so many axes of six are in it.
        "axes_measured": {"published": report.published.measured, "strict": report.strict.measured},
        "draws": report.draws,
        "spread": {"published": _round(report.published_spread, 4), "strict": _round(report.strict_spread, 4)},
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
        "bump_ratio": _round(axis_ratios(report.strict_axes)["bump_rq_m"], 4),
        "bump_rms_ratio": round(report.bump_rms_m / REAL["bump_rq_m"], 4),
        "roof_unevenness_m": round(report.roof_unevenness_m, 4),
    }


def _reach_m(places: np.ndarray, drifts: Drifts, params: TextureReportParams) -> float:
    """Return the radius of stretches, m: in a mine of wide rooms alone, the walls of the narrowest are within it."""
    narrowest = float(drifts.half_width_m[cKDTree(drifts.stations_m).query(places)[1]].min())
    return max(params.stretch_radius_m, narrowest + _ON_WALLS_M)


def draws_of_places(drifts: Drifts, params: TextureReportParams) -> list[np.ndarray]:
    """Return the centres (n, 2), m, of the stretches of each draw, which take turns along the drifts.

    A mine too short for stretches that do not overlap has fewer draws, and at least one.
    """
    count = int(min(params.draws, max(1.0, drifts.length_m // params.draw_m)))
    places = stretch_centres(drifts, count * params.stretches)
    return [places[k::count] for k in range(count)]


def _heat(points: np.ndarray) -> _Heat:
    planes = fit_voxel_planes(points, _HEAT_M, _HEAT_POINTS)
    column, index = np.unique(planes.cell[:, :2], axis=0, return_inverse=True)
    index = index.ravel()
    sigma = np.bincount(index, planes.sigma) / np.bincount(index)
    return [
        (round(float(x), 2), round(float(y), 2), round(float(s), 4))
        for (x, y), s in zip((column + 0.5) * _HEAT_M, sigma, strict=True)
    ]
