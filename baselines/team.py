"""Teams against one robot: `python -m baselines.team`, `--split test --mines 20`; it writes parts/team.md."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np

from baselines.base.beams import beam_ranges
from baselines.base.environments import built_ids, find_id, make_env
from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table, write_table
from baselines.base.statistics import Figure, estimate
from baselines.explorers.team import AssignedFrontiers
from baselines.oracle.problem import CoverageProblem
from baselines.oracle.reach import cells_within_reach, least_time_s
from baselines.running.parallel import MEMORY_GB, code_of_episodes, facts_of_env
from baselines.scoring.split_statistics import middle, stratified
from minexplore.envs.multi_agent import MineParallelEnv
from minexplore.physics.robot import RobotParams
from minexplore.splits import SIZES, STYLES
from pieces.run import map_pieces
from pieces.work import Work, add_options, where_of

_PAGE = Path("docs/evidence/parts/team.md")
_ENV = "MineXplore/ChileanMineEntrance-v0"
_ROBOTS = (1, 2, 4)
_FIGURES = ("coverage", "speed_up", "contact_steps")  # of a record, a value for each size of team
_BAND_S = 2.0  # of the times at which the spawn's limit is computed
_UNSEEN = "MineXplore/Family-"
_KNOWN = ("pose_m_rad", "height_m", "pitch_rad", "roll_rad")  # what a team knows of an info
Key = tuple[str, int]  # environment and seed


@dataclass(frozen=True)
class TeamEpisode:
    """One episode of a team.

    Attributes
    ----------
    coverage : (steps + 1,) float
        The share of reachable cells that the team has seen, at the start and after each control step.
    contact_steps : int
        Steps of all robots in contact with rock.
    starts_m : (n, 3)
        Where the robots start, mine frame; the height is 0 in a level mine.
    """

    coverage: np.ndarray
    contact_steps: int
    starts_m: np.ndarray


def drive_team(env_id: str, robots: int, seed: int) -> TeamEpisode:
    """Drive one episode of a team.

    Raises
    ------
    BaselineError
        If its robots fly.
    """
    env = MineParallelEnv(robots, **gymnasium.spec(env_id).kwargs)
    try:
        if env.robot.FLIES:
            raise BaselineError(f"{env_id}: its robot flies; a team maps floors")
        driven = cast(RobotParams, env.robot)  # it uses what all on wheels have
        policy = AssignedFrontiers(robots, env.task, driven, env.world.has_heights)
        observation, info = env.reset(seed=seed)
        agents, contacts = env.possible_agents, 0
        starts_m = np.stack([[*info[a]["pose_m_rad"][:2], info[a].get("height_m", 0.0)] for a in agents])
        curve = [info[agents[0]]["team_coverage"]]
        while env.agents:
            rows = np.stack([observation[a] for a in agents])
            infos = {name: np.stack([info[a][name] for a in agents]) for name in _KNOWN if name in info[agents[0]]}
            commands = policy.act(beam_ranges(rows, env.task), infos)
            observation, _, _, _, info = env.step(dict(zip(agents, commands, strict=True)))
            curve.append(info[agents[0]]["team_coverage"])
            contacts += sum(bool(info[a]["collision"]) for a in agents)
        return TeamEpisode(np.array(curve), contacts, starts_m)
    finally:
        env.close()


def speed_up(one: np.ndarray, team: np.ndarray) -> float:
    """Return one robot's time to its last coverage, over the team's time to the same; nan if the team never has it."""
    reached = np.flatnonzero(team >= one[-1])
    return float(int((one >= one[-1]).argmax()) / max(int(reached[0]), 1)) if len(reached) else float("nan")


def measure(key: Key) -> dict[str, Any]:
    """Return the record of one seed in one environment: what each size of team saw, how fast, and the spawn's limit."""
    env_id, seed = key
    driven = [drive_team(env_id, robots, seed) for robots in _ROBOTS]
    one, starts_m = driven[0].coverage, np.concatenate([episode.starts_m for episode in driven])
    env = make_env(env_id, 1)
    try:
        within_reach = cells_within_reach(CoverageProblem.of(env.robots), starts_m, _BAND_S)
        last_s = int((one >= one[-1]).argmax()) * env.task.control_s
        least_s = least_time_s(within_reach, _BAND_S, round(one[-1] * env.robots.grid.total))
        limit = last_s / max(least_s, env.task.control_s)
    finally:
        env.close()
    return {
        "env": env_id,
        "seed": seed,
        "coverage": [float(episode.coverage[-1]) for episode in driven],
        "speed_up": [_finite(speed_up(one, episode.coverage)) for episode in driven],
        "contact_steps": [episode.contact_steps for episode in driven],
        "limit": limit,
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def tables(records: list[dict[str, Any]]) -> str:
    """Return the tables of records: unseen mines first, then each environment by itself."""
    lines: list[str] = []
    unseen = [record for record in records if record["env"].startswith(_UNSEEN)]
    if unseen:
        episodes = f"One episode in each of {len(unseen)} of the {SIZES['test']} mines."
        lines += ["## Unseen mines: the test split", "", episodes, "", *_table(unseen)]
    for env_id in dict.fromkeys(record["env"] for record in records if record not in unseen):
        own = [record for record in records if record["env"] == env_id]
        lines += [f"## {env_id}", "", f"{len(own)} seeds.", "", *_table(own)]
    return "\n".join(lines)


def _table(records: list[dict[str, Any]]) -> list[str]:
    """Return a table: a row a size of team."""
    rows = []
    limit = _text(_figure(records, [record["limit"] for record in records]), 1, "")
    for place, robots in enumerate(_ROBOTS):
        cover, faster, contacts = ([r[name][place] for r in records] for name in _FIGURES)
        never = f", never in {faster.count(None)}" if None in faster else ""
        ratio = _text(_figure(records, faster), 1, "") + never
        shown = [_text(_figure(records, cover), 100, " %"), ratio, limit if robots > 1 else ""]
        rows.append((robots, *shown, f"at most {max(contacts)}"))
    return [markdown_table(("robots", "coverage at the end", "speed-up", "limit", "steps in contact with rock"), rows)]


def _figure(records: list[dict[str, Any]], values: list[float | None]) -> Figure:
    """Return the interquartile mean of values that are there; mines of a split are drawn again within their style."""
    held = [(record["env"], value) for record, value in zip(records, values, strict=True) if value is not None]
    if not held or not held[0][0].startswith(_UNSEEN):
        return estimate([value for _, value in held])
    styles = np.array([int(env_id.split("-")[-2]) % len(STYLES) for env_id, _ in held])
    return stratified(middle, np.array([value for _, value in held]), strata=styles)


def _text(figure: Figure, scale: float, unit: str) -> str:
    if figure.value is None or figure.low is None or figure.high is None:
        return "never"
    digits = 1 if scale > 1 else 2
    low, high = (f"{scale * v:.{digits}f}" for v in (figure.low, figure.high))
    return f"{scale * figure.value:.{digits}f}{unit} ({low} to {high})"


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.team", description=__doc__)
    parser.add_argument("--env", nargs="*", default=[_ENV], help="ids, or NAME for MineXplore/NAME-v0")
    parser.add_argument("--episodes", type=int, default=4)
    parser.add_argument(
        "--mines", type=int, default=0, help="also one episode in each of the first mines of the test split"
    )
    add_options(parser, min(os.cpu_count() or 1, 16))
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= 512 or not 0 <= arguments.mines <= SIZES["test"]:
        raise BaselineError(
            f"episodes = {arguments.episodes}, mines = {arguments.mines}: want 1 to 512, 0 to {SIZES['test']}"
        )
    keys = [(find_id(name), seed) for name in arguments.env for seed in range(arguments.episodes)]
    keys += [(env_id, 0) for env_id in (built_ids("test", arguments.mines) if arguments.mines else [])]
    worlds = {env_id: facts_of_env(env_id) for env_id in dict.fromkeys(env_id for env_id, _ in keys)}
    work = Work("teams", measure, dict[str, Any], code_of_episodes(), worlds, memory_gb=MEMORY_GB)
    text = tables(map_pieces(work, keys, where_of(arguments)))
    if arguments.piece is None:
        write_table(_PAGE, text)
    print(text)


if __name__ == "__main__":
    sys.exit(run_command("team", main))
