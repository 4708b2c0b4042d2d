"""Write `LEADERBOARD.md` from the results files: `python -m baselines.leaderboard`. Each file is scored first."""

from __future__ import annotations

import sys
from pathlib import Path

from baselines.bounds import Bound, bound_of, read_bounds
from baselines.environments import BENCHMARK
from baselines.errors import BaselineError, run_command
from baselines.result_file import RESULTS, read_results
from baselines.score import score
from baselines.statistics import Figure, as_text, figures

PAGE = Path("LEADERBOARD.md")
_ALWAYS = ("area under coverage", "time to 50 %, s", "collisions per 100 m", "return")
_HEADING = """# Leaderboard

Written by `make leaderboard` from `baselines/results/`, each file scored first. Interquartile means over
seeds, 95 % bootstrap intervals in brackets. Coverage is of all reachable cells; the bound is what no robot
can exceed ([docs/benchmark.md](docs/benchmark.md)). Classical explorers map with the true pose.
"""
_Row = tuple[str, int, dict[str, Figure]]  # policy, number of seeds, figures


def leaderboard(results: Path) -> str:
    """Return the page: a table for each environment, own mines last, the policy with the highest coverage first.

    Raises
    ------
    BaselineError
        If there are no results, or one is rejected.
    """
    files = sorted(results.glob("*/*.jsonl"))
    if not files:
        raise BaselineError(f"{results}: no results; `python -m baselines.evaluate` writes them")
    tables: dict[str, list[_Row]] = {}
    for path in files:
        score(path)
        head, episodes = read_results(path)
        found = dict(figures(head, episodes, bound_of(head.env, head.world_sha256)))
        tables.setdefault(head.env, []).append((head.policy, len(episodes), found))
    envs = sorted(tables, key=lambda env: (env not in BENCHMARK, env))
    return "\n".join([_HEADING, *(_section(env, tables[env], read_bounds().get(env)) for env in envs)])


def _section(env_id: str, rows: list[_Row], bound: Bound | None) -> str:
    """Return one environment's heading, bound and table."""
    lines = [f"## {env_id}", ""]
    if bound is not None:
        lines += [
            f"{bound.cells:,} cells. No robot can have seen more than {bound.most[-1]:,} of them "
            f"({bound.most[-1] / bound.cells:.1%}) at {bound.time_s[-1]:g} s.",
            "",
        ]
    names = list(rows[0][2])
    coverage = [name for name in names if name.startswith("coverage at")]
    shares = [name for name in names if name.startswith("share of bound")]
    shown = [*coverage, *shares[-1:], *_ALWAYS]
    lines += [f"| policy | seeds | {' | '.join(shown)} |", "|---" * (len(shown) + 2) + "|"]
    for policy, count, found in sorted(rows, key=lambda row: -(row[2][coverage[-1]].value or 0.0)):
        cells = [as_text(name, found.get(name, Figure(None, None, None, 0))) for name in shown]
        lines.append(f"| {policy} | {count} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def main() -> None:
    """Write the page."""
    PAGE.write_text(leaderboard(RESULTS))
    print(f"{PAGE} is written")


if __name__ == "__main__":
    sys.exit(run_command("leaderboard", main))
