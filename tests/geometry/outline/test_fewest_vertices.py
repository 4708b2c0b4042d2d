import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.worlds.rough_plan import rough_mine
from pipeline.geometry.generated.rough_walls import roughen_walls
from pipeline.geometry.outline.fewest_vertices import simplify_to_error
from pipeline.geometry.outline.trace import simplify_outline, simplify_to_wall_error, trace_outline
from pipeline.geometry.polyline import line_moments, points_along
from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.wall_distance import largest_error_m
from pipeline.metrics.wall_error import signed_distances
from tests.mines import RING, TEE, frame_for, random_mine


def corners(polygon):
    return len(shapely.get_coordinates(polygon))


@pytest.fixture(scope="module")
def rough():
    return rough_mine(3, side_m=70.0).geoms[0]


def test_a_subdivided_polygon_gets_its_corners_back():
    simple = simplify_to_error(shapely.segmentize(RING, 0.3), 0.002)
    assert corners(simple) == corners(RING)
    assert simple.symmetric_difference(RING).area < 0.01


@pytest.mark.parametrize("error_m", [0.02, 0.03, 0.06])
def test_the_mean_wall_error_is_reached_and_not_exceeded(rough, error_m):
    simple = simplify_to_wall_error(rough, error_m)
    distance = np.abs(signed_distances(rough, simple))
    assert 0.8 * error_m <= distance.mean() <= 1.02 * error_m
    assert largest_error_m(rough, simple) <= 8.5 * error_m


def test_ninety_nine_per_cent_of_a_wall_with_furniture_lie_within_five_times_the_mean_error():
    room = shapely.box(0, 0, 40, 6)
    for x in range(2, 38, 4):
        room = room.difference(shapely.box(x, -1, x + 0.5, 0.19)).difference(shapely.box(x + 1, 5.81, x + 1.6, 7))
    distance = np.abs(signed_distances(room, simplify_to_error(room, 0.03)))
    assert np.percentile(distance, 99) <= 5.3 * 0.03
    assert distance.mean() <= 0.03


@pytest.mark.parametrize("gap_m", [0.004, 0.002])
def test_walls_nearer_to_each_other_than_their_error_keep_their_topology(gap_m):
    turn, other = (
        np.linspace(start, start + 2 * np.pi, count, endpoint=False) for start, count in ((0, 400), (0.3, 517))
    )
    pillar = 8 * np.column_stack([np.cos(turn), np.sin(turn)])
    wall = (8 + gap_m) * np.column_stack([np.cos(other), np.sin(other)])  # fits of the two cross
    room = shapely.Polygon(wall, [pillar]).union(shapely.box(4, -1.5, 40, 1.5))
    simple = simplify_to_error(room, 0.03)
    assert simple.is_valid
    assert len(simple.interiors) == len(room.interiors) == 1
    assert simple.hausdorff_distance(room) <= 0.03
    assert corners(simple) < corners(room) / 2


def test_fewer_vertices_are_needed_than_by_douglas_peucker_with_refitting(rough):
    peucker = simplify_outline(rough, 0.12)
    error_m = np.abs(signed_distances(rough, peucker)).mean()
    assert corners(simplify_to_wall_error(rough, float(error_m))) < 0.9 * corners(peucker)


def test_the_simplified_walls_lie_as_much_inside_as_outside(rough):
    simple = simplify_to_wall_error(rough, 0.03)
    assert abs(signed_distances(rough, simple).mean()) < 0.002


@given(seed=st.integers(0, 10_000), drifts=st.integers(1, 6))
@settings(deadline=None, max_examples=15)
def test_islands_and_validity_are_kept(seed, drifts):
    mine = random_mine(np.random.default_rng(seed), drifts)
    frame = frame_for(mine, px_per_m=8.0)
    traced = trace_outline(fill_polygon(mine, frame), frame)
    simple = simplify_to_wall_error(traced, 0.05)
    assert simple.is_valid
    assert len(simple.interiors) == len(traced.interiors)


def test_moments_of_a_line_are_its_integrals():
    line = np.array([[1.0, 2.0], [4.0, 6.0]])
    share = (np.arange(100_000) + 0.5) / 100_000
    x, y = (line[0] + share[:, None] * (line[1] - line[0])).T
    expected = 5.0 * np.array([1.0, x.mean(), y.mean(), (x * x).mean(), (x * y).mean(), (y * y).mean()])
    np.testing.assert_allclose(line_moments(line)[0], expected, rtol=1e-8)


def test_points_along_a_ring_have_even_distances():
    points = points_along(np.asarray(TEE.exterior.coords), 0.5)
    steps = np.linalg.norm(np.diff(np.vstack([points, points[:1]]), axis=0), axis=1)
    assert len(points) == round(TEE.exterior.length / 0.5)
    assert steps.max() <= 0.5 * 1.001


def test_rough_walls_have_the_stated_deviation_and_keep_the_islands():
    rough = roughen_walls(RING, 0.06, 0.75, 0.3, 6.0, np.random.default_rng(5)).geoms[0]
    assert len(rough.interiors) == 1
    assert signed_distances(rough, RING).std() == pytest.approx(0.06, rel=0.25)


def test_a_vertex_beside_an_axis_has_no_sign_that_depends_on_the_processor():
    near_axes = shapely.Polygon([(-1e-10, -1e-10), (20, -1e-10), (20, 4), (-1e-10, 4)])
    for simple in (simplify_to_wall_error(near_axes, 0.02), simplify_outline(near_axes, 0.02)):
        at = shapely.get_coordinates(simple)
        assert (at == 0).any()
        assert not np.signbit(at[at == 0]).any()
        assert shapely.get_precision(simple) > 0  # later steps keep to the grid
