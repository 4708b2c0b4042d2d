import numpy as np
import pytest
import shapely

from pipeline.geometry.rock.collision import exact_prisms
from pipeline.metrics.containment import cover_walls, depth_m, open_area_m2
from pipeline.metrics.reach import compare_reach, reached_cells
from pipeline.types import Frame

FREE = shapely.box(0, 0, 20, 5)
WORLD = shapely.box(-5, -5, 25, 10)


def parts():
    prisms = exact_prisms([WORLD.difference(FREE)], 3.0)
    return [np.array(prisms[i]) for i in range(len(prisms))]


def cover(of):
    return cover_walls(of, FREE, WORLD, (0.5, 1.5, 2.9))


def test_exact_prisms_have_no_missing_rock_and_no_intrusion():
    found = cover(parts())
    assert (found.intrusion_m2, found.missing_m2) == pytest.approx((0, 0), abs=1e-9)
    assert (found.intrusion_mm, found.missing_mm, found.gap_mm) == (0, 0, 0)


def test_a_removed_prism_is_measured_as_missing_area_and_as_a_gap_in_the_wall():
    rest = parts()
    removed = shapely.convex_hull(shapely.multipoints(rest.pop(0)[:, :2]))
    found = cover(rest)
    assert found.missing_m2 == pytest.approx(removed.area, rel=1e-6)
    assert found.gap_mm == pytest.approx(1e3 * FREE.boundary.intersection(removed.buffer(1e-9)).length, abs=20)
    circle = shapely.maximum_inscribed_circle(removed, 1e-4).length
    assert found.missing_mm == pytest.approx(2e3 * circle, abs=0.5)


@pytest.mark.parametrize("size_m", [0.01, 0.1, 5.0])
def test_the_depth_of_rock_in_the_workings_is_its_largest_distance_from_a_wall(size_m):
    block = shapely.box(8, 0, 8 + size_m, size_m)
    assert depth_m(block, FREE) == pytest.approx(min(size_m, 2.5), abs=1e-4)  # half of the drift's width at most


def test_a_thin_wall_across_a_drift_is_as_deep_as_half_the_drift():
    wall = np.array([[x, y, z] for x in (10.0, 10.0003) for y in (0.0, 5.0) for z in (0.0, 3.0)])
    assert cover([*parts(), wall]).intrusion_mm == pytest.approx(2500, abs=0.2)


def test_a_lifted_prism_and_a_leaning_prism_are_detected():
    lifted = parts()
    lifted[0] = lifted[0] + [0, 0, 0.8]
    assert cover(lifted).missing_m2 > 1
    leaning = parts()
    leaning[0] = leaning[0] + np.column_stack(
        [np.zeros((len(leaning[0]), 1)), 0.4 * leaning[0][:, 2:], np.zeros((len(leaning[0]), 1))]
    )
    found = cover(leaning)
    assert found.intrusion_m2 + found.missing_m2 > 0.1


def test_the_open_floor_is_the_area_between_slabs():
    assert open_area_m2([(-5, -5, 8, 10), (9, -5, 25, 10)], FREE) == pytest.approx(5.0)
    assert open_area_m2([(-5, -5, 25, 10)], FREE) == 0


def test_a_robot_reaches_connected_cells_and_a_wall_across_a_drift_changes_the_graph():
    frame = Frame(4.0, 0.0, 40.0, 200, 40)  # 50 m by 10 m
    clearance = np.zeros((40, 200))
    clearance[10:30, 4:196] = 1.0
    whole = reached_cells(clearance >= 0.35, (20, 10))
    assert whole.sum() == 20 * 192
    cut = clearance.copy()
    cut[:, 100:104] = 0.0
    half = reached_cells(cut >= 0.35, (20, 10))
    assert half.sum() == 20 * 96
    same = compare_reach(whole, whole, frame, 0.35, 0.25, 2.0)
    assert same.same_graph
    assert same.largest_chainage_difference_m == 0
    other = compare_reach(whole, half, frame, 0.35, 0.25, 2.0)
    assert other.only_plan_m2 == pytest.approx(20 * 96 / 16)
    assert not other.same_graph
    assert reached_cells(clearance >= 0.35, (0, 0)).sum() == 0


@pytest.mark.parametrize("shift", [2, 4, 6])
def test_a_crossing_that_the_skeleton_splits_into_two_junctions_is_one_node(shift):
    def crossing(shift):
        cells = np.zeros((200, 200), bool)
        cells[90:110, 4:196] = cells[4:100, 90:110] = cells[100:196, 90 + shift : 110 + shift] = True
        return cells

    frame = Frame(4.0, 0.0, 0.0, 200, 200)
    match = compare_reach(crossing(0), crossing(shift), frame, 0.35, 0.25, 2.0)
    assert match.same_graph
    assert match.largest_chainage_difference_m == pytest.approx(shift / 4, abs=0.1)
    assert not compare_reach(crossing(0), crossing(12), frame, 0.35, 0.25, 2.0).same_graph  # 3 m: two junctions
