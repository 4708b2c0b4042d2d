import dataclasses
import pickle

import mujoco
import numpy as np
import pytest

from minexplore.envs.env import MineEnv
from minexplore.envs.family import FamilyVectorEnv
from minexplore.envs.flyer_batch import FlyerBatch
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.vector import MineVectorEnv
from minexplore.extra.warp.limits import default_robot
from minexplore.physics.husky import HuskyParams
from minexplore.physics.quadrotor import INERTIA_KGM2, MASS_KG, QuadrotorParams
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from tests.mines import BuiltMine

NAMES = ("husky", "quadrotor")


@pytest.mark.parametrize("mine", ["tee", "ramp"])
@pytest.mark.parametrize("robot", [None, *NAMES])
def test_vector_and_scalar_of_each_robot_give_the_same_trajectories_bit_for_bit(request, mine: str, robot: str):
    found = request.getfixturevalue(mine)
    bundle = getattr(found, "bundle", found)
    vector = MineVectorEnv(3, bundle, robot=robot, threads=2)
    single = [MineEnv(bundle, robot=robot) for _ in range(3)]
    observations, _ = vector.reset(seed=7)
    np.testing.assert_array_equal(observations, [env.reset(seed=7 + i)[0] for i, env in enumerate(single)])
    rng, collisions = np.random.default_rng(1), 0
    for step in range(40):
        if step % 8 == 0:
            actions = rng.uniform(-1, 1, vector.action_space.shape).astype(np.float32)
            actions[:, 0] = 1.0
        observations, rewards, _, _, info = vector.step(actions)
        alone = [env.step(actions[i]) for i, env in enumerate(single)]
        np.testing.assert_array_equal(observations, [result[0] for result in alone])
        np.testing.assert_array_equal(rewards, [result[1] for result in alone])
        for name in alone[0][4]:
            np.testing.assert_array_equal(info[name], [result[4][name] for result in alone], err_msg=name)
        collisions += info["collision"].sum()
    assert collisions > 0


@pytest.mark.parametrize("robot", NAMES)
def test_a_pickled_environment_of_each_robot_goes_on_as_the_first_does(tee: BuiltMine, robot: str):
    env = MineEnv(tee.bundle, robot=robot)
    env.reset(seed=1)
    action = np.full(env.action_space.shape, 0.4)
    env.step(action)
    other = pickle.loads(pickle.dumps(env))
    for _ in range(3):
        np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])


def test_a_husky_turns_about_as_fast_as_it_is_commanded_on_dry_ground():
    husky = HuskyParams()
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = 0.005, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [9, 9, 1], "contype": 2, "conaffinity": 0, "priority": 1}
    spec.worldbody.add_geom(name="floor_dry", **plane)
    husky.attach(spec, "robot")
    model = spec.compile()
    assert model.body_subtreemass[model.body("robot").id] == pytest.approx(50.0)
    for forward, turn in ((0.0, 1.0), (0.8, 0.5), (0.8, -0.2), (0.9, 0.0)):
        data = mujoco.MjData(model)
        data.qpos[2] = husky.wheel_radius_m
        data.ctrl[:] = husky.controls(np.array([forward]), np.array([turn]))[0]
        mujoco.mj_step(model, data, nstep=400)
        rates, speeds = [], []
        for _ in range(300):
            mujoco.mj_step(model, data)
            rates.append(data.qvel[5])
            speeds.append(np.hypot(*data.qvel[:2]))
        assert np.mean(rates) == pytest.approx(turn, rel=0.25, abs=0.01)
        assert np.mean(speeds) == pytest.approx(forward, rel=0.05, abs=0.02)
        assert np.abs(data.actuator_force).max() < 40.0


def test_a_husky_drives_no_faster_than_its_data_sheet_says_but_for_its_noise_which_is_its_seeds():
    husky, robots = HuskyParams(), np.array([0, 2])
    fast = np.full(2, 1.5), np.zeros(2)
    once, again = (husky.disturb(*fast, [np.random.default_rng(k) for k in range(3)], robots) for _ in range(2))
    np.testing.assert_array_equal(once, again)
    assert (np.abs(once[0] - husky.max_speed_mps) < 5 * husky.speed_noise_mps).all()
    assert once[0][0] != once[0][1]  # each draws from a generator of its own
    other = [np.random.default_rng(9), np.random.default_rng(9), np.random.default_rng(2)]
    assert husky.disturb(*fast, other, robots)[0][1] == once[0][1]
    still = husky.disturb(np.zeros(2), np.zeros(2), other, robots)
    np.testing.assert_array_equal(still, np.zeros((2, 2)))


def test_the_quadrotors_controller_knows_the_mass_and_inertia_of_its_file():
    spec = mujoco.MjSpec()
    QuadrotorParams().attach(spec, "robot")
    model = spec.compile()
    body = model.body("robot").id
    assert model.body_mass[body] == pytest.approx(MASS_KG)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes = turn.reshape(3, 3)
    np.testing.assert_allclose(axes @ np.diag(model.body_inertia[body]) @ axes.T, np.diag(INERTIA_KGM2), atol=2e-5)


@pytest.mark.parametrize("wanted", [(1.5, 0.0, 0.0, 0.0), (-0.9, 0.9, 0.5, 0.8), (0.0, 0.0, -1.0, -1.5)])
def test_a_quadrotor_flies_as_fast_as_it_is_commanded_and_never_faster(wanted: tuple[float, ...]):
    robot, spec = QuadrotorParams(), mujoco.MjSpec()
    spec.option.timestep, spec.option.density, spec.option.viscosity = 0.005, 1.225, 1.8e-5
    robot.attach(spec, "robot")
    model = spec.compile()
    data = mujoco.MjData(model)
    asked, fastest = np.array([wanted]), 0.0
    for _ in range(500):
        data.ctrl[:] = robot.thrusts(data.qpos[None, 3:7], data.qvel[None, :3], data.qvel[None, 3:6], asked)[0]
        mujoco.mj_step(model, data, nstep=2)
        fastest = max(fastest, float(np.hypot(*data.qvel[:2])))
    ahead = data.body("robot").xmat.reshape(3, 3)[:2, 0]
    ahead = ahead / np.hypot(*ahead)
    level = (data.qvel[:2] @ ahead, ahead[0] * data.qvel[1] - ahead[1] * data.qvel[0])
    np.testing.assert_allclose([*level, data.qvel[2], data.qvel[5]], wanted, atol=0.1)
    assert fastest < 1.05 * np.hypot(*wanted[:2]) + 0.02


def test_cubes_that_a_beam_crosses_are_those_that_close_steps_along_it_find(tee: BuiltMine):
    grid = MineEnv(tee.bundle, robot="quadrotor").grid
    rng = np.random.default_rng(0)
    starts = np.column_stack([rng.uniform(5, 75, 60), rng.uniform(0.5, 4.5, 60), rng.uniform(0.2, 3.2, 60)])
    ends = starts + rng.uniform(-6, 6, (60, 3))
    ray, number = grid.cells_crossed(starts, ends, 10.0)
    for k in range(60):
        shares = np.linspace(0, 1, 4001)[1:-1, None]
        stepped = grid.numbers_at(starts[k] + shares * (ends[k] - starts[k]))
        assert set(stepped[stepped >= 0]) <= set(number[ray == k])
        assert len(set(number[ray == k])) - len(set(stepped[stepped >= 0])) <= 1  # a corner that steps pass over


def test_the_default_robot_is_driven_by_the_default_batch_and_keeps_its_parameters():
    assert dataclasses.asdict(RobotParams())["radius_m"] == 0.35
    assert (RobotParams.COMMANDS, RobotParams.JOINTS) == (2, ("free", "left", "right"))
    assert set(dataclasses.asdict(RobotParams())) == {field.name for field in dataclasses.fields(RobotParams)}


def test_each_robot_has_a_batch_of_its_kind(tee: BuiltMine):
    assert type(MineEnv(tee.bundle, robot=HuskyParams()).robots) is RobotBatch
    assert type(MineEnv(tee.bundle, robot=QuadrotorParams(rings=1)).robots) is FlyerBatch


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ("tank", r"robot = 'tank': want husky, quadrotor, RobotParams\(\.\.\.\) or a dict of its fields"),
        (3, r"RobotParams: 3: want RobotParams\(\.\.\.\), or a dict of its fields"),
    ],
)
def test_a_robot_that_is_none_is_refused_in_one_line(tee: BuiltMine, robot: object, message: str):
    for make in (MineEnv, lambda *_, **given: MineVectorEnv(1, *_, **given)):
        with pytest.raises(ValueError, match=message):
            make(tee.bundle, robot=robot)


def test_a_measure_of_a_robots_file_and_a_gain_out_of_range_are_refused_in_one_line():
    with pytest.raises(ValueError, match=r"husky: radius_m = 0\.4: want 0\.598, the measure of its MJCF file"):
        HuskyParams(radius_m=0.4)
    with pytest.raises(ValueError, match=r"quadrotor: half_height_m = 1\.0: want 0\.07, the measure of its MJCF file"):
        QuadrotorParams(half_height_m=1.0)
    with pytest.raises(ValueError, match=r"quadrotor: rings = 31: want a whole number from 0 to 30"):
        QuadrotorParams(rings=31)
    with pytest.raises(ValueError, match=r"husky: turn_gain = -1: want a number from 0\.1 to 10"):
        HuskyParams(turn_gain=-1)


def test_a_wrong_number_of_commands_is_refused(tee: BuiltMine):
    env = MineEnv(tee.bundle, robot="quadrotor")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action of shape \(2,\): want \(4,\)"):
        env.step([0.0, 0.0])
    with pytest.raises(ValueError, match="want four finite numbers"):
        env.step([0.0, np.nan, 0.0, 0.0])


def test_warp_drives_the_default_robot_only():
    message = "robot = 'quadrotor': the environment on Warp drives the default robot only; want RobotPar"
    with pytest.raises(ValueError, match=message):
        default_robot("quadrotor")
    assert default_robot({"radius_m": 0.4}) == RobotParams(radius_m=0.4)


def test_a_family_of_mines_takes_a_robots_commands():
    many = FamilyVectorEnv(2, split="test", robot="quadrotor")
    assert many.single_action_space.shape == (4,)
    assert many.single_observation_space.shape == (86,)
    with pytest.raises(ValueError, match=r"actions of shape \(2, 2\): want \(2, 4\)"):
        many.step(np.zeros((2, 2)))
    many.close()


def test_a_parked_quadrotors_episode_ends(tee: BuiltMine):
    env = MineEnv(tee.bundle, robot="quadrotor", task=TaskParams(stall_steps=5))
    env.reset(seed=0)
    ends = [env.step(np.zeros(4))[3] for _ in range(5)]
    assert ends == [False] * 4 + [True]


def test_a_robot_in_the_whole_mine_and_in_the_rock_round_it_flies_alike(tee: BuiltMine):
    envs = [MineEnv(tee.bundle, robot="quadrotor", whole=whole) for whole in (False, True)]
    for env in envs:
        env.reset(seed=2)
    for _ in range(60):
        infos = [env.step([1.0, 0.2, 0.1, 0.3])[4] for env in envs]
    assert infos[0]["collisions"] == infos[1]["collisions"]
    np.testing.assert_allclose(infos[0]["pose_m_rad"], infos[1]["pose_m_rad"], atol=1e-6)
