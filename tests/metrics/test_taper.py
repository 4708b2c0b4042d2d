import numpy as np
import pytest
from scipy import signal

from pipeline.metrics.taper import detrend, hann


@pytest.mark.parametrize("count", [2, 3, 257, 320])
def test_the_window_is_that_of_scipy(count):
    np.testing.assert_allclose(hann(count), signal.windows.hann(count), atol=1e-15)


def test_a_line_has_no_trend_left_and_other_series_lose_what_scipy_takes():
    place = np.arange(320.0)
    np.testing.assert_allclose(detrend(3.0 - 0.2 * place), 0.0, atol=1e-12)
    values = np.random.default_rng(5).standard_normal(320) + 0.1 * place
    np.testing.assert_allclose(detrend(values), signal.detrend(values), atol=1e-12)
