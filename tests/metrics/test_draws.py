"""Means over draws: figures that some draws lack, voxels, and the spread."""

import pytest

from pipeline.metrics.rock.axes import TextureAxes
from pipeline.metrics.rock.draws import mean_of, mean_sweep, spread_of
from pipeline.metrics.rock.planefit import Residuals


def test_a_figure_that_some_draws_lack_is_the_mean_of_the_others():
    one, two = TextureAxes(10.0, 0.2, None, None, 0.1, 0.3), TextureAxes(20.0, 0.4, 0.6, None, 0.1, 0.3)
    assert mean_of([one, two]) == TextureAxes(15.0, pytest.approx(0.3), 0.6, None, 0.1, 0.3)


def test_residuals_are_averaged_by_voxel_size_and_their_voxels_counted_together():
    small, large = Residuals(0.1, 1.0, 2.0, 3.0, 4.0, 10), Residuals(2.0, 5.0, 6.0, 7.0, 8.0, 20)
    assert mean_sweep([[small], [Residuals(0.1, 3.0, 4.0, 5.0, 6.0, 30), large]]) == [
        Residuals(0.1, 2.0, 3.0, 4.0, 5.0, 40),
        large,
    ]


def test_one_draw_has_no_spread():
    assert spread_of([0.6]) is None
    assert spread_of([0.6, None]) is None
    assert spread_of([0.6, 0.8]) == pytest.approx(0.2 / 2**0.5)
