"""Episodes in unseen mines: draws by seed, one mine a robot, copies, and clear refusals."""

import copy
import json
import shutil

import gymnasium
import numpy as np
import pytest

from minexplore.bundle import RECORD, world_sha256
from minexplore.envs.env import MineEnv
from minexplore.envs.family import FamilyEnv, FamilyVectorEnv
from minexplore.sealed.world import hash_files
from minexplore.splits import parse_name
from tests.composed import compose
from tests.mines import RING, STRAIGHT, TEE, BuiltMine

MINES = ["train-0000", "train-0001", "train-0002"]
NUMBERS = {parse_name(name)[1] for name in MINES}


@pytest.fixture(scope="module")
def families(tmp_path_factory):
    """Return a folder with three light worlds of the training split."""
    root = tmp_path_factory.mktemp("families")
    config = compose(["preset=light"])
    for number, polygon in enumerate((STRAIGHT, RING, TEE)):
        BuiltMine(polygon, config, root / f"light/train/{number:04d}/realism/world")
    return root


@pytest.fixture
def env(families):
    env = FamilyEnv("train", MINES, families)
    yield env
    env.close()


def drive(env, steps, seed):
    """Return observations, rewards and mines of some steps with drawn actions."""
    rng, rows = np.random.default_rng(seed), []
    for _ in range(steps):
        observation, reward, _, _, info = env.step(rng.uniform(-1, 1, 2).astype(np.float32))
        rows.append((observation, reward, int(info["mine"])))
    return rows


def equal(one, two):
    return all((a[0] == b[0]).all() and a[1:] == b[1:] for a, b in zip(one, two, strict=True))


def test_the_seed_decides_about_the_mine_and_the_episode(env, families):
    other = FamilyEnv("train", MINES, families)
    entered = []
    for seed in range(6):
        first, info = env.reset(seed=seed)
        second, same = other.reset(seed=seed)
        assert info["mine"] == same["mine"]
        np.testing.assert_array_equal(first, second)
        assert equal(drive(env, 5, seed), drive(other, 5, seed))
        entered.append(int(info["mine"]))
    assert len(set(entered)) > 1
    other.close()


def test_resets_without_a_seed_draw_all_mines(env):
    env.reset(seed=0)
    assert {int(env.reset()[1]["mine"]) for _ in range(30)} == NUMBERS


def test_an_episode_is_that_of_the_mine_alone(env, families):
    _, info = env.reset(seed=3, options={"mine": "train-0001"})
    assert info["mine"] == 1
    rng = np.random.Generator(np.random.PCG64(3))
    rng.integers(3)
    alone = MineEnv(families / "light/train/0001/realism/world")
    expected, _ = alone.reset(seed=int(rng.integers(2**31)))
    observation, _ = env.reset(seed=3, options={"mine": "train-0001"})
    np.testing.assert_array_equal(observation, expected)
    action = np.array([1.0, 0.2])
    np.testing.assert_array_equal(env.step(action)[0], alone.step(action)[0])
    alone.close()


def test_a_draw_does_not_depend_on_which_mines_are_built(families):
    whole = FamilyEnv("train", None, families)
    for seed in range(40):
        rng = np.random.Generator(np.random.PCG64(seed))
        number = int(rng.integers(1000))
        if number < 3:
            assert whole.reset(seed=seed)[1]["mine"] == number
            continue
        with pytest.raises(FileNotFoundError, match=f"mine train-{number:04d} is not built"):
            whole.reset(seed=seed)
    assert len(whole.names) == 1000


def test_a_copy_goes_on_in_the_same_mine_with_the_same_numbers(env):
    env.reset(seed=11)
    drive(env, 3, 0)
    twin = copy.deepcopy(env)
    assert equal(drive(env, 5, 1), drive(twin, 5, 1))
    assert env.reset()[1]["mine"] == twin.reset()[1]["mine"]
    twin.close()


def test_robots_of_the_vector_environment_are_scalar_ones_with_consecutive_seeds(families):
    vector = gymnasium.make_vec("MineXplore/Family-v0", 3, mines=MINES, families=families)
    observation, info = vector.reset(seed=20)
    singles = [FamilyEnv("train", MINES, families) for _ in range(3)]
    for robot, single in enumerate(singles):
        first, own = single.reset(seed=20 + robot)
        np.testing.assert_array_equal(observation[robot], first)
        assert info["mine"][robot] == own["mine"]
    action = np.tile(np.array([0.8, -0.3], np.float32), (3, 1))
    for _ in range(5):
        observation, reward, *_ = vector.step(action)
        for robot, single in enumerate(singles):
            alone = single.step(action[robot])
            np.testing.assert_array_equal(observation[robot], alone[0])
            assert reward[robot] == pytest.approx(alone[1])
    assert vector.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.NEXT_STEP
    for closing in (vector, *singles):
        closing.close()


def test_an_episode_that_ends_is_followed_by_one_in_a_drawn_mine(families):
    vector = gymnasium.make_vec("MineXplore/Family-v0", 2, mines=MINES, families=families, max_episode_steps=2)
    vector.reset(seed=0)
    entered = set()
    for _ in range(40):
        *_, info = vector.step(np.zeros((2, 2), np.float32))
        entered |= set(info["mine"].tolist())
    assert entered == NUMBERS
    vector.close()


def test_the_id_passes_gymnasiums_checks_of_wrappers_and_steps(families):
    env = gymnasium.make("MineXplore/Family-v0", mines=MINES, families=families, render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(env.action_space.sample())
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    assert env.render().shape == (480, 640, 3)
    env.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"split": "dev"}, "split = 'dev': valid choices are train, validation, test"),
        ({"mines": 0}, "mines = 0: train has 1 to 1000"),
        ({"split": "test", "mines": 201}, "mines = 201: test has 1 to 200"),
        ({"mines": ["test-0001"]}, r"mines = \['test-0001'\]: want names of the split train"),
        ({"mines": []}, "want names of the split train"),
        ({"mines": ["mine"]}, "mine = 'mine': want one of"),
        ({"world": "chilean_mine"}, "world: a family draws its worlds"),
        ({"split": []}, r"split = \[\]: valid choices"),
        ({"mines": 1.5}, "mines = 1.5: want a number of mines, or a list of names"),
        ({"mines": [5]}, r"mines = \[5\]: want names of the split train, each once"),
        ({"mines": ["train-0000"] * 2}, "want names of the split train, each once"),
        ({"families": 5}, "families = 5: want the path of a folder"),
        ({"speed": 2}, "speed: unknown argument; there are task, robot"),
        ({"render_mode": "ascii"}, "render_mode = 'ascii': valid choices"),
        ({"lidar": "sonar"}, "lidar = 'sonar': want auto, embree, open3d"),
        ({"lidar": []}, r"lidar = \[\]: want auto, embree, open3d"),
        ({"whole": 3}, "whole = 3: want True or False"),
    ],
)
def test_a_wrong_argument_is_refused_by_name(arguments, words):
    with pytest.raises(ValueError, match=words):
        FamilyEnv(**arguments)


def test_a_mine_that_is_not_drawn_is_refused_and_so_is_a_closed_environment(env):
    with pytest.raises(ValueError, match="mine = 'train-0009': want one of train-0000 to train-0002"):
        env.reset(options={"mine": "train-0009"})
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        env.reset()


@pytest.mark.parametrize("name", ["test-0007", "validation-0001", "default-variants-0003"])
def test_nothing_is_trained_in_a_mine_that_policies_are_judged_by(name, families, tmp_path):
    from baselines.base.environments import require_trainable
    from baselines.base.errors import BaselineError

    folder = tmp_path / "world"
    shutil.copytree(families / "light/train/0002/realism/world", folder)
    for named in ("train-0002", name):
        record = json.loads((folder / RECORD).read_text())
        model = (folder / "mine.xml").read_text().replace(f'model="{record["name"]}"', f'model="{named}"')
        (folder / "mine.xml").write_text(model)
        record["name"] = named
        record["files"]["mine.xml"] = hash_files({"mine.xml": model.encode()})["mine.xml"]
        record["world_sha256"] = world_sha256(record)
        (folder / RECORD).write_text(json.dumps(record))
        env_id = f"MineXplore/Judged-{named}-v0"
        gymnasium.register(
            env_id,
            "minexplore.envs.env:MineEnv",
            vector_entry_point="minexplore.envs.vector:MineVectorEnv",
            kwargs={"world": folder},
        )
        try:
            if named == "train-0002":
                require_trainable(env_id)
            else:
                with pytest.raises(
                    BaselineError, match=f"world {name} is of the split .*, which nothing is trained in"
                ):
                    require_trainable(env_id)
        finally:
            del gymnasium.registry[env_id]


def test_calls_of_a_vector_that_make_no_sense_are_refused_by_name(families):
    for count in (0, True, 2.5, 10**9):
        with pytest.raises(ValueError, match=f"num_envs = {count!r}: want a whole number from 1 to 4096"):
            FamilyVectorEnv(count, families=families)
    with pytest.raises(ValueError, match="autoreset_mode = 'x': valid choices are NEXT_STEP, SAME_STEP"):
        FamilyVectorEnv(2, "x", families=families)
    env = FamilyVectorEnv(2, families=families, mines=MINES)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.reset(options={"reset_mask": np.array([True, False])})
    first, _ = env.reset(seed=1)
    for options, message in (
        (5, "options = 5: want a dict"),
        ({"x": 1}, "options: unknown 'x'; there are: mine, reset_mask"),
        ({"reset_mask": np.ones(3, bool)}, r"reset_mask of bool with shape \(3,\)"),
        ({"reset_mask": np.zeros(2, bool)}, "reset_mask: it names no robot"),
        ({"mine": 5}, "options: mine = 5"),
    ):
        with pytest.raises(ValueError, match=message):
            env.reset(options=options)
    for actions in (np.ones((3, 2)), None, [[1, 2]], [[10**400, 0], [0, 0]]):
        with pytest.raises(ValueError, match="action"):
            env.step(actions)
    given = {"reset_mask": np.array([True, False])}
    env.reset(seed=1, options=given)
    assert list(given) == ["reset_mask"]  # the caller's options are not changed
    np.testing.assert_array_equal(env.reset(seed=1)[0], first)
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        env.reset()
