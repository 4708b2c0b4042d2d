import math

import numpy as np
import pytest
from scipy.signal import lombscargle

from pipeline.errors import InputError
from pipeline.metrics.rock.profile import (
    _periodogram,
    amplitude_of,
    line_roughness,
    profiles_of_cloud,
    profiles_of_runs,
    spectrum_of,
)
from pipeline.metrics.rock.roughness import roughness_of_cloud, roughness_of_sweeps
from pipeline.scans.sweeps import read_sweep

WAVES = np.geomspace(0.05, 1.0, 200)


def line(offset, length=400.0, step=0.02, seed=0):
    rng = np.random.default_rng(seed)
    s = np.sort(rng.uniform(0, length, round(length / step)))  # uneven, as even bearings give
    return np.column_stack([s, offset(s)])


def test_the_spectrum_of_a_sine_integrates_to_its_variance_at_its_wavelength():
    run = line(lambda s: 0.03 * np.sin(2 * np.pi * s / 0.4))
    spectrum = spectrum_of(profiles_of_runs([run], 4.0), WAVES, 4.0, 0.04)
    density, frequency = np.array(spectrum.psd_m3), 1 / WAVES
    assert WAVES[density.argmax()] == pytest.approx(0.4, rel=0.03)
    near = np.abs(np.log(WAVES / 0.4)) < 0.35
    assert -np.trapezoid(density[near], frequency[near]) == pytest.approx(0.03**2 / 2, rel=0.12)


def test_the_spectrum_of_white_noise_is_flat_and_has_its_variance():
    rng = np.random.default_rng(1)
    step = 0.02
    run = np.column_stack([np.arange(0, 400, step), 0.01 * rng.standard_normal(round(400 / step))])
    spectrum = spectrum_of(profiles_of_runs([run], 4.0), WAVES, 4.0, 0.04)
    assert np.median(spectrum.psd_m3) == pytest.approx(2 * step * 0.01**2, rel=0.1)
    assert np.array(spectrum.psd_m3)[WAVES > 0.5].mean() == pytest.approx(
        np.array(spectrum.psd_m3)[WAVES < 0.1].mean(), rel=0.25
    )


def test_the_spectrum_of_a_fractal_profile_has_its_slope():
    rng = np.random.default_rng(2)
    brown = np.cumsum(rng.standard_normal(80_000)) * 0.001
    run = np.column_stack([np.arange(80_000) * 0.005, brown])
    spectrum = spectrum_of(profiles_of_runs([run], 4.0), WAVES, 4.0, 0.02)
    slope = np.polyfit(np.log(WAVES), np.log(spectrum.psd_m3), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.15)


def test_sampling_footprint_and_window_bound_the_valid_band():
    profiles = profiles_of_runs([line(np.zeros_like, step=0.1)], 4.0)
    low, high = spectrum_of(profiles, WAVES, 4.0, 0.05).valid_m
    assert low == pytest.approx(0.14, abs=0.03)  # twice the median gap of uniform arrivals, 0.1 ln 2
    assert high == 2.0
    assert spectrum_of(profiles, WAVES, 4.0, 0.3).valid_m[0] == 0.3


def test_line_roughness_of_a_parabola_is_its_sagitta_over_window():
    """kappa L^2 / (12 sqrt 5), the RMS of a parabola about its best line."""
    run = np.column_stack([np.linspace(0, 10, 20_001), 0.5 * 0.02 * np.linspace(0, 10, 20_001) ** 2])
    assert line_roughness([run], 1.0) == pytest.approx(0.02 / (12 * math.sqrt(5)), rel=0.06)


@pytest.mark.slow
def test_a_cloud_of_a_rough_wall_has_the_walls_spectrum_and_amplitude():
    rng = np.random.default_rng(3)
    x, z = rng.uniform(0, 20, 400_000), rng.uniform(0, 4, 400_000)
    points = np.column_stack([x, 0.5 + 0.02 * np.sin(2 * np.pi * x / 0.4), z])
    profiles = profiles_of_cloud(points, 2.0)
    spectrum = spectrum_of(profiles, WAVES, 2.0, 0.04)
    assert WAVES[np.argmax(spectrum.psd_m3)] == pytest.approx(0.4, rel=0.05)
    amplitude = amplitude_of(profiles)
    assert amplitude is not None
    assert amplitude.sd_mm == pytest.approx(20 / math.sqrt(2), rel=0.05)
    assert amplitude.kurtosis == pytest.approx(-1.5, abs=0.1)  # a sine's


def test_a_wall_too_short_for_the_band_is_refused_with_both_lengths():
    short = line(np.zeros_like, length=1.5, step=0.02)
    with pytest.raises(InputError, match=r"longest wall .* 1\.\d+ m; a spectrum over 4 m needs 3\.20 m"):
        roughness_of_sweeps({"a": short}, 0.3, 4.0, 0.1)


def test_a_cloud_too_sparse_for_the_band_is_refused():
    with pytest.raises(InputError, match="rock: its 50 points fill"):
        roughness_of_cloud(np.random.default_rng(0).uniform(0, 5, (50, 3)), 2.0, 0.05, "rock")


def test_the_real_sweeps_have_the_roughness_of_an_independent_measurement(shared_mine):
    """The reference values are medians of seven sweeps; four of these are measured here."""
    sweeps = {n: read_sweep(shared_mine / f"sweep_{n}.csv", 9.0, 0.05) for n in ("00S", "11S", "25S", "40S")}
    found = roughness_of_sweeps(sweeps, 0.35, 4.0, 0.3)
    rq = dict(zip(found.window_m, found.rq_m, strict=True))
    for window, reference in ((0.2, 0.0017), (0.3, 0.0029), (0.5, 0.0058), (1.0, 0.015), (2.0, 0.032)):
        assert rq[window] == pytest.approx(reference, rel=0.2)


def test_the_power_of_many_profiles_is_that_of_scipy_for_each():
    rng = np.random.default_rng(5)
    count = rng.integers(24, 60, 40)
    first = np.cumsum(count) - count
    places = [np.sort(rng.uniform(-1, 1, n)) for n in count]
    offsets = [rng.normal(size=n) for n in count]
    for omega in 2 * np.pi / np.array([0.05, 0.2, 0.9, 4.0]):
        found = _periodogram(np.concatenate(places), np.concatenate(offsets), first, count, omega)
        wanted = [lombscargle(x, y, np.array([omega, 1.0]))[0] for x, y in zip(places, offsets, strict=True)]
        np.testing.assert_allclose(found, wanted, rtol=1e-8)
