"""Write `LEADERBOARD.md` from the results files: `python -m baselines.leaderboard`. Each file is checked first."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from baselines.base.environments import BENCHMARK, find_id
from baselines.base.errors import BaselineError, RejectedError, run_command
from baselines.base.markdown import BEGIN, END, markdown_table, write_table
from baselines.base.result_file import RESULTS, Episode, Head, read_results, result_path
from baselines.base.statistics import Figure, as_text, figures
from baselines.pages.split_page import UNVERIFIED_HEADING, split_section
from baselines.policies.policy_lookup import RESERVED
from baselines.score import check, require_name
from baselines.scoring.bounds import Bound, bound_of, read_bounds
from baselines.scoring.degraded import degraded_table, read_degraded
from baselines.scoring.verified_runs import was_driven_here
from pieces.work import HERE, Where, add_options, where_of

PAGE = Path("LEADERBOARD.md")
_PROFILES = Path("docs/unseen-profiles.png")
_ID = "MineXplore/"  # of all environments
_WRITTEN_BY = "`python -m baselines.evaluate` writes them"
_WORSE_SENSES = "### By worse senses: points of coverage lost"
_ALWAYS = ("area under coverage", "time to 50 %, s", "collisions per 100 m", "return")


@dataclass(frozen=True)
class _LeaderboardRow:
    policy: str
    seeds: int
    verified: bool
    figures: dict[str, Figure]

    def text(self, name: str) -> str:
        """Return a figure as the table shows it."""
        return as_text(name, self.figures.get(name, Figure(None, None, None, 0)))


def leaderboard(results: Path, profiles: Path | None = None, where: Where = HERE) -> str:
    """Return the tables: one for each environment, own mines last, the policy with the highest coverage first.

    Parameters
    ----------
    results : Path
    profiles : Path, optional
        Where the performance profiles over the unseen mines are drawn.
    where : Where, optional
        Where the unseen mines are checked.

    Raises
    ------
    BaselineError
        If there are no results, or one is rejected.
    """
    sections = sections_of(results)
    return "\n".join([*filter(None, [split_section(results, "test", profiles, where)]), *sections.values()])


def sections_of(results: Path, envs: Collection[str] | None = None) -> dict[str, str]:
    """Return each environment's section by its id; of all, or of some.

    Raises
    ------
    BaselineError
        If there are no results, or one is rejected.
    """
    files = sorted(path for path in results.glob("*/*.jsonl") if not path.parent.name.startswith("Family-"))
    tables: dict[str, list[_LeaderboardRow]] = {}
    for path in files:
        head, episodes = read_results(path)
        if envs is None or head.env in envs:
            tables.setdefault(head.env, []).append(_row(results, path, head, episodes))
    absent = [env for env in envs or () if env not in tables]
    if absent or not tables:
        raise BaselineError(f"{results}: no results{f' of {absent[0]}' if absent else ''}; {_WRITTEN_BY}")
    return {env: _section(env, tables[env], read_bounds().get(env)) for env in sorted(tables, key=_order)}


def with_sections(tables: str, sections: dict[str, str]) -> str:
    """Return a page's tables with other sections of some environments; the others stay as they are."""
    parts = re.split(r"^(?=## )", tables.strip() + "\n", flags=re.MULTILINE)
    kept = {part.partition("\n")[0].removeprefix("## "): part.rstrip() + "\n" for part in parts if part.strip()}
    every = kept | sections
    unseen = [heading for heading in every if not heading.startswith(_ID)]
    return "\n".join(every[heading] for heading in [*unseen, *sorted(every.keys() - set(unseen), key=_order)])


def _order(env_id: str) -> tuple[bool, str]:
    return env_id not in BENCHMARK, env_id


def _row(results: Path, path: Path, head: Head, episodes: list[Episode]) -> _LeaderboardRow:
    """Return the row of a file that was checked."""
    check(path, head, episodes)
    place = result_path(head.policy, head.env)
    if path.parts[-2:] != place.parts[-2:]:
        raise RejectedError(
            f"{path}: results of {head.policy} in {head.env}, which are kept as {'/'.join(place.parts[-2:])}"
        )
    found = dict(figures(head, episodes, bound_of(head.env, head.world_sha256)))
    verified = was_driven_here(path, results, head, episodes)
    if not verified and head.policy not in RESERVED:  # the oracle's tour is the project's own
        require_name(path, head)
    return _LeaderboardRow(head.policy, len(episodes), verified, found)


def _section(env_id: str, rows: list[_LeaderboardRow], bound: Bound | None) -> str:
    """Return one environment's heading, bound and table."""
    lines = [f"## {env_id}", ""]
    if bound is not None:
        lines += [
            f"{bound.cells:,} cells. No robot can have seen more than {bound.most[-1]:,} of them "
            f"({bound.most[-1] / bound.cells:.1%}) at {bound.time_s[-1]:g} s.",
            "",
        ]
    names = list(rows[0].figures)
    coverage = [name for name in names if name.startswith("coverage at")]
    shares = [name for name in names if name.startswith("share of bound")]
    shown = [*coverage, *shares[-1:], *_ALWAYS]
    best_first = sorted(rows, key=lambda row: -(row.figures[coverage[-1]].value or 0.0))
    lines += _table([row for row in best_first if row.verified], shown)
    claimed = [row for row in best_first if not row.verified]
    lines += [UNVERIFIED_HEADING, "", *_table(claimed, shown)] if claimed else []
    degraded = read_degraded().get(env_id)
    return "\n".join([*lines, *([_WORSE_SENSES, "", degraded_table(degraded)] if degraded else [])])


def _table(rows: list[_LeaderboardRow], shown: list[str]) -> list[str]:
    """Return a table; none without rows."""
    cells = ((row.policy, row.seeds, *map(row.text, shown)) for row in rows)
    return [markdown_table(("policy", "seeds", *shown), cells)] if rows else []


def main() -> None:
    """Read the command line and write the page."""
    parser = argparse.ArgumentParser(prog="python -m baselines.leaderboard", description=__doc__)
    parser.add_argument("--env", nargs="*", help="ids, or NAME for MineXplore/NAME-v0; other sections stay as they are")
    add_options(parser, 1, keeps=False)
    arguments = parser.parse_args()
    if arguments.env:
        tables = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
        write_table(PAGE, with_sections(tables, sections_of(RESULTS, [find_id(name) for name in arguments.env])))
    else:
        write_table(PAGE, leaderboard(RESULTS, _PROFILES, where_of(arguments)))
    print(f"{PAGE} is written")


if __name__ == "__main__":
    sys.exit(run_command("leaderboard", main))
