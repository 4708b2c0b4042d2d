import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from shapely import Polygon
from shapely.geometry.polygon import orient

from pipeline.errors import GeometryError
from pipeline.geometry.rock.partition import convex_partition, merge_convex, rock_around, triangulate, world_box
from tests.mines import RING, STRAIGHT, TEE, random_mine


def rock_of(mine):
    return rock_around(mine, world_box(mine, 2.0, mine.bounds))


def counter_clockwise(points, faces):
    (ux, uy), (vx, vy) = ((points[faces[:, k]] - points[faces[:, 0]]).T for k in (1, 2))
    return np.where((ux * vy < uy * vx)[:, None], faces[:, ::-1], faces).tolist()


@pytest.mark.parametrize("mine", [STRAIGHT, RING, TEE], ids=["straight", "ring", "tee"])
def test_the_partition_covers_the_rock_exactly(mine):
    rock = rock_of(mine)
    parts = [Polygon(part) for polygon in rock for part in convex_partition(polygon)]
    assert sum(p.area for p in parts) == pytest.approx(sum(r.area for r in rock), abs=1e-9)
    assert shapely.union_all(parts).intersection(mine).area == pytest.approx(0, abs=1e-9)


def test_rock_around_one_rectangle_has_four_parts():
    assert len(convex_partition(rock_of(STRAIGHT)[0])) == 4


def test_a_convex_island_is_one_part():
    island, outer = sorted(rock_of(RING), key=lambda r: -r.bounds[0])
    assert len(convex_partition(island)) == 1
    assert len(convex_partition(outer)) == 4


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 8))
@settings(deadline=None, max_examples=60)
def test_parts_of_a_random_mine_are_convex_disjoint_and_complete(seed, drifts):
    mine = random_mine(np.random.default_rng(seed), drifts).simplify(0.2)
    for polygon in rock_of(mine):
        parts = convex_partition(polygon)
        for part in parts:
            u, v = np.roll(part, -1, axis=0) - part, np.roll(part, -2, axis=0) - np.roll(part, -1, axis=0)
            assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] >= -1e-9).all()
        areas = [Polygon(part).area for part in parts]
        assert sum(areas) == pytest.approx(polygon.area, rel=1e-9)
        assert shapely.union_all([Polygon(part) for part in parts]).area == pytest.approx(polygon.area, rel=1e-9)


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=20)
def test_there_are_no_more_parts_than_the_bound_of_hertel_and_mehlhorn(seed):
    # At most two diagonals remain at a reflex vertex, and each adds a part; each hole needs a diagonal that adds none.
    rock = orient(rock_of(random_mine(np.random.default_rng(seed), 6).simplify(0.1))[0])
    reflex = 0
    for ring in (rock.exterior, *rock.interiors):
        xy = np.asarray(ring.coords)[:-1]
        u, v = xy - np.roll(xy, 1, axis=0), np.roll(xy, -1, axis=0) - xy
        reflex += int((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0).sum())
    assert len(convex_partition(rock)) <= 2 * reflex + 1 - len(rock.interiors)
    assert len(convex_partition(rock)) < len(triangulate(rock)[1])


def test_triangles_round_points_on_a_line_are_joined_without_spikes():
    """Two loops that a straight line of three points parts share two edges; joined across one, the other is a spike."""
    points = np.array([(x, y) for x in (0.0, 6.0, 8.0) for y in (0.0, 2.0, 7.0)])
    loops = merge_convex(points, counter_clockwise(points, Delaunay(points).simplices))
    assert [shapely.Polygon(points[loop]).is_valid for loop in loops] == [True]
    assert sorted(shapely.Polygon(points[loops[0]]).bounds) == [0, 0, 7, 8]


def test_invalid_rock_is_refused_with_its_defect():
    with pytest.raises(GeometryError, match="Self-intersection"):
        convex_partition(Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]))


def test_the_world_box_contains_plan_and_workings_with_a_margin_in_decimetres():
    box = world_box(shapely.box(-3.33, 0, 50, 5), 2.0, (0.0, -1.0, 40.0, 6.0))
    assert box == (-5.4, -3.0, 52.0, 8.0)
