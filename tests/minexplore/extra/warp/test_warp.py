"""The environment on Warp's CPU device, which the extra `gpu` brings: `python -m benchmarks test-gpu` runs these."""

import gymnasium
import numpy as np
import pytest
import shapely
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

wp = pytest.importorskip("warp", reason="Warp comes with `make setup-gpu`")
torch = pytest.importorskip("torch", reason="torch comes with `make setup-gpu`")
pytest.importorskip("mujoco_warp", reason="MuJoCo Warp comes with `make setup-gpu`")

from benchmarks.speed.gpu_pair import Pair, compare_looks, compare_steps, stress  # noqa: E402
from benchmarks.speed.gpu_parity_page import ITERATIONS  # noqa: E402
from minexplore.backends import make_vector_env  # noqa: E402
from minexplore.envs.vector import MineVectorEnv  # noqa: E402
from minexplore.extra.warp.env import MineWarpEnv  # noqa: E402
from minexplore.extra.warp.kernels import philox  # noqa: E402
from minexplore.extra.warp.slots import TILE_M, list_parts  # noqa: E402
from minexplore.physics.local_models import LocalModels  # noqa: E402
from minexplore.physics.robot import RobotParams  # noqa: E402
from minexplore.task import TaskParams  # noqa: E402
from minexplore.world import load_world  # noqa: E402
from tests.mines import TEE, BuiltMine  # noqa: E402

SHORT = {"max_steps": 3, "physics_s": 0.05}  # two physics steps a control step: enough where physics does not matter


@pytest.fixture(scope="module")
def pair(tee: BuiltMine) -> Pair:
    return Pair(load_world(tee.bundle), 32, "cpu")


def make(tee: BuiltMine, count: int = 4, **kwargs) -> MineWarpEnv:
    return make_vector_env(count, backend="warp", device="cpu", world=tee.bundle, **{"task": SHORT} | kwargs)


@wp.kernel(enable_backward=False)
def philox_words(counters: wp.array2d[wp.uint32], keys: wp.array2d[wp.uint32], words: wp.array[wp.vec4ui]):
    k = wp.tid()
    words[k] = philox.philox(counters[k, 0], counters[k, 1], counters[k, 2], counters[k, 3], keys[k, 0], keys[k, 1])


@wp.kernel(enable_backward=False)
def normals(keys: wp.array2d[wp.uint32], draws: wp.array[wp.uint32], found: wp.array2d[wp.float64]):
    robot, beam = wp.tid()
    found[robot, beam] = philox.normal(philox.draw(keys, draws, robot, beam, philox.BEAM))


def test_random_words_are_those_of_philox_as_its_authors_publish_them():
    counters = [[0] * 4, [0xFFFFFFFF] * 4, [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344]]
    keys = [[0] * 2, [0xFFFFFFFF] * 2, [0xA4093822, 0x299F31D0]]
    known = [
        [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8],
        [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ]
    words = wp.zeros(3, dtype=wp.vec4ui, device="cpu")
    given = [wp.array(np.array(x, dtype=np.uint32), dtype=wp.uint32, device="cpu") for x in (counters, keys)]
    wp.launch(philox_words, 3, [*given, words], device="cpu")
    assert_array_equal(words.numpy(), np.array(known, dtype=np.uint32))


def test_noise_is_standard_normal_and_of_one_robot_alone():
    count, beams = 4000, 16
    keys = np.column_stack([np.arange(count), np.zeros(count)]).astype(np.uint32)
    found = wp.zeros((count, beams), dtype=wp.float64, device="cpu")
    draws = wp.zeros(count, dtype=wp.uint32, device="cpu")
    wp.launch(normals, (count, beams), [wp.array(keys, dtype=wp.uint32, device="cpu"), draws, found], device="cpu")
    values = found.numpy()
    error = 1 / np.sqrt(values.size)
    assert abs(values.mean()) < 4 * error
    assert abs(values.std() - 1) < 4 * error
    assert abs(np.mean(np.abs(values) < 1) - 0.6827) < 4 * error
    assert np.abs(np.corrcoef(values[:, :4].T) - np.eye(4)).max() < 5 / np.sqrt(count)
    assert len(np.unique(values)) > 0.999 * values.size


def test_slots_hold_every_part_that_a_robot_on_their_tile_can_touch(tee: BuiltMine):
    models = LocalModels(load_world(tee.bundle), TaskParams(), RobotParams())
    table = list_parts(models)
    outlines = [shapely.MultiPoint(part.outline).convex_hull for part in models.parts]
    rows, cols = np.nonzero(table.row >= 0)
    assert len(rows) == len(table.parts)
    free = 0
    for i, j in zip(rows, cols, strict=True):
        tile = np.array([j, i]) + table.first
        low, high = models.reach(tile, TILE_M)
        box = shapely.box(*low, *high)
        near = {k for k, outline in enumerate(outlines) if outline.intersects(box)}
        listed = table.parts[table.row[i, j]]
        assert near == set(listed[listed >= 0].tolist())
        free += TEE.intersects(shapely.box(*(tile * TILE_M), *((tile + 1) * TILE_M)))
    assert free == len(rows)


def test_ranges_and_cells_are_those_of_the_cpu(pair: Pair):
    found = compare_looks(pair, 20_000)
    assert found["rays"] >= 20_000
    assert found["rays_beyond_1_mm"] == 0
    assert found["cells_that_differ"] == 0


def test_height_pitch_and_roll_are_those_of_the_cpu(pair: Pair):
    pair.scatter(np.random.default_rng(1))
    pair.cpu.qpos[:, 3:7] = np.random.default_rng(2).normal(size=(pair.count, 4))
    pair.cpu.qpos[:, 2] += np.random.default_rng(3).uniform(0, 1, pair.count)
    pair.cpu.qpos[:, 3:7] /= np.linalg.norm(pair.cpu.qpos[:, 3:7], axis=1, keepdims=True)
    pair.share_state()
    with wp.ScopedDevice(pair.warp.device):
        pair.warp.describe()
    every = np.arange(pair.count)
    height, pitch, roll = (pair.warp.arrays[name].numpy() for name in ("height", "pitch", "roll"))
    assert_allclose(height, pair.cpu.heights(every), atol=1e-4)
    assert_allclose(np.column_stack([pitch, roll]), pair.cpu.attitudes(every), atol=1e-3)


def test_contacts_rewards_and_places_are_those_of_the_cpu_after_a_step_from_equal_states(pair: Pair):
    found = compare_steps(pair, 32 * 20)
    assert found["with_contact"] > 20
    assert found["flags_that_differ"] <= 0.001 * found["control_steps"]
    assert found["rewards_compared"] > 0.98 * found["control_steps"]
    assert found["largest_reward_difference"] < 1e-5
    assert found["places_beyond_0.1_mm"] < found["control_steps"] / 2
    assert found["overflows"] == found["not_finite"] == found["outside"] == 0


def test_robots_that_push_into_rock_stay_in_the_mine(pair: Pair):
    found = stress(pair, 200)
    assert found["contacts"] >= 200
    assert found["not_finite"] == found["outside"] == found["overflows"] == 0
    assert found["least_clearance_m"] > RobotParams().radius_m - 0.1
    assert found["largest_iterations"] < ITERATIONS == pair.warp.physics.host_model.opt.iterations


def test_an_empty_slot_is_no_rock_even_for_a_lone_robot(tee: BuiltMine):
    pair = Pair(load_world(tee.bundle), 1, "cpu")
    pair.forget_faults()
    pair.scatter(np.random.default_rng(0), clearance_m=1.2)
    pair.share_state()
    pair.push()
    physics, touched = pair.warp.physics, pair.warp.arrays["touched"]
    slots = [k for k in range(physics.host_model.ngeom) if physics.host_model.geom(k).name.startswith("rock_slot_")]
    assert len(slots) == physics.slots
    numbers, places = physics.model.geom_dataid.numpy(), physics.data.geom_xpos.numpy()
    numbers[:, slots], places[:, slots] = -1, physics.data.qpos.numpy()[:, None, :3]
    physics.model.geom_dataid.assign(numbers)
    physics.data.geom_xpos.assign(places)
    physics.advance(2, touched)
    assert not touched.numpy().any()


def test_it_is_made_by_make_vec_and_returns_views_of_its_own_tensors(tee: BuiltMine):
    env = gymnasium.make_vec(
        "MineXplore/World-v0",
        num_envs=4,
        vectorization_mode="vector_entry_point",
        world=str(tee.bundle),
        task=SHORT,
        backend="warp",
        device="cpu",
    )
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    first, info = env.reset(seed=0)
    assert env.observation_space.contains(first.numpy())
    where = first.data_ptr(), info["pose_m_rad"].data_ptr()
    observation, reward, terminated, truncated, info = env.step(torch.zeros((4, 2)))
    assert (observation.data_ptr(), info["pose_m_rad"].data_ptr()) == where
    assert observation.dtype == reward.dtype == torch.float32
    assert terminated.dtype == truncated.dtype == torch.bool
    assert not terminated.any()
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        env.step(torch.zeros((4, 2)))


def test_a_step_reads_nothing_back_from_the_device(tee: BuiltMine, monkeypatch):
    envs = [make(tee, autoreset_mode=mode) for mode in ("NEXT_STEP", "SAME_STEP")]
    for env in envs:
        env.reset(seed=0)
        env.step(torch.zeros((4, 2)))

    def refuse(*args, **kwargs):
        raise AssertionError("a step waited for the device")

    monkeypatch.setattr(wp.array, "numpy", refuse)
    for name in ("cpu", "numpy", "item", "tolist", "__bool__", "nonzero"):
        monkeypatch.setattr(torch.Tensor, name, refuse)
    for env in envs:
        for _ in range(4):
            env.step(torch.zeros((4, 2)))


def test_next_step_resets_in_the_step_after_the_last_and_ignores_its_action(tee: BuiltMine):
    env = make(tee)
    _, info = env.reset(seed=0)
    start = info["pose_m_rad"].clone()
    for step in range(1, 10):
        observation, reward, _, truncated, info = env.step(torch.ones((4, 2)))
        assert bool(truncated.all()) == bool(truncated.any()) == (step % 4 == 3)
        if step % 4 == 0:
            assert (reward == 0).all()
            assert (observation[:, 16:] == 0).all()
            assert (info["collisions"] == 0).all()
            assert_allclose(info["pose_m_rad"][:, :2], start[:, :2], atol=1e-4)
            assert (info["pose_m_rad"][:, 2] != start[:, 2]).all()
        else:
            assert (observation[:, 16] == 1).all()
    env.close()


def test_same_step_resets_at_once_and_hands_on_what_was_last_seen(tee: BuiltMine):
    env, plain = make(tee, autoreset_mode="SAME_STEP"), make(tee)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    env.reset(seed=0)
    plain.reset(seed=0)
    for step in range(1, 7):
        observation, reward, _, truncated, info = env.step(torch.ones((4, 2)))
        assert bool(truncated.all()) == (step % 3 == 0)
        assert (info["_final_obs"] == truncated).all()
        if step <= 3:
            expected = plain.step(torch.ones((4, 2)))
            assert_allclose(reward, expected[1], atol=1e-6)
        if step == 3:
            assert_allclose(info["final_obs"], expected[0], atol=1e-5)
            assert_allclose(info["final_info"]["pose_m_rad"], expected[4]["pose_m_rad"], atol=1e-5)
            assert (observation[:, 16:] == 0).all()


def test_a_masked_reset_leaves_the_other_robots_alone(tee: BuiltMine):
    env = make(tee, task={**SHORT, "max_steps": 100})
    env.reset(seed=0)
    for _ in range(3):
        observation, _, _, _, info = env.step(torch.ones((4, 2)))
    before, seen = observation.clone(), info["cells_seen"].clone()
    steps = env.tensors["steps"].clone()
    observation, info = env.reset(seed=5, options={"reset_mask": np.array([True, False, False, True])})
    assert_array_equal(observation[1:3], before[1:3])
    assert_array_equal(info["cells_seen"][1:3], seen[1:3])
    assert env.tensors["steps"].tolist() == [0, int(steps[1]), int(steps[2]), 0]
    again, _ = env.reset(seed=5)
    assert_array_equal(again[[0, 3]], observation[[0, 3]])


def test_a_seed_gives_a_robot_the_same_episode_among_any_number_of_others(tee: BuiltMine):
    few, many = make(tee, 2), make(tee, 5)
    assert_array_equal(few.reset(seed=3)[0], many.reset(seed=3)[0][:2])
    for _ in range(2):
        action = torch.ones((5, 2))
        assert_allclose(few.step(action[:2])[0], many.step(action)[0][:2], atol=1e-6)
    assert (few.reset(seed=4)[0][0] == many.reset(seed=3)[0][1]).all()
    assert (few.reset(seed=5)[0] != many.reset(seed=3)[0][:2]).any()


def test_arrays_have_the_keys_shapes_and_kinds_of_the_cpus(tee: BuiltMine):
    env, cpu = make(tee, numpy=True), MineVectorEnv(4, tee.bundle, task=SHORT)
    for ours, theirs in zip(env.reset(seed=0), cpu.reset(seed=0), strict=True):
        if isinstance(ours, np.ndarray):
            assert ours.shape == theirs.shape
            assert ours.dtype == theirs.dtype
    ours, theirs = env.step(np.zeros((4, 2))), cpu.step(np.zeros((4, 2)))
    assert ours[4].keys() == theirs[4].keys()
    for name, value in theirs[4].items():
        assert ours[4][name].shape == value.shape
        assert ours[4][name].dtype.kind == value.dtype.kind, name
    for name in ("cells_reachable", "zone"):
        assert_array_equal(ours[4][name], theirs[4][name])
    assert not np.shares_memory(ours[0], env.step(np.zeros((4, 2)))[0])


def test_what_goes_wrong_on_the_device_is_listed_on_request(tee: BuiltMine):
    env = make(tee)
    env.reset(seed=0)
    action = torch.zeros((4, 2))
    action[2, 0] = torch.nan
    env.step(action)
    with pytest.raises(RuntimeError, match="robot 2: an action was not two finite numbers"):
        env.check()
    env.reset(seed=0)
    env.check()
    env.robots.physics.data.qpos.assign(np.full((4, 9), np.nan))
    _, _, _, truncated, _ = env.step(torch.zeros((4, 2)))
    assert truncated.all()
    with pytest.raises(RuntimeError, match="not finite"):
        env.check()
    env.step(torch.zeros((4, 2)))  # resets
    observation, *_ = env.step(torch.zeros((4, 2)))
    assert torch.isfinite(observation).all()
    env.reset(seed=0)
    env.robots.physics.data.overflow.fill_(8)
    with pytest.raises(RuntimeError, match="overflow"):
        env.check()


def test_an_episode_ends_when_the_robot_has_stalled_as_on_the_cpu(tee: BuiltMine):
    task = {"stall_steps": 4}
    env, cpu = make(tee, task=task), MineVectorEnv(4, tee.bundle, task=task)
    env.reset(seed=0)
    cpu.reset(seed=0)
    moves = [0.0, 0.0, 0.0, 0.006, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5, 0.0]
    ends = []
    for forward in moves:
        action = np.tile([forward, 1.0], (4, 1))
        ends.append((env.step(torch.tensor(action))[3].tolist(), cpu.step(action)[3].tolist()))
    assert all(ours == theirs for ours, theirs in ends)
    assert [i for i, (ours, _) in enumerate(ends) if all(ours)] == [3]


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"device": "cuda:7"}, "there is"),
        ({"device": "tpu"}, "there is"),
        ({"render_mode": "rgb_array"}, "shows nothing"),
        ({"autoreset_mode": "NEVER"}, "valid choices are NEXT_STEP, SAME_STEP"),
        ({"num_envs": 0}, "want a whole number from 1"),
    ],
)
def test_wrong_arguments_are_refused_by_name(tee: BuiltMine, kwargs, message):
    arguments = {"num_envs": 2, "backend": "warp", "device": "cpu", "world": tee.bundle} | kwargs
    with pytest.raises(ValueError, match=message):
        make_vector_env(**arguments)


def test_a_robot_whose_controls_are_not_linear_is_refused(tee: BuiltMine):
    class Squared(RobotParams):
        def controls(self, forward_mps, turn_radps):
            return super().controls(forward_mps**2, turn_radps)

    with pytest.raises(ValueError, match="must be linear"):
        make(tee, robot=Squared())


def test_a_world_that_is_one_volume_is_refused_in_one_line(box):
    with pytest.raises(ValueError, match=r"drives on level floors; this mine has heights$"):
        make_vector_env(2, backend="warp", device="cpu", world=box)
