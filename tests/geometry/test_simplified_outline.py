"""The outline of fewest corners: a setting that would change the drift network is halved or refused."""

import numpy as np
import pytest
import shapely
from shapely import Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.floor.simplified_outline import NetworkGrid, simplify_by_tolerance, simplify_by_wall_error
from pipeline.geometry.outline.trace import simplify_to_wall_error

GRID = NetworkGrid(cell_m=0.1, min_leg_m=1.0, spacing_m=3.0)
_X = np.linspace(0, 60, 601)
_WAVE = 3 * np.sin(_X / 4)
BENDS = Polygon(np.vstack([np.column_stack([_X, _WAVE + 1]), np.column_stack([_X, _WAVE - 1])[::-1]]))


def test_a_wall_error_that_would_close_a_bent_drift_is_halved_until_the_network_stays():
    found = simplify_by_wall_error(BENDS, 1.0, GRID)
    assert shapely.equals_exact(found.outline, simplify_to_wall_error(BENDS, 0.5))
    assert (found.network.loops, found.network.components) == (0, 1)
    assert 0.5 < found.moved_m <= 8.0


def test_a_tolerance_that_would_close_a_bent_drift_is_refused():
    with pytest.raises(GeometryError, match=r"contours\.tolerance_m = 4 would change the topology"):
        simplify_by_tolerance(BENDS, 4.0, GRID)
    assert simplify_by_tolerance(BENDS, 0.05, GRID).moved_m == 0.05
