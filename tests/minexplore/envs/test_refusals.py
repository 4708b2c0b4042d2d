import copy
import os
import pickle
import signal
import time

import gymnasium
import numpy as np
import pytest

from minexplore.envs.call_checks import numbers_of, spread_seeds
from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import load_world
from tests.mines import BuiltMine


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"max_steps": -1}, r"task: max_steps = -1: want a whole number from 1 to 1,000,000,000"),
        ({"region_m": -1}, r"task: region_m = -1: want a number from 0\.1 or more"),
        ({"region_m": np.nan}, "task: region_m = nan"),
        ({"beams": 2.5}, r"task: beams = 2\.5: want a whole number from 1 to 4,096"),
        ({"beams": True}, "task: beams = True"),
        ({"beams": 10**30}, "task: beams = 10{30}"),
        ({"range_m": 5}, "task: range_m = 5: want 0 < near < far"),
        ({"range_m": [1.0, np.inf]}, r"task: range_m = \(1\.0, inf\)"),
        ({"range_m": "ab"}, "task: range_m = 'ab'"),
        ({"cell_m": 0}, r"task: cell_m = 0: want a number from 0\.1 to 1,000"),
        ({"control_s": "0.1"}, "task: control_s = '0.1'"),
        ({"physics_s": 0.03}, "a whole number of physics steps in a control step, they make 3.33333"),
        ({"physics_s": 0.0}, "task: physics_s = 0.0"),
        ({"stall_speed_mps": -0.1}, "task: stall_speed_mps = -0.1"),
        ({"range_noise_m": np.inf}, "task: range_noise_m = inf"),
        ({"terrain": "no"}, "task: terrain = 'no': want True or False"),
        (5, r"TaskParams: 5: want TaskParams\(\.\.\.\), or a dict of its fields"),
    ],
)
def test_an_impossible_task_is_refused_with_the_field_and_its_span(params, message):
    with pytest.raises(ValueError, match=message):
        MineEnv("a world that is not looked for", params)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"mass_kg": np.nan}, r"robot: mass_kg = nan: want a number from 0\.1 to 100,000"),
        ({"radius_m": 0.0}, "robot: radius_m = 0.0"),
        ({"radius_m": 1e9}, "robot: radius_m = 1000000000.0"),
        ({"wheel_radius_m": "big"}, "robot: wheel_radius_m = 'big'"),
        ({"wheel_torque_nm": -1}, "robot: wheel_torque_nm = -1"),
        ({"sensor_height_m": 0.1}, "robot: sensor_height_m = 0.1: the scanner ends below the chassis"),
        ([1], r"RobotParams: \[1\]: want"),
    ],
)
def test_an_impossible_robot_is_refused_with_the_field_and_its_span(params, message):
    with pytest.raises(ValueError, match=message):
        MineEnv("a world that is not looked for", None, params)


def test_numbers_of_numpy_are_numbers():
    assert TaskParams(beams=np.int64(8), control_s=np.float64(0.1), terrain=np.bool_(True)).substeps == 20
    assert RobotParams(radius_m=np.float32(0.5)).radius_m == np.float32(0.5)


def test_a_world_or_a_number_of_robots_of_another_kind_is_refused(tee: BuiltMine):
    with pytest.raises(FileNotFoundError, match="world = 5: want the path of a world bundle, or one of its names"):
        MineEnv(5)
    with pytest.raises(FileNotFoundError, match="want the path of a world bundle") as refusal:
        MineEnv(load_world(tee.bundle))
    assert len(str(refusal.value)) < 200  # the record of a world has pages
    for name, message in (("", "world = '': want the path"), ("a" * 10_000, "File name too long")):
        with pytest.raises(FileNotFoundError, match=message):
            MineEnv(name)
    with pytest.raises(ValueError, match=r"mass_kg = 1000+"):
        RobotParams(mass_kg=10**400)
    for count in (0, 2.5, True, "3", 10**12):
        with pytest.raises(ValueError, match=f"num_envs = {count!r}: want a whole number from 1 to"):
            MineVectorEnv(count, tee.bundle)
    with pytest.raises(ValueError, match="autoreset_mode = 'later': valid choices are NEXT_STEP, SAME_STEP"):
        MineVectorEnv(1, tee.bundle, autoreset_mode="later")
    with pytest.raises(ValueError, match="whole = 'yes': want True or False"):
        MineEnv(tee.bundle, whole="yes")


def test_a_raw_environment_wants_a_reset_before_a_step_and_nothing_after_its_end(tee: BuiltMine):
    for made in (MineEnv(tee.bundle), MineVectorEnv(2, tee.bundle)):
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before render"):
            made.render()
    with pytest.raises(ValueError, match="seed = True: want None or a whole number"):
        MineEnv(tee.bundle).reset(seed=True)
    for made, action in ((MineEnv(tee.bundle), np.zeros(2)), (MineVectorEnv(2, tee.bundle), np.zeros((2, 2)))):
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before step"):
            made.step(action)
        made.reset(seed=0)
        made.close()
        made.close()  # again does nothing
        for call in (lambda made=made, action=action: made.step(action), made.reset, made.render):
            with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="is closed"):
                call()


def test_options_and_actions_of_another_kind_are_refused(tee: BuiltMine):
    env = MineEnv(tee.bundle)
    with pytest.raises(ValueError, match=r"options: unknown 'yaw'; there are: pose, cell, station, noise_seed"):
        env.reset(options={"yaw": 1.0})
    with pytest.raises(ValueError, match=r"options = 3: want a dict"):
        env.reset(options=3)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action = 'ahead': want numbers"):
        env.step("ahead")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"options": {"reset_mask": [True, False]}}, r"reset_mask of bool with shape \(2,\): want bool .*\(3,\)"),
        ({"options": {"reset_mask": np.array([1, 0, 1])}}, "reset_mask of int64"),
        ({"options": {"reset_mask": np.zeros(3, bool)}}, "it names no robot"),
        ({"options": {"mask": np.ones(3, bool)}}, "options: unknown 'mask'; there are: reset_mask"),
        ({"seed": [1, 2]}, "2 seeds for 3 robots"),
        ({"seed": -1}, "seed = -1: want None or a whole number of 0 or more"),
        ({"seed": [0, 1, 2.5]}, r"seed = 2\.5"),
        ({"seed": "abc"}, "seed = 'abc'"),
    ],
)
def test_bad_masks_options_and_seeds_of_many_robots_are_refused_and_change_nothing(tee: BuiltMine, arguments, message):
    made = MineVectorEnv(3, tee.bundle)
    made.reset(seed=0)
    made.step(np.ones((3, 2)))
    before = made.robots.state.copy()
    with pytest.raises(ValueError, match=message):
        made.reset(**arguments)
    np.testing.assert_array_equal(made.robots.state, before)


def test_a_part_of_the_robots_cannot_be_reset_first(tee: BuiltMine):
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset all robots before some of them"):
        MineVectorEnv(2, tee.bundle).reset(options={"reset_mask": np.array([True, False])})


def test_seeds_may_be_an_array(tee: BuiltMine):
    one, two = MineVectorEnv(2, tee.bundle), MineVectorEnv(2, tee.bundle)
    np.testing.assert_array_equal(one.reset(seed=np.array([4, 5]))[0], two.reset(seed=np.int64(4))[0])


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_of_an_environment_goes_on_as_the_original(tee: BuiltMine, copied):
    single, many = MineEnv(tee.bundle, {"max_steps": 12}), MineVectorEnv(3, tee.bundle, {"max_steps": 12})
    single.reset(seed=1)
    many.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(5):
        single.step(rng.uniform(-1, 1, 2))
        many.step(rng.uniform(-1, 1, (3, 2)))
    for env, shape in ((single, (2,)), (many, (3, 2))):
        twin = copied(env)
        for _ in range(12):  # over the end of an episode
            action = rng.uniform(-1, 1, shape)
            ours, theirs = env.step(action), twin.step(action)
            np.testing.assert_array_equal(ours[0], theirs[0])
            np.testing.assert_array_equal(ours[1], theirs[1])
            np.testing.assert_array_equal(ours[4]["pose_m_rad"], theirs[4]["pose_m_rad"])
            np.testing.assert_array_equal(ours[4]["cells_seen"], theirs[4]["cells_seen"])


def test_a_copy_of_a_new_environment_wants_a_reset_and_one_of_a_closed_one_is_closed(tee: BuiltMine):
    with pytest.raises(gymnasium.error.ResetNeeded):
        copy.deepcopy(MineEnv(tee.bundle)).step(np.zeros(2))
    closed = MineEnv(tee.bundle)
    closed.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        copy.deepcopy(closed).reset()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.parametrize("threads", [1, 3])
def test_an_environment_steps_in_a_fork_of_its_process(tee: BuiltMine, threads):
    made, twin = (MineVectorEnv(24, tee.bundle, threads=threads) for _ in range(2))
    for env in (made, twin):
        env.reset(seed=0)
        env.step(np.ones((24, 2)))
    expected = twin.step(np.ones((24, 2)))[0]
    child = os.fork()
    if child == 0:  # no exception may leave the child: pytest would go on in it
        try:
            found = made.step(np.ones((24, 2)))[0]
            made.close()
            os._exit(0 if np.array_equal(found, expected) else 3)
        finally:
            os._exit(4)
    end = time.monotonic() + 60
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        time.sleep(0.05)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        pytest.fail("the fork hangs")
    assert os.waitstatus_to_exitcode(status) == 0
    for env in (made, twin):
        env.close()


@pytest.mark.parametrize(
    "action",
    [
        *(np.zeros(2, complex), [0j, 0.0], np.array([0j, 0j], object)),
        *(["0", "1"], np.array(["0", "1"]), np.array([b"0", b"1"]), np.array(["0", 1.0], object), [None, 0.0]),
        *(np.ma.masked_array([0.0, 1.0], [False, True]), [np.ma.masked, 0.0], np.array([0, 1], "datetime64[s]")),
        *([np.ma.masked_array([0.0, 1.0], [True, False]), [0.0, 0.0]], [10**400, 0], [np.longdouble("1e4000"), 0]),
    ],
)
def test_actions_that_are_no_numbers_are_refused(action):
    with pytest.raises(ValueError, match="want numbers"):
        numbers_of(action)


def test_a_list_that_holds_itself_is_no_action_and_no_seed():
    endless: list = [0.0]
    endless.append(endless)
    with pytest.raises(ValueError, match="want numbers"):
        numbers_of(endless)
    with pytest.raises(ValueError, match="seed = "):
        spread_seeds(endless, 2)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("large", [1e300, 10**30, np.longdouble("1e300"), np.float32(3e38)])
def test_a_finite_action_beyond_the_space_is_clipped_however_large_it_is(tee: BuiltMine, large):
    one, two = MineEnv(tee.bundle), MineEnv(tee.bundle)
    one.reset(seed=0)
    two.reset(seed=0)
    np.testing.assert_array_equal(one.step([large, -large])[0], two.step(np.array([1.0, -1.0], np.float32))[0])
    with pytest.raises(ValueError, match="want two finite numbers"):
        one.step(np.array([np.inf, 0.0], np.longdouble))


@pytest.mark.parametrize("seed", [[1], (1,), np.array([1]), [None], "1", np.ma.masked_array([1], [True])])
def test_the_seed_of_one_robot_is_no_list(tee: BuiltMine, seed):
    with pytest.raises(ValueError, match=r"seed = .*: want None or a whole number of 0 or more"):
        MineEnv(tee.bundle).reset(seed=seed)


def test_masked_seeds_and_masks_of_many_robots_are_refused(tee: BuiltMine):
    made = MineVectorEnv(2, tee.bundle)
    with pytest.raises(ValueError, match=r"seed = .*: want no masked values"):
        made.reset(seed=np.ma.masked_array([1, 2], [False, True]))
    made.reset(seed=np.iinfo(np.int64).max)
    with pytest.raises(ValueError, match="reset_mask: want no masked values"):
        made.reset(options={"reset_mask": np.ma.masked_array([True, True], [False, True])})
