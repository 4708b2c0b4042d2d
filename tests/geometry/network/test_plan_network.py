"""The drift network of legs seen from above: junctions, ends, rings, and the long way through."""

import pytest
import shapely

from pipeline.geometry.network.plan_network import plan_network, seen_network
from tests.volume_worlds import HEADER, RAMP, legs_of_table

RING = HEADER + "A,1,0,0,0,2,2,3,0\nA,2,30,0,0,2,2,3,0\nA,3,30,30,0,2,2,3,0\nA,4,0,30,0,2,2,3,0\nA,1,0,0,0,2,2,3,0\n"
TEE = RAMP + "B,2,30,0,0,1,2,3,0\nB,5,30,10,0,1,2,3,0\n"
LOOP = TEE + "C,5,30,10,0,1,2,3,0\nC,3,60,0,-6,2,2,3,0\n"


def network_of(text, folder):
    return plan_network(legs_of_table(text, folder), 0.25)


def test_a_junction_parts_legs_and_a_station_on_the_way_does_not(tmp_path):
    found = network_of(TEE, tmp_path)
    assert (len(found.junctions), len(found.dead_ends), found.loops, found.components) == (1, 3, 0, 1)
    assert len(found.legs) == 3
    straight = network_of(RAMP, tmp_path)
    assert (len(straight.legs), straight.junctions) == (1, [])
    assert len(straight.legs[0].stations_m) == 3


def test_half_widths_are_half_the_distance_between_the_walls_and_lengths_are_those_in_space(tmp_path):
    found = network_of(TEE, tmp_path)
    (side,) = [leg for leg in found.legs if leg.length_m == pytest.approx(10)]
    assert side.half_width_m[-1] == 1.5
    assert found.total_length_m == pytest.approx(30 + (30**2 + 6**2) ** 0.5 + 10, abs=0.02)


def test_a_loop_is_counted_and_a_ring_without_a_junction_is_one_leg(tmp_path):
    assert network_of(LOOP, tmp_path).loops == 1
    ring = network_of(RING, tmp_path)
    assert (ring.loops, len(ring.legs), ring.dead_ends) == (1, 1, [])
    assert ring.legs[0].start == ring.legs[0].end
    assert ring.total_length_m == pytest.approx(120)


def test_the_main_drift_is_the_way_between_the_ends_that_are_farthest_apart(tmp_path):
    found = network_of(TEE, tmp_path)
    assert found.main_drift_m in ([(0, 0), (30, 0), (60, 0)], [(60, 0), (30, 0), (0, 0)])
    assert found.main_drift_length_m == pytest.approx(30 + (30**2 + 6**2) ** 0.5, abs=0.01)


def test_a_view_from_above_has_a_network_where_passages_and_pillars_are_thinner_than_any_cell():
    drift = shapely.box(0, 0, 30, 3)
    crack = shapely.box(29.9, 1.0, 32, 1.004)  # to a room of 4 m2
    thin_walled = drift | crack | shapely.box(32, 0, 34, 2)
    view = thin_walled - shapely.box(10, 0.004, 12, 1) - shapely.box(20, 1, 22, 2)
    found = seen_network(view, cell_m=0.25, min_leg_m=2.0, station_spacing_m=1.0)
    assert found.loops == 1  # round the second pillar; the first is as good as at the wall
    assert 25 < found.main_drift_length_m < 35


def test_in_a_view_from_above_rooms_and_pillars_that_touch_at_corners_hang_together_by_nothing():
    rooms = shapely.box(0, 0, 30, 12) | shapely.box(29.994, 11.994, 40, 15)
    view = rooms - (shapely.box(8, 4, 12, 6) | shapely.box(11.994, 5.994, 14, 8))
    found = seen_network(view, cell_m=0.25, min_leg_m=2.0, station_spacing_m=1.0)
    assert (found.loops, found.components) == (1, 1)
    assert max(x for x, _ in found.nodes_m.values()) < 30
