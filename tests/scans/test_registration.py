import math

import numpy as np
import pytest
import shapely

from pipeline.errors import GeometryError
from pipeline.geometry.raycast import RayCaster, upright_walls
from pipeline.scans.registration import Search, Similarity, register_scans

MINE = shapely.union_all(
    [shapely.box(0, 0, 200, 6), shapely.box(30, 6, 36, 20), shapely.box(110, -14, 115, 0), shapely.box(160, 6, 166, 18)]
)
SEARCH = Search((0.95, 1.05), math.radians(2), 4.0, 1.5, math.radians(3))
BEARINGS = np.linspace(-np.pi, np.pi, 360, endpoint=False)


@pytest.fixture(scope="module")
def cast():
    caster = RayCaster(upright_walls(MINE, 2.0))
    return lambda places, bearings: caster.fan(places, bearings, 1.0)


def inside(places):
    return shapely.contains_xy(MINE, places[:, 0], places[:, 1])


def test_a_fan_in_a_rectangular_room_has_the_distances_to_its_walls():
    caster = RayCaster(upright_walls(shapely.box(0, 0, 4, 2), 3.0))
    ranges = caster.fan(np.array([[1.0, 1.0]]), np.array([[0.0, np.pi / 2, np.pi, np.pi / 4]]), 1.0)
    assert ranges[0] == pytest.approx([3.0, 1.0, 1.0, math.sqrt(2)], abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.97, 1.0, 1.03])
def test_scans_and_scale_are_found_from_inaccurate_poses(cast, scale):
    """The survey frame is scaled, turned and shifted relative to the mine frame, and each pose has its own error."""
    rng = np.random.default_rng(0)
    truth = {"a": (33.0, 3.0, 0.2), "b": (112.0, 2.5, -0.3), "c": (163.0, 3.4, 3.0), "d": (70.0, 3.2, 1.0)}
    to_mine = Similarity(scale, math.radians(0.8), 2.0, -1.0)
    poses, scans = {}, {}
    for name, (x, y, heading) in truth.items():
        z = (complex(x, y) - complex(to_mine.east_m, to_mine.north_m)) / (scale * np.exp(1j * to_mine.turn_rad))
        error = rng.uniform(-0.4, 0.4, 2)
        poses[name] = (z.real + error[0], z.imag + error[1], heading - to_mine.turn_rad + rng.uniform(-0.01, 0.01))
        ranges = cast(np.array([[x, y]]), (heading + BEARINGS)[None])[0]
        near = ranges < 25
        scans[name] = (BEARINGS[near], ranges[near] + rng.normal(0, 0.02, near.sum()))
    registration = register_scans(poses, scans, cast, inside, SEARCH)
    for name, (x, y, heading) in truth.items():
        assert registration.poses[name][:2] == pytest.approx((x, y), abs=0.1)
        assert registration.poses[name][2] == pytest.approx(heading, abs=0.01)
        assert math.hypot(*registration.corrections[name][:2]) < 1.0
    assert registration.similarity.scale == pytest.approx(scale, abs=0.006)
    assert registration.scale_interval[0] <= scale <= registration.scale_interval[1]


def test_poses_far_from_any_drift_are_refused(cast):
    scans = {"a": (BEARINGS, np.full(360, 3.0))}
    with pytest.raises(GeometryError, match="no pose lies in the workings"):
        register_scans({"a": (50.0, 80.0, 0.0)}, scans, cast, inside, SEARCH)


def test_poses_in_a_national_grid_are_refused(cast):
    with pytest.raises(GeometryError, match="give poses relative to a place in the mine"):
        register_scans({"a": (350_000.0, 7_400_000.0, 0.0)}, {"a": (BEARINGS, BEARINGS * 0 + 3)}, cast, inside, SEARCH)


def test_one_pose_with_a_large_error_does_not_move_the_similarity_beyond_its_bounds(cast):
    truth = {"a": (33.0, 3.0, 0.2), "b": (112.0, 2.5, -0.3), "c": (163.0, 3.4, 3.0)}
    scans = {n: (BEARINGS, cast(np.array([p[:2]]), (p[2] + BEARINGS)[None])[0]) for n, p in truth.items()}
    poses = {**truth, "b": (114.1, 4.6, -0.3)}
    search = Search((0.99, 1.01), math.radians(0.5), 2.0, 1.5, math.radians(3))
    registration = register_scans(poses, scans, cast, inside, search)
    assert 0.99 <= registration.similarity.scale <= 1.01
    for dx, dy, _ in registration.corrections.values():
        assert math.hypot(dx, dy) <= 1.5 + 0.01


def test_a_similarity_equals_a_linear_map_of_complex_numbers():
    place = Similarity(1.1, 0.3, 5.0, -2.0).place((3.0, 4.0, 0.5))
    z = 1.1 * np.exp(0.3j) * (3 + 4j) + (5 - 2j)
    assert place == pytest.approx((z.real, z.imag, 0.8))
