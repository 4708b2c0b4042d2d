"""Teams against one robot: `python -m baselines.team`; it writes `artifacts/bench/team.json` and docs/team.md."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from baselines.beams import beam_ranges
from baselines.environments import BENCHMARK, find_id
from baselines.errors import BaselineError, run_command
from baselines.explorers.team import AssignedFrontiers
from baselines.progress import Progress
from baselines.statistics import Figure, estimate
from minexplore.multi_agent import MineParallelEnv

_OUT, _PAGE = Path("artifacts/bench/team.json"), Path("docs/team.md")
_SIZES = (1, 2, 4)
_HEADING = """# Teams

Written by `make teams`. Robots of a team map together, and `scipy.optimize.linear_sum_assignment` gives each a
cluster of the frontier so that the sum of path lengths is least (`baselines/explorers/team.py`). They see and touch
each other. Interquartile means over seeds with 95 % bootstrap intervals. The speed-up is one robot's time to its last
coverage, divided by the team's time to the same coverage. All robots start at the entrance: until the first junction a
team sees little more than its first robot does.
"""


def drive_team(env_id: str, robots: int, seed: int, step_done: Any = lambda count: None) -> tuple[np.ndarray, int]:
    """Drive one episode of a team.

    Returns
    -------
    (steps + 1,) float
        The share of reachable cells that the team has seen, at the start and after each control step.
    int
        Steps of all robots in contact with rock.
    """
    env = MineParallelEnv(robots, **gymnasium.spec(env_id).kwargs)
    try:
        if not env.world.floor.is_flat:
            raise BaselineError(f"{env_id}: its mine has heights; the team's map knows level mines only")
        policy = AssignedFrontiers(robots, env.task, env.robot)
        observation, info = env.reset(seed=seed)
        agents, curve, collisions = env.possible_agents, [], 0
        curve.append(info[agents[0]]["team_coverage"])
        while env.agents:
            rows = np.stack([observation[a] for a in agents])
            poses = np.stack([info[a]["pose_m_rad"] for a in agents])
            commands = policy.act(beam_ranges(rows, env.task), poses)
            observation, _, _, _, info = env.step(dict(zip(agents, commands, strict=True)))
            curve.append(info[agents[0]]["team_coverage"])
            collisions += sum(bool(info[a]["collision"]) for a in agents)
            step_done(1)
        return np.array(curve), collisions
    finally:
        env.close()


def speed_up(one: np.ndarray, team: np.ndarray) -> float:
    """Return one robot's time to its last coverage, over the team's time to the same; nan if the team never has it."""
    reached = np.flatnonzero(team >= one[-1])
    return float(int((one >= one[-1]).argmax()) / max(int(reached[0]), 1)) if len(reached) else float("nan")


def measure(env_ids: list[str], seeds: list[int]) -> dict[str, Any]:
    """Return coverage, speed-up and collisions of each size of team in each environment, a value a seed."""
    found: dict[str, Any] = {"seeds": seeds, "envs": {}}
    for env_id in env_ids:
        steps = gymnasium.spec(env_id).kwargs.get("task", {}).get("max_steps", 6000)
        progress = Progress(f"teams in {env_id}", len(_SIZES) * len(seeds) * steps)
        driven = {n: [drive_team(env_id, n, seed, progress.add) for seed in seeds] for n in _SIZES}
        progress.close()
        found["envs"][env_id] = {
            str(n): {
                "coverage": [float(curve[-1]) for curve, _ in driven[n]],
                "speed_up": [speed_up(one, team) for (one, _), (team, _) in zip(driven[1], driven[n], strict=True)],
                "contact_steps": [contacts for _, contacts in driven[n]],
            }
            for n in _SIZES
        }
    return found


def page(found: dict[str, Any]) -> str:
    """Return the page of the figures."""
    lines = [_HEADING]
    for env_id, sizes in found["envs"].items():
        lines += [f"## {env_id}", "", f"{len(found['seeds'])} seeds.", ""]
        lines += ["| robots | coverage at the end | speed-up | steps in contact with rock |", "|---|---|---|---|"]
        for robots, values in sizes.items():
            reached = [value for value in values["speed_up"] if np.isfinite(value)]
            contacts = max(values["contact_steps"])
            cover, faster = _text(estimate(values["coverage"]), 100, " %"), _text(estimate(reached), 1, "")
            lines.append(f"| {robots} | {cover} | {faster} | at most {contacts} |")
        lines.append("")
    return "\n".join(lines)


def _text(figure: Figure, scale: float, unit: str) -> str:
    if figure.value is None or figure.low is None or figure.high is None:
        return "never"
    digits = 1 if scale > 1 else 2
    low, high = (f"{scale * v:.{digits}f}" for v in (figure.low, figure.high))
    return f"{scale * figure.value:.{digits}f}{unit} ({low} to {high})"


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.team", description=__doc__)
    parser.add_argument("--env", nargs="*", help="ids, or NAME for MineXplore/NAME-v0; all that ship by default")
    parser.add_argument("--episodes", type=int, default=10)
    arguments = parser.parse_args()
    if not 1 <= arguments.episodes <= 512:
        raise BaselineError(f"episodes = {arguments.episodes}: want 1 to 512")
    found = measure([find_id(name) for name in arguments.env or BENCHMARK], list(range(arguments.episodes)))
    _OUT.parent.mkdir(parents=True, exist_ok=True)
    _OUT.write_text(json.dumps(found, indent=1) + "\n")
    text = page(found)
    _PAGE.write_text(text)
    print(text)


if __name__ == "__main__":
    sys.exit(run_command("team", main))
