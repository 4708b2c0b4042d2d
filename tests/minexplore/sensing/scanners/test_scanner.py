"""Clouds: what is in them, and how a moving sensor bends them."""

import numpy as np
import pytest

from minexplore.sensing.scanners import LABELS, Mount, Pose3D, scanner_of
from minexplore.sensing.scanners.scanner import place_rays
from minexplore.world import load_world


@pytest.fixture(scope="module")
def world(small_world):
    return load_world(small_world)


@pytest.fixture(scope="module")
def pose(world):
    return Pose3D(np.array([*world.record["spawn"]["anchor_m"], 0.0]), np.eye(3))


def moved(pose, ahead_m, yaw_rad):
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return Pose3D(pose.place_m + np.array([ahead_m, 0, 0]), turn @ pose.axes)


def test_an_ideal_scan_is_the_same_twice_and_names_what_it_hits(world, pose):
    scanner = scanner_of("os1-64", world, Mount(height_m=0.7))
    one, two = scanner.scan(pose), scanner.scan(pose)
    np.testing.assert_array_equal(one.range_m, two.range_m)
    assert {"rock", "roof"} < set(one.counts())
    assert sum(one.counts().values()) == len(one) <= one.fired == 65_536
    assert (one.range_m >= 0.8).all()
    assert ((one.intensity > 0) & (one.intensity <= 0.3 + 1e-6)).all()


def test_the_points_of_the_floor_lie_on_the_floor(world, pose):
    mount = Mount(x_m=0.1, height_m=0.7, yaw_deg=30.0, pitch_deg=10.0, roll_deg=-5.0)
    cloud = scanner_of("vlp-16", world, mount).scan(pose)
    points = mount.on(pose).points(cloud.points_m)
    floor = np.isin(np.array(LABELS)[cloud.label], ["floor", "wet floor", "water"])
    assert floor.sum() > 1000
    assert np.abs(points[floor, 2]).max() < 2e-3


def test_intensity_falls_with_the_cosine_of_incidence(world, pose):
    cloud = scanner_of("os1-64", world, Mount(height_m=0.7)).scan(pose)
    floor = np.isin(np.array(LABELS)[cloud.label], ["floor", "wet floor", "water"])
    np.testing.assert_allclose(cloud.intensity[floor], 0.3 * np.abs(cloud.directions[floor, 2]), atol=1e-5)


def test_a_sensor_that_stands_makes_the_same_cloud_with_motion_within_the_scan(world, pose):
    scanner = scanner_of("vlp-16", world)
    still, moving = scanner.scan(pose), scanner.scan(pose, before=pose)
    assert len(still) == pytest.approx(len(moving), abs=5)
    assert np.median(np.abs(still.range_m[:5000] - moving.range_m[:5000])) < 1e-4


def test_rays_of_a_moving_sensor_start_and_look_where_it_is_when_they_are_fired(world, pose):
    rays = scanner_of("vlp-16", world).pattern.scan()
    end = moved(pose, 0.15, 0.3)
    origins, directions = place_rays(rays, end, pose, 0.1)
    np.testing.assert_allclose(origins[0], pose.place_m)
    np.testing.assert_allclose(origins[-1], end.place_m, atol=1e-4)
    np.testing.assert_allclose(directions[0], rays.directions[0], atol=1e-6)
    np.testing.assert_allclose(directions[-1], end.axes @ rays.directions[-1], atol=1e-3)
    half = len(rays.time_s) // 2
    np.testing.assert_allclose(directions[half], moved(pose, 0, 0.15).axes @ rays.directions[half], atol=1e-3)


def test_a_mount_off_the_robot_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"mount: height_m = 30: want a number from -20 to 20"):
        Mount(height_m=30)
