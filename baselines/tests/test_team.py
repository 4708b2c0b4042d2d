import gymnasium
import numpy as np
import pytest

from baselines import team
from baselines.base.environments import make_env
from baselines.base.errors import BaselineError
from baselines.explorers.maps.own_map import ROCK
from baselines.explorers.team import AssignedFrontiers
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.reach import cells_within_reach, least_time_s
from baselines.team import drive_team, speed_up, tables
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from pieces.results import PiecesError

VECTOR = "minexplore.envs.vector:MineVectorEnv"


@pytest.mark.slow
def test_a_team_sees_at_least_as_much_as_one_robot_and_touches_nothing(tee_id):
    one, two = (drive_team(tee_id, robots, 0) for robots in (1, 2))
    assert two.contact_steps == 0
    assert two.coverage[-1] >= one.coverage[-1] - 0.05
    assert two.coverage[-1] >= 0.9
    assert (np.diff(two.coverage) >= 0).all()


def test_a_robot_of_the_team_is_not_mapped_as_rock():
    task = TaskParams()
    policy = AssignedFrontiers(2, task, RobotParams())
    poses = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, np.pi]])
    ranges = np.full((2, 16), 10.0)
    ranges[:, 0] = 3.8  # each sees the other one ahead
    policy.act(ranges, {"pose_m_rad": poses})
    own = policy.ground.map
    row, col = own.at(np.array([[3.8, 0.0], [0.2, 0.0]]), own.fine_m)
    assert (own.fine[row, col] != ROCK).all()


def test_the_speed_up_compares_times_to_the_same_coverage():
    one, team = np.linspace(0.0, 0.5, 101), np.linspace(0.0, 1.0, 101)
    assert speed_up(one, team) == pytest.approx(2.0)
    assert speed_up(one, one) == 1.0
    assert np.isnan(speed_up(team, one))


def test_a_team_explores_a_mine_with_heights_and_no_sooner_than_is_possible(ramp):
    env_id = "MineXplore/TeamRamp-v0"
    kwargs = {"world": str(ramp), "task": {"max_steps": 300, "terrain": False}}
    gymnasium.register(env_id, "minexplore.envs.env:MineEnv", vector_entry_point=VECTOR, kwargs=kwargs)
    try:
        episode, env = drive_team(env_id, 2, 0), make_env(env_id, 1)
        within_reach = cells_within_reach(CoverageProblem.of(env.robots), episode.starts_m, 1.0)
        total = env.robots.grid.total
        env.close()
    finally:
        del gymnasium.registry[env_id]
    assert episode.contact_steps == 0
    assert episode.coverage[-1] > 3 * episode.coverage[0]
    seen = np.round(episode.coverage * total)
    assert within_reach[-1] == total
    assert all(seen[10 * second] <= within_reach[second] for second in range(min(30, len(within_reach))))


def test_a_team_that_flies_is_refused():
    with pytest.raises(BaselineError, match="MineXplore/ChileanMineQuadrotor-v0: its robot flies; a team maps floors"):
        drive_team("MineXplore/ChileanMineQuadrotor-v0", 2, 0)


@pytest.mark.slow
def test_no_team_sees_a_cell_before_a_robot_can_have_come_to_where_it_is_in_view(tee_id):
    episode, env = drive_team(tee_id, 4, 0), make_env(tee_id, 1)
    within_reach, total = (
        cells_within_reach(CoverageProblem.of(env.robots), episode.starts_m, 1.0),
        env.robots.grid.total,
    )
    env.close()
    assert (np.diff(within_reach) >= 0).all()
    assert within_reach[-1] == total
    assert within_reach[0] < total // 2  # from the starts not all is in view
    for cells in range(within_reach[0] + 1, round(episode.coverage[-1] * total) + 1):
        first_s = 0.1 * int((np.round(episode.coverage * total) >= cells).argmax())
        assert 0.0 < least_time_s(within_reach, 1.0, cells) <= first_s


def test_the_tables_have_unseen_mines_first_and_say_where_a_team_never_sees_as_much():
    figures = {"coverage": [0.5, 0.6, 0.7], "speed_up": [1.0, 2.0, None], "contact_steps": [0, 0, 3], "limit": 4.0}
    seen = {"env": "MineXplore/ChileanMineEntrance-v0", "seed": 0, **figures}
    unseen = [{"env": f"MineXplore/Family-test-000{k}-v0", "seed": 0, **figures} for k in range(2)]
    text = tables([seen, *unseen])
    assert "2 of the 200 mines" in text
    assert text.index("Unseen mines") < text.index("## MineXplore/ChileanMineEntrance-v0\n\n1 seeds.")
    assert "| 4 | 70.0 % (70.0 to 70.0) | never, never in 2 | 4.00 (4.00 to 4.00) | at most 3 |" in text


@pytest.mark.slow
def test_a_record_of_a_small_mine_has_a_value_for_each_team(mines):
    record = team.measure((mines[0], 0))
    assert record["speed_up"][0] == 1.0
    assert len(record["coverage"]) == len(record["speed_up"]) == len(record["contact_steps"]) == 3
    assert record["limit"] >= max(value for value in record["speed_up"] if value is not None)


@pytest.mark.parametrize("arguments", [["--episodes", "0"], ["--mines", "201"], ["--jobs", "0"], ["--env", "nowhere"]])
def test_a_wrong_argument_is_refused(arguments, monkeypatch):
    monkeypatch.setattr("sys.argv", ["team", *arguments])
    with pytest.raises((BaselineError, PiecesError), match=r"want 1|valid choices"):
        team.main()


def test_mines_that_are_not_built_are_named(monkeypatch):
    monkeypatch.setattr("sys.argv", ["team", "--env", "--mines", "1"])
    monkeypatch.setattr("minexplore.FAMILY_MINES", {})
    with pytest.raises(BaselineError, match="python -m benchmarks worlds"):
        team.main()
