"""Cameras on a robot: depth and labels beside rays through the same pixels."""

import numpy as np
import pytest

from minexplore.envs.env import MineEnv
from minexplore.pictures.cameras import CameraParams
from minexplore.sensing.image_degradation import degrade_depth, degrade_picture
from minexplore.sensing.params import SensorParams
from minexplore.sensing.scanners import LABELS
from minexplore.sensing.scanners.caster import SurfaceCaster
from minexplore.sensing.scanners.labels import NUMBERS, WATER


@pytest.fixture(scope="module")
def env(small_world):
    made = MineEnv(small_world)
    made.reset(seed=3)
    yield made
    made.close()


def pixel_rays(env):
    """Return the origin (3,) and unit directions (h, w, 3) of the pixels' rays in the mine frame."""
    camera = env.suite.sensor("rgb").params
    pose = camera.mount.on(env.suite.pose())
    right = np.arange(camera.width_px) + 0.5 - camera.width_px / 2
    down = np.arange(camera.height_px) + 0.5 - camera.height_px / 2
    u, v = np.meshgrid(right / camera.focal_px, down / camera.focal_px)
    ways = np.stack([np.ones_like(u), -u, -v], axis=-1)
    length = np.linalg.norm(ways, axis=-1)
    return pose.place_m, (ways / length[..., None]) @ pose.axes.T, length


def test_depth_and_labels_are_those_of_rays_through_the_pixels(env):
    depth, labels = env.capture("depth"), env.capture("labels")
    origin, ways, length = pixel_rays(env)
    hits = SurfaceCaster(env.world, 30.0).cast(origin, ways.reshape(-1, 3).astype(np.float32))
    far = (hits.range_m / length.ravel()).reshape(depth.shape)
    same = (labels == hits.label.reshape(depth.shape)) & (depth > 0)
    walls = same & np.isin(labels, [NUMBERS["rock"], NUMBERS["roof"]])
    assert walls.mean() > 0.3
    assert same.mean() > 0.9
    assert np.median(np.abs(depth - far)[walls]) < 0.01
    assert np.percentile(np.abs(depth - far)[walls], 95) < 0.05


def test_a_picture_is_lit_and_labels_are_known(env):
    picture, labels = env.capture("rgb"), env.capture("labels")
    assert picture.shape == (240, 320, 3)
    assert picture.std() > 10
    assert labels.max() < len(LABELS)


def test_dust_fills_a_picture_with_its_own_light_and_noise_has_its_spread():
    picture = np.full((100, 100, 3), 200, np.uint8)
    rng = np.random.default_rng(0)
    far = degrade_picture(picture, np.full((100, 100), 1e3), SensorParams(dust_per_m=0.1), rng)
    near = degrade_picture(picture, np.full((100, 100), 1e-6), SensorParams(dust_per_m=0.1), rng)
    half = degrade_picture(picture, np.full((100, 100), np.log(2) / 0.1), SensorParams(dust_per_m=0.1), rng)
    assert (near == 200).all()
    np.testing.assert_allclose(half.astype(float), (far.astype(float) + near) / 2, atol=1)
    noisy = degrade_picture(picture, None, SensorParams(image_noise=0.02), rng)
    assert noisy.std() == pytest.approx(0.02 * 255, rel=0.05)


def test_the_noise_of_depth_grows_with_its_square_and_water_mirrors_it_away():
    rng, params = np.random.default_rng(0), SensorParams(depth_noise_px=0.1)
    label = np.zeros((100, 100), np.uint8)
    spread = [degrade_depth(np.full((100, 100), z), label, 200, 0.1, params, rng).std() for z in (2.0, 4.0)]
    assert spread[0] == pytest.approx(0.1 * 4 / 20, rel=0.05)
    assert spread[1] == pytest.approx(4 * spread[0], rel=0.05)
    wet = degrade_depth(np.full((100, 100), 2.0), label + WATER, 200, 0.1, SensorParams(film_share=1.0), rng)
    assert (wet == 0).all()


def test_dust_returns_light_where_nothing_else_is_in_reach():
    rng, label = np.random.default_rng(0), np.zeros((50, 50), np.uint8)
    dusty = SensorParams(dust_per_m=0.13, dust_transmittance=0.725)
    beyond = degrade_depth(np.zeros((50, 50), np.float32), label, 200, 0.1, dusty, rng)
    clear = degrade_depth(np.zeros((50, 50), np.float32), label, 200, 0.1, SensorParams(depth_noise_px=0.1), rng)
    assert np.median(beyond) == pytest.approx(-np.log(0.725) / 0.13, rel=0.05)
    assert (clear == 0).all()


def test_dust_beyond_the_farthest_depth_returns_nothing():
    rng, label = np.random.default_rng(0), np.zeros((50, 50), np.uint8)
    thin = SensorParams(dust_per_m=0.005, dust_transmittance=0.725)
    half_m = -np.log(0.725) / 0.005
    seen = degrade_depth(np.zeros((50, 50), np.float32), label, 200, 0.1, thin, rng, half_m)
    assert seen.max() <= half_m
    assert np.mean(seen > 0) == pytest.approx(0.5, abs=0.03)  # half of the rays return within that distance


def test_a_camera_that_none_sells_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"camera: fovy_deg = 190: want a number from 5 to 150"):
        CameraParams(fovy_deg=190)
    with pytest.raises(ValueError, match=r"camera: mount = \(0, 0, 1\): want Mount\(\.\.\.\)"):
        CameraParams(mount=(0, 0, 1))


def test_the_cameras_field_is_that_of_its_data_sheet_at_four_to_three():
    camera = CameraParams()
    across = np.degrees(2 * np.arctan(camera.width_px / 2 / camera.focal_px))
    assert (across, camera.fovy_deg) == (pytest.approx(75, abs=3), pytest.approx(62, abs=3))  # 75 +- 3 by 62 +- 1 deg
