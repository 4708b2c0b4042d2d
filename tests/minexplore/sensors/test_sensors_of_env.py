"""Sensors of an environment: off by default, in a dict on request, and the pose that wheels count."""

import copy

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from minexplore.sensing.odometry import OdometryFit, WheelOdometry, fitted_odometry, wrapped, zone_slip
from minexplore.sensing.params import sensor_params

AHEAD = np.array([1.0, 0.1], dtype=np.float32)


def drive(env, steps, seed=0):
    found = [env.reset(seed=seed)]
    found += [env.step(AHEAD)[::4] for _ in range(steps)]
    return found


def test_sensors_and_odometry_change_no_byte_of_the_robots_own_observation(small_world):
    plain = drive(MineEnv(small_world), 15)
    sensed = drive(MineEnv(small_world, sensors=["vlp-16", "imu"], pose="odometry"), 15)
    for (own, info), (dictionary, other) in zip(plain, sensed, strict=True):
        assert own.tobytes() == dictionary["robot"].tobytes()
        np.testing.assert_array_equal(info["pose_m_rad"], other["true_pose_m_rad"])


def test_the_dict_is_in_its_space_and_passes_gymnasiums_checks(small_world):
    env = MineEnv(small_world, sensors=("depth", "vlp-16", "imu"), conditions="typical")
    assert isinstance(env.observation_space, gymnasium.spaces.Dict)
    check_env(env, skip_render_check=True)
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    assert observation["vlp-16"].shape == (28_928,)
    env.close()


def test_a_seed_gives_the_same_readings_and_a_copy_goes_on_alike(small_world):
    one, two = (MineEnv(small_world, sensors=["vlp-16", "imu"], conditions="dusty", pose="odometry") for _ in range(2))
    for (first, _), (second, _) in zip(drive(one, 4), drive(two, 4), strict=True):
        for name in first:
            np.testing.assert_array_equal(first[name], second[name])
    three = copy.deepcopy(one)
    (a, *_, info), (b, *_, other) = one.step(AHEAD), three.step(AHEAD)
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])
    np.testing.assert_array_equal(info["pose_m_rad"], other["pose_m_rad"])


def test_dust_shortens_beams_and_what_they_see_and_the_true_ranges_stay(small_world):
    clear, dusty = MineEnv(small_world), MineEnv(small_world, conditions={"preset": "dusty", "dust_per_m": 0.5})
    (one, seen), (two, less) = clear.reset(seed=2), dusty.reset(seed=2)
    assert (two[:16] <= one[:16] + 0.01).all()
    assert two[:16].mean() < one[:16].mean() / 2
    assert less["cells_seen"] < seen["cells_seen"]
    np.testing.assert_array_equal(seen["pose_m_rad"], less["pose_m_rad"])
    robots = np.arange(1)
    np.testing.assert_array_equal(clear.robots.true_ranges(robots), dusty.robots.true_ranges(robots))


def test_a_beam_without_a_return_reads_the_farthest_range_and_sees_nothing(small_world):
    blind = MineEnv(small_world, conditions={"noise": 1.0, "reflectivity": 0.001})
    observation, info = blind.reset(seed=2)
    assert observation[:16].min() > 0.99
    assert info["cells_seen"] <= 1


def test_degraded_robots_of_a_vector_are_those_alone(small_world):
    given = {"conditions": "dusty", "pose": "odometry"}
    alone = drive(MineEnv(small_world, **given), 8, seed=4)
    many = MineVectorEnv(2, small_world, **given)
    observation, info = many.reset(seed=3)
    np.testing.assert_array_equal(observation[1], alone[0][0])
    np.testing.assert_array_equal(info["pose_m_rad"][1], alone[0][1]["pose_m_rad"])
    for expected, info in alone[1:]:
        observation, *_, infos = many.step(np.tile(AHEAD, (2, 1)))
        np.testing.assert_array_equal(observation[1], expected)
        np.testing.assert_array_equal(infos["pose_m_rad"][1], info["pose_m_rad"])
        assert infos["cells_seen"][1] == info["cells_seen"]
    many.close()


def test_a_straight_way_counts_its_length_and_the_slip_of_the_log():
    odometry, robot = WheelOdometry(1, 0.5), np.array([0])
    odometry.place(robot, np.zeros((1, 3)))
    for ahead_m in np.linspace(0, 10, 101)[1:]:
        odometry.advance(robot, np.array([[ahead_m, 0, 0]]), np.ones(1))
    assert np.linalg.norm(odometry.poses[0, :2]) == pytest.approx(10 / (1 - fitted_odometry().slip), rel=0.01)


def test_without_errors_the_counted_pose_is_the_true_one_to_the_encoders_counts():
    exact, robot = WheelOdometry(1, 0.5, OdometryFit(0.0, 0.0, 0.0, 1e-6)), np.array([0])
    exact.begin(0, np.random.default_rng(0))
    exact.place(robot, np.zeros((1, 3)))
    for angle in np.linspace(0, 3 * np.pi, 301)[1:]:  # a circle of 2 m, one and a half times
        exact.advance(robot, np.array([[2 * np.sin(angle), 2 - 2 * np.cos(angle), wrapped(angle)]]), np.ones(1))
    np.testing.assert_allclose(exact.poses[0, :2], [0, 4], atol=5e-3)
    assert abs(exact.poses[0, 2]) == pytest.approx(np.pi, abs=1e-3)


def test_a_robot_that_drives_back_counts_back():
    exact, robot = WheelOdometry(1, 0.5, OdometryFit(0.0, 0.0, 0.0, 1e-6)), np.array([0])
    exact.place(robot, np.zeros((1, 3)))
    exact.advance(robot, np.array([[-1.0, 0, 0]]), np.ones(1))
    assert exact.poses[0, 0] == pytest.approx(-1, abs=1e-5)


def test_slip_grows_as_friction_falls():
    np.testing.assert_allclose(zone_slip(0.04, np.array([1.0, 0.5, 1e-9])), [0.04, 0.08, 0.9])


def test_an_imu_at_rest_reads_gravity_and_the_noise_of_its_data_sheet(small_world):
    params = sensor_params("typical")
    env = MineEnv(small_world, conditions=params)
    env.reset(seed=0)
    found = np.array([env.capture("imu") for _ in range(3000)])
    gravity = env.suite.axes.T @ [0.0, 0.0, 9.81]
    np.testing.assert_allclose(found[:, 3:].mean(axis=0), gravity, atol=0.15)
    assert found[:, 0].std() == pytest.approx(params.gyro_noise_radps_rthz / np.sqrt(0.1), rel=0.1)
    assert found[:, 3].std() == pytest.approx(params.accel_noise_mps2_rthz / np.sqrt(0.1), rel=0.1)
    env.suite.velocity_mps = env.suite.before_mps + 0.1 * env.suite.axes[:, 0]  # 0.1 m/s faster ahead in 0.1 s
    faster = np.array([env.capture("imu")[3] for _ in range(300)])
    assert faster.mean() - found[:, 3].mean() == pytest.approx(1.0, abs=0.05)
    env.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"sensors": ["sonar"]}, "sensors: 'sonar': want each once of rgb, depth, labels, imu, mid-360, os1-64"),
        ({"sensors": "depth"}, "sensors = 'depth': want a list of"),
        ({"sensors": ["imu", "imu"]}, "sensors: 'imu': want each once"),
        ({"pose": "gps"}, "pose = 'gps': valid choices are true, odometry"),
        ({"conditions": "rainy"}, "conditions = 'rainy': valid choices are ideal"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(small_world, arguments, words):
    with pytest.raises(ValueError, match=words):
        MineEnv(small_world, **arguments)
    with pytest.raises(ValueError, match=words):
        MineVectorEnv(1, small_world, **arguments)
    env = MineEnv(small_world)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="sensors: 'sonar'"):
        env.capture("sonar")
    env.close()
