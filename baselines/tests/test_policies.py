import re

import numpy as np
import pytest

from baselines.base.environments import make_env
from baselines.base.errors import BaselineError
from baselines.explorers import EXPLORERS
from baselines.explorers.frontier import NearestFrontier
from baselines.explorers.maps.own_map import FINE, FREE, ROCK, OwnMap
from baselines.explorers.pursuit import PathFollower, heading_errors
from baselines.policies.map_observation import RINGS_M, MapObserver
from baselines.policies.policy_lookup import _code_of, make_policy, policy_sha256, source_files
from baselines.running.protocol import run_episodes
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from tests.project import ROOT


def seen_from(place, yaw, box):
    """Return the observation of a robot in an empty rectangular room (west, south, east, north)."""
    west, south, east, north = box
    bearing = yaw + 2 * np.pi * np.arange(16) / 16
    along = np.column_stack([np.cos(bearing), np.sin(bearing)])
    with np.errstate(divide="ignore"):
        across = np.where(along > 0, ([east, north] - place) / along, ([west, south] - place) / along)
    ranges = np.clip(np.abs(across).min(axis=1), 0.12, 10.0)
    return np.concatenate([(ranges - 0.12) / 9.88, [0, 0, 0]]).astype(np.float32), ranges


def test_a_patch_turns_with_the_robot():
    maps = MapObserver(2, TaskParams())
    place = np.array([1.0, 1.0])
    poses = np.array([[*place, 0.0], [*place, np.pi / 2]])
    room = (-3.0, -3.0, 30.0, 5.0)
    patches = maps.observe(
        np.stack([seen_from(place, yaw, room)[0] for yaw in (0.0, np.pi / 2)]), {"pose_m_rad": poses}
    )
    one, other = patches.reshape(2, 3, 16, len(RINGS_M) - 1)
    np.testing.assert_allclose(np.roll(one[0], -4, axis=0), other[0])  # what lay ahead lies to the right
    assert one[0, 0, :2].min() == 1  # the room, open for 29 m ahead and seen as far as 10
    assert one[0, :, 4:].max() == 0
    assert one[1, 12].any()  # the wall four metres to the right
    assert not one[1, 0].any()
    assert one[2, :, 1:].max() == 0  # it has been where it stands


def test_a_patch_forgets_with_its_robot_alone():
    maps = MapObserver(2, TaskParams())
    observation = np.stack([seen_from(np.zeros(2), 0.0, (-4.0, -4.0, 4.0, 4.0))[0]] * 2)
    maps.observe(observation, {"pose_m_rad": np.zeros((2, 3))})
    maps.forget(np.array([1]))
    assert maps.seen[0].any()
    assert not maps.seen[1].any()


def test_an_own_map_knows_a_room_and_its_open_end():
    own = OwnMap(2.0)
    room = (-3.9, -3.9, 40.0, 3.9)
    rng = np.random.default_rng(0)
    for x in np.arange(0.0, 6.0, 0.1):
        yaw = rng.uniform(-np.pi, np.pi)
        place = np.array([x, 0.0])
        own.add(place, yaw + 2 * np.pi * np.arange(16) / 16, seen_from(place, yaw, room)[1], 10.0)
    row, col = own.at(np.array([[0.0, 0.0], [3.0, 3.95], [-3.95, 0.0]]), own.fine_m)
    assert own.fine[row, col].tolist() == [FREE, ROCK, ROCK]
    frontier = np.argwhere(own.frontier())[:, ::-1] + own.low
    assert (frontier[:, 0] * 2 >= 10).any()  # the open end
    assert not ((np.abs(frontier[:, 1] * 2 + 1) < 3) & (frontier[:, 0] < 3)).any()  # nothing within the room
    assert own.fine.shape == tuple(FINE * np.array(own.seen.shape))


def test_pursuit_turns_towards_its_path_and_stops_before_rock():
    clear, path = np.full(16, 10.0), np.column_stack([np.linspace(0, 5, 20), np.zeros(20)])
    pursuit = PathFollower(TaskParams(), RobotParams())
    assert pursuit.follow(path, np.array([0.0, 0.0, 0.0]), clear) == pytest.approx((1.0, 0.0))
    assert pursuit.follow(path, np.array([0.0, 0.0, -0.5]), clear)[1] > 0.5
    assert pursuit.follow(path, np.array([0.0, 0.0, np.pi]), clear)[0] == 0.0
    blocked = clear.copy()
    blocked[0] = 0.4
    assert pursuit.follow(path, np.array([0.0, 0.0, 0.0]), blocked)[0] <= 0.0


def test_pursuit_creeps_past_a_wall_that_it_does_not_touch():
    path, ranges = np.column_stack([np.linspace(0, 5, 20), np.zeros(20)]), np.full(16, 10.0)
    pursuit = PathFollower(TaskParams(), RobotParams())
    side = np.abs(np.sin(pursuit.bearings))
    ranges[(pursuit.bearings > 0.1) & (side > 0.1)] = 0.5 / side[(pursuit.bearings > 0.1) & (side > 0.1)]
    assert 0.0 < pursuit.follow(path, np.zeros(3), ranges)[0] < 0.5  # a wall 0.5 m to the left, the disc is 0.35 m wide
    ranges *= 0.36 / 0.5
    assert pursuit.follow(path, np.zeros(3), ranges)[0] < 0.0


def test_pursuit_steers_round_a_corner_and_not_across_it():
    leg = np.arange(0.0, 2.1, 0.4)
    path = np.concatenate([np.column_stack([leg[:3], np.zeros(3)]), np.column_stack([np.full(6, 0.8), leg])])
    error = heading_errors(path[None], np.array([len(path)]), np.zeros((1, 3)))
    assert abs(np.tan(error[0]) * 0.8) <= 0.3 + 1e-9  # straight ahead it would be 0, across the corner 1.2 m
    straight = np.column_stack([np.zeros(9), np.arange(9) * 0.4])
    paths, lengths = np.stack([straight, straight]), np.array([9, 2])
    np.testing.assert_allclose(heading_errors(paths, lengths, np.zeros((2, 3))), np.pi / 2)


def test_a_wider_robot_stops_farther_from_rock():
    path, ranges = np.column_stack([np.linspace(0, 5, 20), np.zeros(20)]), np.full(16, 10.0)
    ranges[0] = 0.7
    narrow, wide = (PathFollower(TaskParams(), RobotParams(radius_m=radius)) for radius in (0.35, 0.6))
    assert narrow.follow(path, np.zeros(3), ranges)[0] > 0.0
    assert wide.follow(path, np.zeros(3), ranges)[0] < 0.0


def test_the_authors_heuristic_is_their_formula():
    policy = make_policy("reactive", 2, TaskParams())
    observation = np.full((2, 19), 0.8, np.float32)
    observation[1, 0] = 0.4
    observation[1, 4:6] = 0.3
    expected = [[1.0, 0.0], [0.3, 0.5 * (0.6 - 1.6)]]
    np.testing.assert_allclose(policy.act(observation, {}), expected, atol=1e-6)


def test_random_commands_depend_on_the_seed_alone():
    one, two = make_policy("random", 2, TaskParams()), make_policy("random", 1, TaskParams())
    one.reset(np.arange(2), np.array([5, 6]))
    two.reset(np.arange(1), np.array([6]))
    for _ in range(25):
        np.testing.assert_array_equal(one.act(np.zeros((2, 19)), {})[1], two.act(np.zeros((1, 19)), {})[0])


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("wall-following", 0.6),
        ("nearest-frontier", 0.8),
        pytest.param("information-gain", 0.8, marks=pytest.mark.slow),
    ],
)
def test_an_explorer_sees_a_small_mine_and_touches_nothing(tee_id, name, least):
    env = make_env(tee_id, 1)
    (episode,) = run_episodes(env, make_policy(name, 1, env.task), [0])
    assert episode.seen[-1] / env.robots.grid.total >= least
    assert episode.collided == 0
    env.close()


def test_every_explorer_is_described_in_the_documentation():
    text = (ROOT / "docs/reference/benchmark.md").read_text()
    assert [name for name in EXPLORERS if f"| `{name}` |" not in text] == []


def test_the_explorer_of_the_documentation_drives_and_its_hash_covers_its_source(tee_id, tmp_path, monkeypatch):
    code = re.search(r"^```python\n(.*?)^```", (ROOT / "docs/how-to/evaluate.md").read_text(), flags=re.M | re.S)[1]
    (tmp_path / "my_explorer.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    env = make_env(tee_id, 2)
    policy = make_policy("my_explorer:Bouncer", 2, env.task, env.robot)
    for episode in run_episodes(env, policy, [0, 1]):
        assert episode.seen[-1] > episode.seen[0]
        assert episode.path_m > 10
    env.close()
    before = policy_sha256(policy)
    (tmp_path / "my_explorer.py").write_text(code + "\n")
    assert policy_sha256(policy) != before
    with pytest.raises(BaselineError, match=r"policy = 'my_explorer:Walker': cannot be imported"):
        make_policy("my_explorer:Walker", 1, env.task)


def test_a_hash_covers_the_modules_that_a_policy_imports():
    files = {path.name for path in source_files(NearestFrontier)}
    assert {"frontier.py", "planner.py", "own_map.py", "pursuit.py", "beams.py"} <= files
    assert not {"policy_lookup.py", "wall_following.py", "evaluate.py"} & files


def test_every_policy_has_a_hash_of_its_own_and_unknown_ones_are_refused_with_the_choices():
    hashes = {policy_sha256(make_policy(name, 1, TaskParams())) for name in EXPLORERS}
    assert len(hashes) >= len(EXPLORERS) - 1  # the two frontier policies share their source
    with pytest.raises(BaselineError, match=r"greedy.*valid choices are random, reactive"):
        make_policy("greedy", 1, TaskParams())
    with pytest.raises(BaselineError, match="valid choices are MineXplore/ChileanMine-v0"):
        make_env("MineXplore/Moon-v0", 1)


def test_the_hash_of_code_is_of_what_a_policy_does(tmp_path):
    def code(text):
        (tmp_path / "policy.py").write_text(text)
        return _code_of(tmp_path / "policy.py")

    first = code('"""Drive."""\n\nimport os\n\ndef act():\n    """Act."""\n    return 1\n')
    assert first == "def act():\n    return 1\n"
    assert code('"""Drive on."""\nfrom here import os\ndef act():\n    return 1\n') == first
    assert code("def act():\n    return 2\n") != first
