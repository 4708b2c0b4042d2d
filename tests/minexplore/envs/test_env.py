import math
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import label

import minexplore  # noqa: F401  (registers the environments)
from minexplore.bundle import BundleError
from minexplore.envs.env import MineEnv
from minexplore.physics.robot import RobotParams
from minexplore.sensing.coverage import CoverageGrid, connected_cells
from minexplore.sensing.observation import observe
from minexplore.task import TaskParams
from minexplore.tasks.exploration import CAP, step_reward
from minexplore.world import load_world
from tests.mines import RING, TEE, BuiltMine


@pytest.fixture
def env(tee: BuiltMine):
    made = MineEnv(tee.bundle)
    yield made
    made.close()


def place(env, x, y, yaw):
    """Place the robot at a pose of the mine frame, at rest."""
    env.reset(seed=0)
    env.robots.place(0, x, y, yaw)


def ranges_of(env):
    """Return the true ranges, m."""
    return env.robots.true_ranges(np.arange(1))[0]


def drive(env, action, steps):
    infos = [env.step(np.array(action, dtype=np.float32))[4] for _ in range(steps)]
    return np.array([info["pose_m_rad"] for info in infos]), infos


def test_equal_seeds_and_actions_give_equal_episodes(tee: BuiltMine):
    def episode(seed):
        made = MineEnv(tee.bundle)
        first, _ = made.reset(seed=seed)
        rng = np.random.default_rng(5)
        return [first] + [made.step(rng.uniform(-1, 1, 2))[0] for _ in range(40)]

    one, same, other = episode(3), episode(3), episode(4)
    assert all((a == b).all() for a, b in zip(one, same, strict=True))
    assert not all((a == b).all() for a, b in zip(one, other, strict=True))


def test_beams_measure_the_distance_to_the_rock_that_is_seen(env, tee: BuiltMine):
    """Beam 4 looks left, 12 right, 2 half left, across a drift 5 m wide whose rock stands out by decimetres."""
    place(env, 20.0, 2.5, 0.0)
    ranges = ranges_of(env)
    assert ranges[4] == pytest.approx(2.5, abs=0.45)
    assert ranges[12] == pytest.approx(2.5, abs=0.45)
    assert ranges[2] == pytest.approx(2.5 * math.sqrt(2), abs=0.7)
    assert ranges[0] == 10.0
    assert not np.isclose(ranges[[4, 12]], 2.5, atol=1e-3).all()  # the flat collision wall is not what is seen


def test_beams_look_down_at_the_floor_when_the_robot_leans(env):
    place(env, 20.0, 2.5, 0.0)
    lean = math.radians(10)
    w, x, y, z = env.robots.qpos[0, 3:7]
    c, s = math.cos(lean / 2), math.sin(lean / 2)
    env.robots.qpos[0, 3:7] = [w * c - y * s, x * c - z * s, w * s + y * c, x * s + z * c]  # pitched nose down
    lift = 0.5 - env.robot.wheel_radius_m
    height = env.robot.wheel_radius_m + lift * math.cos(lean)
    assert ranges_of(env)[0] == pytest.approx(height / math.sin(lean), rel=0.01)


def test_observations_are_noisy_by_a_centimetre_before_normalising(env):
    place(env, 20.0, 2.5, 0.0)
    ranges = ranges_of(env)
    rng = np.random.default_rng(0)
    draws = np.array([observe(env.task, ranges[None], np.zeros((1, 2)), [rng])[0, 4] for _ in range(2000)])
    metres = draws * (10.0 - 0.12) + 0.12
    assert metres.mean() == pytest.approx(ranges[4], abs=0.002)
    assert metres.std() == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, 2.0])
def test_it_holds_still_on_the_slope(env, yaw):
    place(env, 10.0, 2.5, yaw)
    drive(env, [0, 0], 5)
    poses, _ = drive(env, [0, 0], 50)
    assert np.linalg.norm(poses[-1, :2] - poses[0, :2]) < 0.02


def test_driving_into_a_wall_collides_and_stops_there(env):
    place(env, 20.0, 2.5, math.pi / 2)
    poses, infos = drive(env, [1, 0], 60)
    assert any(info["collision"] for info in infos)
    assert poses[:, 1].max() < 5.0 - env.robot.radius_m + 0.01
    assert infos[-1]["collisions"] == sum(info["collision"] for info in infos)


@pytest.mark.parametrize(("zone", "x"), [("dry", 8.0), ("mud", 32.0), ("water", 62.0)])
def test_a_parked_robot_ends_its_episode_after_a_hundred_steps_on_any_floor(tee: BuiltMine, zone, x):
    env = MineEnv(tee.bundle)
    for seed in range(5):
        env.reset(seed=seed)
        env.robots.place(0, x, 2.5, 0.0)
        steps = [env.step(np.zeros(2))[2:] for _ in range(100)]
        assert env.world.zone_names[steps[-1][2]["zone"]] == zone
        assert [truncated for _, truncated, _ in steps] == [False] * 99 + [True]
        assert not any(terminated for terminated, _, _ in steps)


def test_a_robot_that_pushes_against_a_wall_in_dry_floor_ends_its_episode_and_one_that_drives_does_not(tee: BuiltMine):
    env = MineEnv(tee.bundle, TaskParams(stall_steps=20))
    for drives, yaw in ((True, 0.0), (False, math.pi / 2)):
        env.reset(seed=0)
        place(env, 20.0, 2.5, yaw)
        assert drives != any(env.step(np.array([0.3, 0.0]))[3] for _ in range(100))


@pytest.mark.parametrize("action", [[math.nan, 0.0], [math.inf, 1.0]])
def test_an_action_that_is_not_finite_is_refused_and_the_robot_named(env, action):
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action of robot 0 = \[(nan|inf), .*: want two finite numbers"):
        env.step(np.array(action))


@pytest.mark.parametrize("action", [[0.0], [[0.0, 0.0]], [0.0, 0.0, 0.0]])
def test_an_action_of_another_shape_is_refused(env, action):
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action of shape .*: want \(2,\)"):
        env.step(np.array(action))


def test_flat_and_dry_is_flat_and_dry(tee: BuiltMine):
    made = MineEnv(tee.bundle, {"tilt": False, "terrain": False})
    made.reset(seed=0)
    assert made.robots.qpos[0, [4, 5]] == pytest.approx(0.0, abs=1e-9)
    model = made.robots.local_models.spec(None).compile()
    assert all(model.geom(g.geom).friction[0] == 1.0 for g in made.world.floor_zones)


def test_unknown_fields_worlds_and_modes_are_refused_with_the_choices(tee: BuiltMine):
    with pytest.raises(ValueError, match="TaskParams: no field 'speed'; there are beams"):
        MineEnv(tee.bundle, {"speed": 2})
    with pytest.raises(FileNotFoundError, match="no such folder, and no world of that name"):
        MineEnv("nowhere")
    with pytest.raises(FileNotFoundError, match="a file; a bundle is a folder, so unpack one that is packed"):
        MineEnv(tee.bundle / "world.json")
    with pytest.raises(ValueError, match="valid choices are None, 'rgb_array', 'human'"):
        MineEnv(tee.bundle, render_mode="ascii")
    with pytest.raises(ValueError, match="valid choices are chase, top, front"):
        MineEnv(tee.bundle, camera="side")
    with pytest.raises(ValueError, match="want auto, embree, open3d"):
        MineEnv(tee.bundle, lidar="sonar")


def test_a_bundle_that_does_not_hold_is_refused(tee: BuiltMine, tmp_path):
    bundle = tmp_path / "b"
    shutil.copytree(tee.bundle, bundle)
    (bundle / "occupancy.npz").write_bytes(b"x")
    with pytest.raises(BundleError, match=r"occupancy\.npz"):
        MineEnv(bundle)
    with pytest.raises(BundleError, match="not a world bundle"):
        MineEnv(tmp_path)


def test_every_reachable_cell_holds_workings_and_none_is_forgotten(tee: BuiltMine):
    grid = CoverageGrid(load_world(tee.bundle), 2.0, 0.35, np.array([40.5, 2.5]), np.inf)
    # 80 x 5 m and 5 x 35 m less a rim of 0.35 m, in cells of 2 m on the origin's grid.
    rows, cols = np.nonzero(grid.reachable)
    cells = {(int(c), int(r)) for r, c in zip(rows + grid.origin_m[1] / 2, cols + grid.origin_m[0] / 2, strict=True)}
    main = {(c, r) for c in range(40) for r in range(3)}
    up = {(c, r) for c in range(19, 22) for r in range(3, 20)}
    assert cells == main | up


def test_cells_that_are_connected_are_those_of_a_labelled_picture():
    rng = np.random.default_rng(2)
    standing = rng.random((60, 90)) < 0.62
    world = SimpleNamespace(origin_m=np.array([-3.0, 5.0]), cell_m=0.25, folder="a folder")
    labels, _ = label(standing)
    largest = np.bincount(labels[standing]).argmax()
    row, col = np.argwhere(labels == largest)[0]
    centre = world.origin_m + (np.array([col, row]) + 0.5) * world.cell_m
    assert (connected_cells(world, standing, centre) == (labels == largest)).all()


def test_beams_that_start_at_one_place_cross_the_cells_that_they_cross_one_by_one(ring: BuiltMine):
    grid = CoverageGrid(load_world(ring.bundle), 2.0, 0.35, np.array([3.0, 3.0]), np.inf)
    rng = np.random.default_rng(1)
    for start in ([3.0, 3.0, 0.5], [4.0, 2.0, 0.5], [3.7, 9.1, 0.5]):
        ends = start + np.append(rng.uniform(-7, 7, (40, 3)), [[5.0, 0, 0], [0, -5.0, 0], [0, 0, 0]], axis=0)
        together = grid.cells_crossed(np.array([start]), ends, 10.0)
        apart = grid.cells_crossed(np.array([start] * len(ends)), ends, 10.0)
        np.testing.assert_array_equal(together, apart)


def test_a_beam_crosses_exactly_the_cells_of_a_line(ring: BuiltMine):
    grid = CoverageGrid(load_world(ring.bundle), 2.0, 0.35, np.array([3.0, 3.0]), np.inf)
    start = np.array([[3.0, 3.0]])
    _, rows, cols = grid.cells_crossed(start, np.array([[9.0, 3.0]]), 10.0)
    assert (rows - rows[0]).tolist() == [0, 0, 0, 0]
    assert (cols - cols[0]).tolist() == [0, 1, 2, 3]
    rng = np.random.default_rng(0)
    starts = rng.uniform(8, 32, (200, 2))
    ends = starts + rng.uniform(-7, 7, (200, 2))
    ray, rows, cols = grid.cells_crossed(starts, ends, 10.0)
    for k in range(200):
        dense = starts[k] + np.linspace(0, 1, 20_001)[:, None] * (ends[k] - starts[k])
        cells = np.floor((dense - grid.origin_m) / 2.0).astype(int)
        entered = np.flatnonzero(np.diff(cells, axis=0, prepend=-1).any(axis=1))
        expected = {(a, b) for a, b in cells[entered].tolist()}
        found = set(zip(cols[ray == k].tolist(), rows[ray == k].tolist(), strict=True))
        assert expected <= found  # a corner cut by less than the sampling may be found beside
        assert len(found - expected) <= 1


def test_the_reward_is_the_papers_equation_and_never_more_than_its_cap():
    def reward(before, new, collision=False):
        return step_reward(np.array([before]), np.array([new]), 8, np.array([collision]))[0]

    assert reward(0, 1) == pytest.approx(10 / 8)
    assert reward(1, 0) == -0.002
    assert reward(1, 0, collision=True) == pytest.approx(-15.002)
    assert reward(1, 1) == pytest.approx(10 / 8 + 15)
    assert reward(2, 4) == pytest.approx(40 / 8 + 30 + 45)
    assert reward(6, 2) == pytest.approx(20 / 8)
    assert sum(reward(k, 1) for k in range(8)) == pytest.approx(CAP) == 100.0


def test_coverage_counts_what_was_seen_of_what_can_be_reached(env):
    _, info = env.reset(seed=0)
    assert info["cells_reachable"] == env.grid.total
    seen = [info["cells_seen"]]
    rewards = 0.0
    for _ in range(30):
        _, reward, _, _, info = env.step(np.array([1.0, 0.1]))
        seen.append(info["cells_seen"])
        rewards += reward
    assert seen == sorted(seen)
    assert 0 < info["coverage"] <= 1
    assert info["coverage"] == info["cells_seen"] / info["cells_reachable"]


def test_a_robot_thrown_at_walls_never_leaves_the_workings(env):
    import shapely

    rng = np.random.default_rng(2)
    inside = TEE.buffer(0.01)
    for start in range(20):
        place(env, *(6.0 + 3.5 * start, 2.5), rng.uniform(-np.pi, np.pi))
        poses, _ = drive(env, [1.0, rng.uniform(-0.2, 0.2)], 40)
        assert all(shapely.contains_xy(inside, x, y) for x, y, _ in poses)


def test_wheel_speeds_of_a_twist():
    robot = RobotParams()
    assert robot.wheel_speeds(1.0, 0.0) == pytest.approx((1 / 0.1651, 1 / 0.1651))
    left, right = robot.wheel_speeds(0.0, 1.0)
    assert right - left == pytest.approx(0.545 / 0.1651)


def test_a_ring_can_be_seen_all_round(ring: BuiltMine):
    grid = CoverageGrid(load_world(ring.bundle), 2.0, 0.35, np.array([3.0, 3.0]), np.inf)
    assert grid.total * 4 >= RING.area
