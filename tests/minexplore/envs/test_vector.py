import pickle
import tracemalloc

import gymnasium
import mujoco
import numpy as np
import pytest
import shapely
from gymnasium.vector import AutoresetMode

from minexplore.envs.env import MineEnv
from minexplore.envs.robot_batch import RobotBatch
from minexplore.envs.vector import MineVectorEnv
from minexplore.physics.robot import RobotParams, free_joint_qpos
from minexplore.task import TaskParams
from minexplore.world import load_world
from tests.mines import TEE, BuiltMine


def commands(rng, count, step, held=8):
    """Hard driving: full throttle with turns that change every few steps."""
    block = np.random.default_rng([rng, step // held])
    actions = np.column_stack([block.choice([1.0, 1.0, 1.0, -1.0], count), block.uniform(-1, 1, count)])
    return actions.astype(np.float32)


def test_it_is_made_by_make_vec_and_has_batched_spaces(tee: BuiltMine):
    made = gymnasium.make_vec(
        "MineXplore/World-v0", num_envs=3, vectorization_mode="vector_entry_point", world=str(tee.bundle)
    )
    observation, info = made.reset(seed=0)
    assert observation.shape == (3, 19)
    assert made.observation_space.contains(observation)
    assert info["coverage"].shape == info["_coverage"].shape == (3,)
    assert made.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    made.close()


def test_a_corner_of_rock_is_met_head_on_and_as_deep_as_it_stands_in_the_disc(tee: BuiltMine):
    robots = RobotBatch(load_world(tee.bundle), TaskParams(tilt=False), RobotParams(), 1)
    free, pressed = tee.free_space.polygon, 0.05
    ring = shapely.get_coordinates(free.exterior)
    before, after = np.roll(ring[:-1], 1, axis=0), ring[1:]
    turn = (ring[:-1] - before)[:, 0] * (after - ring[:-1])[:, 1] - (ring[:-1] - before)[:, 1] * (after - ring[:-1])[
        :, 0
    ]
    corners = ring[:-1][turn * (1 if free.exterior.is_ccw else -1) < -1e-6]  # where rock points into the drift
    met = 0
    for corner in corners:
        for heading in np.linspace(0, 2 * np.pi, 24, endpoint=False):
            away = np.array([np.cos(heading), np.sin(heading)])
            place = corner + away * (RobotParams().radius_m - pressed)
            if not free.contains(shapely.Point(place)) or free.boundary.distance(shapely.Point(place)) < 0.2999:
                continue
            robots.place(0, *place, 0.0)
            model = robots.local_models.model(tuple(robots.local_models.tiles_of(place[None])[0]))
            data = mujoco.MjData(model)
            mujoco.mj_setState(model, data, robots.state[0], mujoco.mjtState.mjSTATE_INTEGRATION)
            mujoco.mj_forward(model, data)
            rock = [c for c in data.contact if model.geom(c.geom2).name.startswith("rock_")]
            assert max(-c.dist for c in rock) == pytest.approx(pressed, abs=5e-3)
            met += 1
    robots.close()
    assert met > 10


def test_threads_change_nothing(tee: BuiltMine):
    one, two = MineVectorEnv(24, tee.bundle), MineVectorEnv(24, tee.bundle, threads=2)
    np.testing.assert_array_equal(one.reset(seed=0)[0], two.reset(seed=0)[0])
    for step in range(40):
        actions = commands(2, 24, step)
        for a, b in zip(one.step(actions)[:4], two.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(a, b)
    two.close()


def side_by_side(bundle, count, steps, seed):
    """Step local models and the whole world with the same commands; yield both and the robots that still agree."""
    world = load_world(bundle)
    task = TaskParams(terrain=False)  # noise aside: physics is compared
    local, whole = (RobotBatch(world, task, RobotParams(), count, whole=w) for w in (False, True))
    rngs = [np.random.default_rng(i) for i in range(count)]
    local.reset(np.arange(count), rngs)
    row, col = np.nonzero(world.clearance_m >= 0.4)
    rng = np.random.default_rng(seed)
    pick = rng.integers(len(row), size=count)
    places = world.origin_m + (np.column_stack([col[pick], row[pick]]) + 0.5) * world.cell_m
    for i, (x, y) in enumerate(places):
        local.qpos[i, :7] = free_joint_qpos(local.T_world_mine, local.robot, x, y, rng.uniform(-np.pi, np.pi))
    whole.state[:] = local.state
    for step in range(steps):
        actions = commands(seed, count, step)
        hits = []
        for robots in (local, whole):
            outcome = robots.step(actions, rngs)
            hits.append(outcome.info["collision"])
        yield local, whole, hits


def test_local_models_and_the_whole_world_give_the_same_physics_and_no_robot_leaves_the_workings(tee: BuiltMine):
    """4.8 * 10^4 physics steps of hard driving into walls, corners and borders of tiles."""
    agree = np.ones(24, dtype=bool)
    apart = np.zeros(24)
    inside = TEE.buffer(0.01)
    crossed = set()
    for local, whole, hits in side_by_side(tee.bundle, 24, 100, 3):
        apart = np.abs(local.qpos - whole.qpos).max(axis=1)
        agree &= apart < 1e-9
        assert (hits[0] == hits[1])[agree].all()
        crossed |= {tuple(t) for t in local.local_models.tiles_of(local.poses()[:, :2]).tolist()}
        for robots in (local, whole):
            x, y, _ = robots.poses().T
            assert shapely.contains_xy(inside, x, y).all()
    assert agree.mean() > 0.9, apart
    assert len(crossed) > 10


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_episodes_start_again_as_the_mode_says(tee: BuiltMine, mode):
    made = MineVectorEnv(2, tee.bundle, {"max_steps": 5}, autoreset_mode=mode)
    first, _ = made.reset(seed=0)
    ends, last = [], None
    for step in range(13):
        observation, reward, _, truncated, info = made.step(commands(4, 2, step))
        ends.append(bool(truncated.all()))
        if mode is AutoresetMode.NEXT_STEP and step == 5:
            assert (reward == 0).all()  # this step only reset
            assert (observation[:, 16:] == 0).all()
        if mode is AutoresetMode.SAME_STEP and step == 4:
            last = info["final_obs"]
            assert (last[0][16:] != 0).any()
            assert (observation[:, 16:] == 0).all()
            assert (info["final_info"]["cells_seen"] >= info["cells_seen"]).all()
    every = 6 if mode is AutoresetMode.NEXT_STEP else 5
    assert [i for i, end in enumerate(ends) if end] == list(range(4, 13, every))
    assert (last is not None) == (mode is AutoresetMode.SAME_STEP)
    assert first.shape == (2, 19)


def test_only_the_masked_robots_are_reset(tee: BuiltMine):
    made = MineVectorEnv(3, tee.bundle)
    made.reset(seed=0)
    for step in range(10):
        before = made.step(commands(5, 3, step))[0]
    after, info = made.reset(options={"reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    assert made.robots.steps.tolist() == [10, 0, 10]
    assert info["_coverage"].tolist() == [False, True, False]


def test_a_wrong_action_names_its_robot_and_changes_nothing(tee: BuiltMine):
    made = MineVectorEnv(3, tee.bundle)
    made.reset(seed=0)
    before = made.robots.state.copy()
    actions = np.zeros((3, 2))
    actions[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"action of robot 2 = \[0\.0, nan\]"):
        made.step(actions)
    with pytest.raises(ValueError, match=r"shape \(2, 2\): want \(3, 2\)"):
        made.step(np.zeros((2, 2)))
    np.testing.assert_array_equal(made.robots.state, before)


def test_memory_does_not_grow_over_resets(tee: BuiltMine):
    made = MineVectorEnv(8, tee.bundle)
    made.reset(seed=0)
    for _ in range(20):
        made.reset()
    tracemalloc.start()
    start = tracemalloc.take_snapshot()
    for _ in range(300):
        made.reset()
    grown = sum(s.size_diff for s in tracemalloc.take_snapshot().compare_to(start, "filename"))
    tracemalloc.stop()
    assert grown < 200_000


def test_the_scalar_env_survives_pickling_and_its_spec_round_trips(tee: BuiltMine):
    made = gymnasium.make("MineXplore/World-v0", world=str(tee.bundle), max_episode_steps=9)
    spec = gymnasium.envs.registration.EnvSpec.from_json(made.spec.to_json())
    again = gymnasium.make(pickle.loads(pickle.dumps(spec)))
    assert again.spec.max_episode_steps == 9
    copy = pickle.loads(pickle.dumps(made.unwrapped))
    np.testing.assert_array_equal(copy.reset(seed=3)[0], made.reset(seed=3)[0])


def test_pictures_are_drawn_without_a_screen(tee: BuiltMine):
    for camera in ("chase", "front"):  # the plan is looked at below
        made = MineVectorEnv(2, tee.bundle, render_mode="rgb_array", camera=camera)
        made.reset(seed=0)
        one, two = made.render()
        assert one.shape == (480, 640, 3)
        assert one.dtype == np.uint8
        assert len(np.unique(one.reshape(-1, 3), axis=0)) >= 4
        assert two.shape == one.shape
        made.close()


def test_the_plan_turns_green_where_the_robot_has_looked(tee: BuiltMine):
    made = MineEnv(tee.bundle, render_mode="rgb_array", camera="top")
    made.reset(seed=0)
    green = []
    for step in range(40):
        made.step(np.array([1.0, 0.0]))
        if step % 20 == 0:
            picture = made.render().astype(int)
            green.append(int(((picture[..., 1] - picture[..., 0]) > 50).sum()))
    assert green[1] > green[0] > 0


def test_a_reset_forgets_all_that_a_robot_has_seen_and_nothing_of_the_others(tee: BuiltMine):
    env = MineVectorEnv(3, tee.bundle)
    env.reset(seed=4)
    rng = np.random.default_rng(0)
    for _ in range(120):
        env.step(np.column_stack([rng.uniform(0.5, 1, 3), rng.uniform(-0.4, 0.4, 3)]))
    kept, first = env.robots.seen[[0, 2]].copy(), env.robots.cells_seen[1]
    env.robots.reset(np.array([1]), env._rngs)
    assert env.robots.seen[1].sum() == env.robots.cells_seen[1] < first
    assert (env.robots.seen[[0, 2]] == kept).all()
    assert (env.robots.seen.reshape(3, -1).sum(axis=1) == env.robots.cells_seen).all()
