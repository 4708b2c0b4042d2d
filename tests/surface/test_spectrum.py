import math

import numpy as np
import pytest

from pipeline.errors import GeometryError
from pipeline.surface.relief.noise import slow_modulation, solid_noise, unit_bands
from pipeline.surface.relief.spectrum import Bands, Roughness, band_edges, band_wavelengths, fit_bands, residual_share
from tests.surface.spectra import WAVES, flat_bands, predicted_rq


def test_noise_depends_only_on_the_place_so_no_seam_can_open():
    points = np.random.default_rng(0).uniform(-50, 50, (400, 3))
    whole = solid_noise(points, [flat_bands(0.1)], [np.ones(400)], np.random.default_rng(1))
    parts = [
        solid_noise(half, [flat_bands(0.1)], [np.ones(200)], np.random.default_rng(1)) for half in np.split(points, 2)
    ]
    np.testing.assert_allclose(whole, np.concatenate(parts), atol=1e-9)


def test_noise_has_the_wanted_deviation_and_no_wave_shorter_than_its_bands():
    line = np.column_stack([np.arange(20_000) * 0.01, np.zeros(20_000), np.zeros(20_000)])
    field = solid_noise(line, [flat_bands(0.1)], [np.ones(len(line))], np.random.default_rng(2))
    assert field.std() == pytest.approx(0.1, rel=0.1)
    power = np.abs(np.fft.rfft(field * np.hanning(len(field)))) ** 2
    frequency = np.fft.rfftfreq(len(field), 0.01)
    shortest = band_edges(float(WAVES.min()))[0]
    assert shortest >= 0.4 - 1e-9
    assert power[frequency > 1.02 / shortest].sum() < 1e-4 * power.sum()


def test_every_unit_band_has_a_standard_deviation_of_one():
    points = np.random.default_rng(3).uniform(0, 200, (20_000, 3))
    for unit in unit_bands(points, WAVES, np.random.default_rng(4)):
        assert unit.std() == pytest.approx(1.0, rel=0.05)


def test_slow_modulation_keeps_the_mean_square():
    points = np.random.default_rng(5).uniform(0, 2000, (40_000, 3))
    factor = slow_modulation(points, 8.0, 0.3, np.random.default_rng(6))
    assert factor.min() > 0
    assert (factor**2).mean() == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(("window", "degree", "line"), [(0.5, 1, False), (0.5, 2, False), (1.0, 1, True)])
def test_the_predicted_roughness_is_the_residual_of_fits_to_the_noise(window, degree, line):
    """Solid noise on a plane, fitted by least squares in windows."""
    n, waves = 24, band_wavelengths(0.3, 3.0)
    spectrum = flat_bands(0.05, waves)
    rng = np.random.default_rng(7)
    corner = rng.uniform(0, 400, (400, 1, 2))
    t = (np.arange(n) + 0.5) / n * window
    grid = np.stack([t, np.zeros(n)], -1) if line else np.stack(np.meshgrid(t, t), -1).reshape(-1, 2)
    at = (corner + grid).reshape(-1, 2)
    points = np.column_stack([at, np.zeros(len(at))])
    field = solid_noise(points, [spectrum], [np.ones(len(at))], rng).reshape(400, -1)
    x, y = grid.T
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1) if i + j <= degree and not (line and j)]
    q, _ = np.linalg.qr(np.column_stack([x**i * y**j for i, j in powers]))
    residual = field - field @ q @ q.T
    rq = math.sqrt((residual**2).mean())
    assert predicted_rq(spectrum, Roughness(window, 0.0, degree, line)) == pytest.approx(rq, rel=0.08)


def test_a_fit_removes_the_variance_of_long_waves_and_leaves_that_of_short_ones():
    assert residual_share(50.0, 0.5, 1, False) < 1e-4
    assert residual_share(0.1, 1.0, 1, False) > 0.9


def test_a_fit_to_a_spectrums_own_roughness_reproduces_the_roughness():
    truth = Bands(WAVES, 0.04 * (WAVES / WAVES[0]) ** 0.8)
    wanted = [Roughness(w, predicted_rq(truth, Roughness(w, 0.0))) for w in (0.3, 0.5, 1.0, 2.0)]
    fitted = fit_bands(wanted, WAVES, 1.0)
    for r in wanted:
        assert predicted_rq(fitted, r) == pytest.approx(r.rq_m, rel=0.05)


def test_the_amplitude_bound_holds_and_smooths_long_windows_first():
    wanted = [Roughness(0.5, 0.05), Roughness(2.0, 0.25)]
    bounded = fit_bands(wanted, WAVES, 0.15)
    assert bounded.rms_m <= 0.15 * 1.001
    assert predicted_rq(bounded, wanted[1]) < 0.9 * 0.25


def test_an_empty_band_is_refused():
    with pytest.raises(GeometryError, match=r"no band between 2 m and 1 m"):
        band_wavelengths(2.0, 1.0)
