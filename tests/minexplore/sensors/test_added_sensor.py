"""A sensor is one file: whoever writes it gets its name, its space, its readings, its messages and its row."""

import importlib.util

import numpy as np
import pytest

from minexplore.envs.env import MineEnv
from minexplore.extra.record.episode import frames_of
from minexplore.extra.record.mcap_file import McapFile
from minexplore.sensors.kind import KINDS
from minexplore.sensors.page import sensors_section
from minexplore.sensors.table import check_sensors, sensor_names
from tests.extensions import blocks


@pytest.fixture
def barometer(tmp_path):
    """Import the file of docs/reference/extending.md as any module; afterwards the table is as it was."""
    sensor_names()
    before = list(KINDS)
    file = tmp_path / "barometer.py"
    file.write_text(blocks("A sensor")[0])
    spec = importlib.util.spec_from_file_location("barometer", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module.Barometer
    KINDS[:] = before


def test_a_file_adds_a_sensor_to_environment_recording_and_page(barometer, small_world, tmp_path):
    assert sensor_names()[-1] == "barometer"
    env = MineEnv(small_world, sensors=("imu", "barometer"), conditions="typical")
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert abs(observation["barometer"][0]) < 5
    assert "| `barometer` | (1,) float32 | the height of the floor, m |" in sensors_section()
    file = McapFile(tmp_path / "a.mcap", env.suite)
    for frame in frames_of(env, lambda observation, info: np.array([1.0, 0.0]), ("barometer",), 3, 0):
        file.add(frame)
    file.close()
    env.close()
    from mcap_ros2.reader import read_ros2_messages

    heights = [m.ros_msg.point.z for m in read_ros2_messages(str(tmp_path / "a.mcap"), topics=["/barometer"])]
    assert len(heights) == 4
    assert np.ptp(heights) < 1


def test_a_sensor_that_is_added_changes_no_number_of_the_others(barometer, small_world):
    found = []
    for sensors in (("imu", "odometry", "vlp-16"), ("imu", "odometry", "vlp-16", "barometer")):
        env = MineEnv(small_world, sensors=sensors, conditions="typical")
        env.reset(seed=3)
        env.step(np.array([1.0, 0.2]))
        found.append(env.step(np.array([1.0, 0.2]))[0])
        env.close()
    for name in ("robot", "imu", "odometry", "vlp-16"):
        np.testing.assert_array_equal(found[0][name], found[1][name])


def test_a_name_that_no_sensor_has_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="want each once of rgb, depth, labels, imu, mid-360, os1-64"):
        check_sensors(["barometer"])


def test_sensors_that_are_read_late_in_an_episode_read_what_they_would_have(small_world):
    """They are made when one is first read; the IMU's bias is that of the episode."""
    early, late = (MineEnv(small_world, conditions="typical") for _ in range(2))
    early.reset(seed=1)
    early.capture("imu")
    for env in (early, late):
        env.reset(seed=2)
        env.step(np.array([1.0, 0.0]))
        env.reset()  # goes on with the numbers of the seed
        env.step(np.array([1.0, 0.0]))
    np.testing.assert_array_equal(early.capture("imu"), late.capture("imu"))
    for env in (early, late):
        env.close()
