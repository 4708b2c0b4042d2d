import math

import numpy as np
import pytest
import shapely

from pipeline.metrics.rock.planefit import fit_voxel_planes, normal_scatter_deg, sweep_planes, sweep_residuals
from pipeline.metrics.rock.texture import (
    AXES,
    REAL,
    Axis,
    RockPoints,
    axis_ratios,
    bump_rq_m,
    measure_axes,
    published_score,
    published_wavelength_m,
    roof_irregularity_m,
    roof_unevenness_m,
    rotate_about_z,
    roughness_integral_m2,
    strict_score,
    sweep_walls,
    wall_heterogeneity_m,
    wall_jaggedness_deg,
    wall_wavelength_m,
)

FREE = shapely.box(0, 0, 40, 6)


def wall(offset, n=150_000, seed=0, length=40.0):
    """Return points on a wall along y = 0, from 0.5 to 3 m high, displaced by `offset(x, z)`."""
    rng = np.random.default_rng(seed)
    x, z = rng.uniform(0, length, n), rng.uniform(0.5, 3.0, n)
    return np.column_stack([x, offset(x, z), z])


def sine(amplitude, wavelength):
    return lambda x, z: amplitude * np.sin(2 * np.pi * x / wavelength)


def test_the_papers_published_values_give_its_six_scores():
    scores = published_score({name: axis.paper_model for name, axis in AXES.items()})
    for name, axis in AXES.items():
        assert scores.axes[name] == pytest.approx(axis.paper_score, abs=2e-4)
    assert scores.overall == pytest.approx(0.7941, abs=2e-4)


def test_equal_axes_score_one_and_a_factor_of_two_scores_one_sd():
    assert strict_score(dict(REAL)).overall == 1.0
    double = {name: 2 * figure for name, figure in REAL.items()}
    assert strict_score(double).overall == pytest.approx(math.exp(-0.5))
    assert published_score(double).overall == pytest.approx(math.exp(-0.5 * (math.log(1.5) / math.log(5)) ** 2))


def test_a_plane_scores_almost_zero():
    plane = wall(lambda x, z: np.zeros_like(x))
    flat = np.column_stack([plane[:, 0], plane[:, 2] * 2, np.full(len(plane), 3.4)])
    axes = measure_axes(RockPoints(plane, sweep_walls(plane), flat, wall_wavelength_m(plane, FREE)))
    assert strict_score(axes).overall < 0.01
    assert published_score(axes).overall < 0.01


def test_a_flat_voxel_has_no_residual_whatever_the_processor_rounds():
    x, y = np.random.default_rng(3).uniform(0, 5, (2, 4000))
    planes = fit_voxel_planes(np.column_stack([x, y, 1 + 0.3 * x - 0.7 * y]), 0.5, 20)
    assert len(planes.sigma) > 50
    assert (planes.sigma == 0).all()


def test_an_axis_without_a_figure_is_no_zero_and_is_left_out_of_the_mean():
    short = wall(sine(0.05, 0.4), n=2000, length=3.0)
    assert wall_wavelength_m(short, FREE) is None  # it needs 8 m of wall
    scores = strict_score({**REAL, "dominant_wavelength_m": None})
    assert scores.axes["dominant_wavelength_m"] is None
    assert (scores.overall, scores.measured) == (1.0, 5)
    assert strict_score(dict.fromkeys(AXES)).overall is None


def test_a_new_axis_is_measured_and_scored_without_further_declarations(monkeypatch):
    monkeypatch.setitem(AXES, "mean_height_m", Axis("mean height", lambda rock: float(rock.walls[:, 2].mean()), 1.75))
    plane = wall(lambda x, z: np.zeros_like(x))
    figures = measure_axes(RockPoints(plane, sweep_walls(plane), plane, None))
    assert figures["mean_height_m"] == pytest.approx(1.75, abs=0.01)
    scores = strict_score(figures)
    assert scores.axes["mean_height_m"] == pytest.approx(1.0, abs=0.01)
    assert scores.measured == sum(figure is not None for figure in figures.values())
    assert "mean_height_m" in axis_ratios(figures)


@pytest.mark.parametrize("wavelength", [0.05, 0.1])
def test_the_residual_of_a_sine_wall_is_its_rms(wavelength):
    """A window of whole waves leaves A / sqrt(2) if they are symmetric about its middle; else the plane tilts."""
    even = sine(0.005, wavelength)
    points = wall(lambda x, z: even(x + wavelength / 4, z), n=400_000) + np.array(
        [0, 0.5, 0]
    )  # no voxel border inside the wave
    points = points[points[:, 2] >= 1.0]  # half voxels would tilt more
    found = sweep_residuals(points, (1.0,), 30)[0]
    assert found.rq_m == pytest.approx(0.005 / math.sqrt(2), rel=0.03)
    assert found.ra_m == pytest.approx(0.005 * 2 / math.pi, rel=0.03)
    assert found.rz_m == pytest.approx(0.01, rel=0.03)
    assert found.p95_m == pytest.approx(0.005 * math.sin(math.radians(85.5)), rel=0.03)


def test_the_residual_of_white_noise_is_its_sd_at_every_scale():
    rng = np.random.default_rng(1)
    points = wall(lambda x, z: 0.01 * rng.standard_normal(len(x)))
    points[:, 1] += 0.25  # no voxel border inside the noise
    for found in sweep_residuals(points, (0.3, 0.5, 1.0), 30):
        assert found.rq_m == pytest.approx(0.01, rel=0.05)


def test_residuals_of_a_fractal_wall_grow_with_its_hurst_exponent():
    """Brownian profile, Hurst exponent 0.5: residuals grow as the square root of the window."""
    rng = np.random.default_rng(2)
    step = 0.002
    brown = np.cumsum(rng.standard_normal(round(100 / step))) * 0.003 * math.sqrt(step)
    points = wall(lambda x, z: np.interp(x, np.arange(len(brown)) * step, brown), n=300_000, length=100.0)
    points[:, 1] += 0.25
    found = {r.window_m: r.rq_m for r in sweep_residuals(points, (0.5, 2.0), 30)}
    assert math.log(found[2.0] / found[0.5]) / math.log(4) == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize("wavelength", [0.3, 0.8, 1.757])
def test_the_wavelength_of_a_sine_wall_is_found_along_its_arc(wavelength):
    found = wall_wavelength_m(wall(sine(0.05, wavelength)), FREE)
    assert found == pytest.approx(wavelength, rel=0.06)


def test_the_wavelength_does_not_mix_two_walls():
    """Walls on both sides of a drift: the paper's reading mixes them, the strict one does not."""
    near = wall(sine(0.05, 0.4), n=150_000)
    far = near * [1, -1, 1] + [0, 6, 0]
    both = np.concatenate([near, far])
    assert wall_wavelength_m(both, FREE) == pytest.approx(0.4, rel=0.06)
    assert abs(math.log(published_wavelength_m(both) / 0.4)) > 0.2


def test_the_wavelength_follows_a_bent_wall():
    """A sine along the arc of a round pillar wall."""
    ring = shapely.Point(0, 0).buffer(6.0, quad_segs=64)
    rng = np.random.default_rng(3)
    turn, z = rng.uniform(0, 2 * np.pi, 100_000), rng.uniform(0.5, 3.0, 100_000)
    radius = 6.0 + 0.04 * np.sin(60 * turn)
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])
    assert wall_wavelength_m(points, ring) == pytest.approx(2 * np.pi * 6 / 60, rel=0.06)


def test_a_folded_wall_has_the_jaggedness_of_its_folds():
    """Folds of 45 deg, two voxels per face: at a ridge, two equal normals and one at right angles give atan(1/2)."""
    planes = fit_voxel_planes(wall(lambda x, z: np.abs((x % 1.2) - 0.6), n=400_000), 0.30, 30)
    assert normal_scatter_deg(planes).max() == pytest.approx(math.degrees(math.atan(0.5)), abs=0.1)


def test_a_slanting_wall_is_not_jagged():
    assert wall_jaggedness_deg(fit_voxel_planes(wall(lambda x, z: 0.3 * x), 0.30, 30)) < 0.1


def test_jaggedness_does_not_depend_on_the_signs_of_normals():
    planes = fit_voxel_planes(wall(sine(0.05, 0.7)), 0.30, 30)
    flipped = planes.__class__(
        **{**vars(planes), "normal": planes.normal * np.where(np.arange(len(planes.normal)) % 2, 1, -1)[:, None]}
    )
    np.testing.assert_allclose(normal_scatter_deg(planes), normal_scatter_deg(flipped))


def test_roof_irregularity_ignores_a_vault_and_measures_its_bumps():
    rng = np.random.default_rng(4)
    x, y = rng.uniform(0, 10, 200_000), rng.uniform(0, 6, 200_000)
    vault = 3.6 - 0.05 * (y - 3) ** 2
    assert roof_irregularity_m(np.column_stack([x, y, vault])) < 1e-9
    assert roof_unevenness_m(np.column_stack([x, y, vault])) < 2e-3
    bumpy = vault + 0.02 * np.sin(2 * np.pi * x / 0.1)
    assert roof_irregularity_m(np.column_stack([x, y, bumpy])) == pytest.approx(0.02 / math.sqrt(2), rel=0.05)


def test_heterogeneity_is_the_spread_of_roughness_not_its_size():
    rng = np.random.default_rng(5)
    even = wall(lambda x, z: 0.02 * rng.standard_normal(len(x)) + 0.125)
    patchy = wall(lambda x, z: np.where(np.floor(x / 0.25) % 2, 0.03, 0.01) * rng.standard_normal(len(x)) + 0.125)
    assert wall_heterogeneity_m(even) < 0.004
    assert wall_heterogeneity_m(patchy) == pytest.approx(0.01, rel=0.15)


def test_bump_rq_of_a_wall_along_the_axes_does_not_depend_on_its_place():
    """Without the rotation, a border between voxels cuts the bumps into halves that are each too smooth."""
    rough = wall(lambda x, z: 0.05 * np.sin(2 * np.pi * x / 0.31) * np.sin(2 * np.pi * z / 0.37))
    border, middle = (rough + np.array([0, y, 0]) for y in (2.5, 2.75))
    bump_m = [bump_rq_m(fit_voxel_planes(points, 0.50, 30)) for points in (border, middle)]
    assert bump_m[0] < 0.8 * bump_m[1]
    on_border, inside = (bump_rq_m(fit_voxel_planes(rotate_about_z(points), 0.50, 30)) for points in (border, middle))
    assert on_border == pytest.approx(inside, rel=0.03)


def test_the_integral_of_a_constant_roughness_is_its_area():
    rng = np.random.default_rng(6)
    points = wall(lambda x, z: 0.01 * rng.standard_normal(len(x)), n=500_000, length=8.0)
    points[:, 1] += 0.05
    assert roughness_integral_m2(sweep_walls(points).residuals) == pytest.approx(
        1.9 * 0.01 * math.sqrt(2 / math.pi), rel=0.08
    )


def test_planes_of_full_voxels_are_those_fitted_to_them_alone():
    rng = np.random.default_rng(7)
    points = wall(lambda x, z: 0.15 + 0.02 * rng.standard_normal(len(x)), n=40_000)
    kept, fitted = fit_voxel_planes(points, 0.30, 20).holding(35), fit_voxel_planes(points, 0.30, 35)
    assert 10 < len(fitted.count) < len(fit_voxel_planes(points, 0.30, 20).count)
    for name, values in vars(fitted).items():
        np.testing.assert_array_equal(vars(kept)[name], values)


def test_large_voxels_have_the_sums_of_the_small_ones_within_them():
    points = wall(lambda x, z: 0.15 + 0.02 * np.random.default_rng(8).standard_normal(len(x)), n=20_000, length=4.0)
    points += [400.0, -7.0, 0.0]
    windows = (0.10, 0.15, 0.30, 1.00)  # 0.15 is no multiple of 0.10
    for window, (planes, found) in zip(windows, sweep_planes(points, windows, 20), strict=True):
        alone = fit_voxel_planes(points, window, 20)
        assert len(alone.count) > 10
        np.testing.assert_array_equal(planes.cell, alone.cell)
        np.testing.assert_array_equal(planes.count, alone.count)
        np.testing.assert_allclose(planes.centre, alone.centre, atol=1e-12)
        np.testing.assert_allclose(planes.sigma, alone.sigma, atol=1e-12)
        np.testing.assert_allclose(np.abs((planes.normal * alone.normal).sum(axis=1)), 1, atol=1e-12)
        cell = np.floor(points / window).astype(int)
        away = [
            (points[(cell == at).all(axis=1)] - centre) @ normal
            for at, centre, normal in zip(alone.cell, alone.centre, alone.normal, strict=True)
        ]
        assert found.voxels == len(away)
        assert found.ra_m == pytest.approx(np.abs(np.concatenate(away)).mean(), rel=1e-9)
        assert found.rq_m == pytest.approx(np.sqrt((np.concatenate(away) ** 2).mean()), rel=1e-9)
        assert found.rz_m == pytest.approx(np.mean([np.ptp(of) for of in away]), rel=1e-9)
        assert found.p95_m == pytest.approx(np.percentile(np.abs(np.concatenate(away)), 95), rel=1e-9)
