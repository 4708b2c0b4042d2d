import numpy as np
import pytest
import shapely

from pipeline.geometry.network.skeleton import trace_network
from pipeline.metrics.clearance import measure_walls
from pipeline.types import DriftNetwork
from tests.mines import STRAIGHT


def points_along_walls(free, offset_m):
    """Return dense points along the walls, moved into the workings by an offset."""
    inner = free.buffer(-offset_m, join_style="mitre")
    return shapely.get_coordinates(inner.exterior.segmentize(0.02))


@pytest.fixture(scope="module")
def network():
    return trace_network(STRAIGHT, 0.25, 2.0, 1.0)


def test_rock_on_the_wall_has_no_gap_and_keeps_the_width(network):
    gaps = measure_walls(points_along_walls(STRAIGHT, 0.0), STRAIGHT, network)
    assert gaps.gap_max_m == pytest.approx(0.0, abs=1e-6)
    assert gaps.narrowest_kept == pytest.approx(1.0, abs=0.01)
    assert gaps.narrowest_plan_m == pytest.approx(5.0, abs=0.3)


def test_rock_inside_the_workings_gives_its_gap_and_reduces_the_width(network):
    gaps = measure_walls(points_along_walls(STRAIGHT, 0.25), STRAIGHT, network)
    assert gaps.gap_median_m == pytest.approx(0.25, abs=1e-3)
    assert gaps.into_workings_share == 1.0
    assert gaps.narrowest_kept == pytest.approx(0.9, abs=0.015)


def test_a_room_without_a_passage_keeps_all_of_its_width():
    room = shapely.box(0, 0, 5, 5)
    gaps = measure_walls(
        points_along_walls(room, 0.1), room, DriftNetwork({}, [], [], [], 0, 1, 0.0, [], [], 0.0, 0.25)
    )
    assert (gaps.narrowest_plan_m, gaps.narrowest_kept, gaps.median_kept) == (0.0, 1.0, 1.0)


def test_a_boulder_in_a_drift_gives_a_large_gap(network):
    middle = np.array(network.legs[0].stations_m)[len(network.legs[0].stations_m) // 2]
    boulder = middle + np.column_stack([np.linspace(-0.3, 0.3, 40), np.full(40, 0.2)])
    gaps = measure_walls(np.concatenate([points_along_walls(STRAIGHT, 0.0), boulder]), STRAIGHT, network)
    assert gaps.gap_max_m > 2.0
    assert gaps.median_kept > 0.97
