"""The husky and the quadrotor in mines that are one volume: on ramps, and in shafts that no wheels reach."""

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from baselines.policies.policy_lookup import make_policy
from minexplore.envs.env import MineEnv
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.husky import HuskyParams
from minexplore.sensing.cubes import CubeGrid
from minexplore.sensing.scanners import LABELS
from minexplore.task import TaskParams
from minexplore.volume.air import air_spans
from minexplore.world import load_world
from tests.volumes import HEADER, build_volume

NAMES = ("husky", "quadrotor")
# A drift, a shaft of 3.5 m by 3.5 m at its end, and a drift 8 m lower.
SHAFT = HEADER + (
    "A,1,0,0,2,2,0,3,0\nA,2,12,0,2,2,0,3,0\nB,2,12,0,2,2,0,3,0\nB,3,12,0,1.75,1.75,-8,3,0\n"
    "C,3,12,0,2,2,-8,3,0\nC,4,24,0,2,2,-8,3,0\n"
)


@pytest.fixture(scope="module")
def shaft(tmp_path_factory):
    return build_volume(SHAFT, tmp_path_factory.mktemp("shaft"))


def test_a_husky_climbs_a_ramp_at_its_top_speed_and_touches_nothing(ramp):
    world, robot = load_world(ramp), HuskyParams(side_ratio=1.0, turn_noise_radps=0.0)
    batch = RobotBatch(world, TaskParams(terrain=False), robot, 1)
    rngs = [np.random.default_rng(0)]
    batch.reset(np.arange(1), rngs)
    batch.place(0, 15.0, 0.0, 0.0)
    for _ in range(300):
        batch.step(np.array([[1.0, 0.0]]), rngs)
    x, y, yaw = batch.poses()[0]
    assert batch.collisions[0] == 0
    assert x == pytest.approx(15.0 + 30.0 * robot.top_speed_mps(1.5), abs=1.5)  # in 30 s; 20 m rise by 15 %
    assert abs(y) < 0.5
    assert abs(yaw) < 0.1
    assert batch.heights(np.arange(1))[0] == pytest.approx(3.0, abs=0.02)


def test_a_huskys_wheels_give_as_tyres_do_and_have_the_friction_of_their_zones(ramp):
    world = load_world(ramp)
    batch = RobotBatch(world, TaskParams(), HuskyParams(), 1)
    batch.reset(np.arange(1), [np.random.default_rng(0)])
    ground = batch.ground
    tiles = ground.prepare(batch.stepper, np.arange(1), np.array([[59.0, 0.0, 3.165]]))
    model = ground.models.model(tuple(tiles[0].tolist()))
    last = world.active_zones(True)[-1].friction
    for wheel in ("front_left", "rear_right"):
        geom = model.geom(f"robot_{wheel}")
        assert (geom.priority[0], geom.friction[0], geom.solref[0]) == (1, pytest.approx(last), 0.1)


def test_a_quadrotor_flies_up_a_shaft_and_back_and_sees_what_no_wheels_reach(shaft):
    env = MineEnv(shaft, robot="quadrotor", task=TaskParams(terrain=False))
    wheels = {MineEnv(shaft, robot=robot).grid.total for robot in (None, "husky")}
    heights = env.grid.cubes[:, 2]
    assert {int(z) for z in np.unique(heights)} == {0, 1, 2, 3, 4, 5}  # the shaft joins both drifts
    assert env.grid.total > 2 * max(wheels)
    env.reset(seed=0)
    env.robots.place(0, 12.0, 0.25, 0.0)  # over the shaft's floor
    places = []
    for climb in (1.0, -1.0):
        for _ in range(80):
            info = env.step([0.0, 0.0, climb, 0.0])[4]
            places.append(float(info["height_m"]))
    assert max(places) > 8.0
    assert abs(places[-1] - 1.2) < 0.6  # where it began; it takes half a second to follow


def test_a_quadrotor_in_the_whole_volume_and_in_the_rock_round_it_flies_alike(shaft):
    envs = [MineEnv(shaft, robot="quadrotor", whole=whole) for whole in (False, True)]
    for env in envs:
        env.reset(seed=2)
    for _ in range(60):
        infos = [env.step([1.0, 0.2, 0.1, 0.3])[4] for env in envs]
    assert infos[0]["collisions"] == infos[1]["collisions"] > 0
    np.testing.assert_allclose(infos[0]["pose_m_rad"], infos[1]["pose_m_rad"], atol=1e-6)


def test_the_frontier_explorer_flies_through_a_shaft_and_touches_nothing(shaft):
    env = MineVectorEnv(1, shaft, robot="quadrotor", task=TaskParams(max_steps=600))
    policy = make_policy("nearest-frontier", 1, env.task, env.robot, env.world.has_heights)
    observation, info = env.reset(seed=[0])
    policy.reset(np.arange(1), np.array([0]))
    truncated = np.zeros(1, bool)
    while not truncated[0]:
        observation, _, _, truncated, info = env.step(policy.act(observation, info))
    assert info["coverage"][0] > 0.9
    assert info["collisions"][0] == 0


def test_a_cylinder_has_room_where_every_column_within_its_radius_is_free_over_its_height(shaft):
    spans, radius, half = load_world(shaft).volume.spans, 0.36, 0.07
    air = air_spans(spans, radius, half)
    free = {}
    for column, row, low, head in zip(spans.column, spans.row, spans.floor_m, spans.headroom_m, strict=True):
        free.setdefault((int(column), int(row)), []).append((low, low + head))
    found = {}
    for column, row, low, head in zip(air.column, air.row, air.floor_m, air.headroom_m, strict=True):
        found.setdefault((int(column), int(row)), []).append((low, low + head))
    reach = int(radius / spans.cell_m)
    about = [(i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1)]
    disc = [(i, j) for i, j in about if np.hypot(i, j) * spans.cell_m <= radius]
    for column, row in list(free)[::7]:
        for z in np.arange(-0.5, 11.0, 0.21):
            beside = [free.get((column + i, row + j), []) for i, j in disc]
            roomy = all(any(low + half < z < high - half for low, high in own) for own in beside)
            assert roomy == any(low < z < high for low, high in found.get((column, row), []))


def test_a_robot_that_fits_nowhere_in_the_air_is_one_error(shaft):
    spans = load_world(shaft).volume.spans
    air = air_spans(spans, 9.0, 0.1)
    with pytest.raises(ValueError, match="no place where the robot fits"):
        CubeGrid(air.middles(2.0), 2.0)


@pytest.mark.parametrize("robot", [None, *NAMES])
def test_every_robot_has_every_sensor_in_a_volume_and_each_hit_its_label(box, robot):
    env = MineEnv(box, robot=robot, sensors=("imu", "vlp-16"), conditions="typical")
    check_env(env, skip_render_check=True)
    env = MineEnv(box, robot=robot)
    env.reset(seed=1)
    for name in ("rgb", "depth", "labels"):
        assert env.capture(name).shape[:2] == (240, 320)
    cloud, pose = env.capture("vlp-16"), env.suite.pose()
    places = env.suite.mount("vlp-16").on(pose).points(cloud.points_m)
    names = np.array(LABELS)[cloud.label]
    assert set(names) <= {"rock", "roof", "floor", "wet floor", "water"}
    floor = np.isin(names, ["floor", "wet floor", "water"])
    assert np.abs(places[names == "roof", 2] - 3.0).max(initial=0.0) < 0.1
    assert np.abs(places[floor, 2]).max() < 0.1
    walls = places[(names == "rock") & (places[:, 2] < 1.0)]  # higher up they lean inwards
    off_m = np.minimum(np.abs(np.abs(walls[:, 1]) - 2.0), np.minimum(np.abs(walls[:, 0]), np.abs(walls[:, 0] - 20.0)))
    assert len(walls) > 1000
    assert off_m.max() < 0.1
    env.close()


def test_a_quadrotor_sees_less_in_dust_and_is_placed_as_in_clear_air(shaft):
    clear, dusty = (
        MineEnv(shaft, robot="quadrotor", conditions=c) for c in ("ideal", {"preset": "dusty", "dust_per_m": 0.9})
    )
    (one, seen), (two, less) = clear.reset(seed=2), dusty.reset(seed=2)
    assert (two[:82] <= one[:82] + 0.02).all()
    assert two[:82].mean() < 0.8 * one[:82].mean()
    assert less["cells_seen"] < seen["cells_seen"]
    np.testing.assert_array_equal(seen["pose_m_rad"], less["pose_m_rad"])
    check_env(dusty, skip_render_check=True)
