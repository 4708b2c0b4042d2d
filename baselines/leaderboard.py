"""Write `LEADERBOARD.md` from the results files: `python -m baselines.leaderboard`. Each is scored first."""

from __future__ import annotations

import sys
from pathlib import Path

from baselines.errors import BaselineError, run_command
from baselines.oracle.record import bound_of, read_bounds
from baselines.results import RESULTS, as_text, read_results
from baselines.score import score
from baselines.statistics import Figure, figures

PAGE = Path("LEADERBOARD.md")
_ALWAYS = ("area under coverage", "time to 50 %, s", "collisions per 100 m", "return")


def leaderboard(results: Path) -> str:
    """Return the page: a table an environment, the policy that covers most at the top.

    Raises
    ------
    BaselineError
        If there are no results, or one is rejected.
    """
    files = sorted(results.glob("*/*.jsonl"))
    if not files:
        raise BaselineError(f"{results}: no results; `python -m baselines.evaluate` writes them")
    tables: dict[str, list[tuple[float, str, int, dict[str, Figure]]]] = {}
    for path in files:
        score(path)
        head, episodes = read_results(path)
        found = dict(figures(head, episodes, bound_of(head.env, head.world_sha256)))
        last = [name for name in found if name.startswith("coverage at")][-1]
        tables.setdefault(head.env, []).append((found[last].value or 0.0, head.policy, len(episodes), found))
    lines = [
        "# Leaderboard", "",
        "Written by `make leaderboard` from `baselines/results/`, each file scored first. Interquartile means over",
        "seeds, 95 % bootstrap intervals in brackets. Coverage is of all reachable cells; the bound is what no robot",
        "can exceed ([docs/benchmark.md](docs/benchmark.md)). Classical explorers map with the true pose.", "",
    ]  # fmt: skip
    for env, rows in sorted(tables.items()):
        bound = read_bounds().get(env)
        lines += [f"## {env}", ""]
        if bound is not None:
            lines += [
                f"{bound.cells:,} cells. No robot can have seen more than {bound.most[-1]:,} of them "
                f"({bound.most[-1] / bound.cells:.1%}) at {bound.time_s[-1]:g} s.", "",
            ]  # fmt: skip
        shown = [n for n in rows[0][3] if n.startswith(("coverage at", "share of bound"))]
        shown = [n for n in shown if n.startswith("coverage at")] + shown[-1:] + list(_ALWAYS)
        lines += [f"| policy | seeds | {' | '.join(shown)} |", "|---" * (len(shown) + 2) + "|"]
        for _, policy, count, found in sorted(rows, key=lambda row: -row[0]):
            cells = [as_text(n, found.get(n, Figure(None, None, None, 0))) for n in shown]
            lines.append(f"| {policy} | {count} | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def main() -> None:
    """Write the page."""
    PAGE.write_text(leaderboard(RESULTS))
    print(f"{PAGE} is written")


if __name__ == "__main__":
    sys.exit(run_command("leaderboard", main))
