"""Tables of the reference, from the code: options of `new`, what files state, configuration, limits.

`python -m benchmarks.tables.reference` writes them between two marks of each page.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import re
import sys
from pathlib import Path

from baselines.base.markdown import write_table
from benchmarks.tables.configuration import configuration_table, noted_table
from pipeline.__main__ import command_line
from pipeline.compose import compose
from pipeline.metrics.limits import format_limit
from pipeline.params.validation import Limit, ValidationParams

FOLDER = Path("docs")
STATEMENTS = Path(__file__).with_name("statements.csv")  # of what files state: a row each, with the test that holds it
_KINDS = {"embedded": [], "own": ["+mine=own"], "heights": ["+mine=heights"]}  # of mine: what composes its limits
_CLAUSE = "certificate."
_OUTCOMES = (
    "What a file states about its coordinates is used (they follow it), listed (it changes nothing, and a remark says "
    "so)\nor refused."
)


def options_table() -> str:
    """Return the options of `python -m pipeline new` as its command line declares them."""
    actions = _command("new")._actions  # argparse has no public list of them
    named = [action for action in actions if action.option_strings and action.dest != "help"]
    rows = ((f"`{f'{action.option_strings[0]} {_value(action)}'.strip()}`", action.help or "") for action in named)
    return noted_table(("option", "meaning"), rows)


def _value(action: argparse.Action) -> str:
    """Return how an option's value is written in the help; empty for one that takes none."""
    if action.nargs == 0:
        return ""
    if action.choices:
        return "|".join(action.choices)
    return str(action.metavar or action.option_strings[0].removeprefix("--").replace("-", "_").upper())


def _command(name: str) -> argparse.ArgumentParser:
    """Return the parser of a command of `python -m pipeline`."""
    for action in command_line()._actions:
        if isinstance(action, argparse._SubParsersAction):
            return action.choices[name]
    raise LookupError(f"python -m pipeline has no command {name}")


def statements_table() -> str:
    """Return what the files of each format state about their coordinates, and what is done with it."""
    texts = []
    for name, rows in itertools.groupby(csv.DictReader(STATEMENTS.open(newline="")), lambda row: row["format"]):
        suffixes = re.sub(r"\.[a-z0-9]+", lambda found: f"`{found[0]}`", name)
        cells = ((row["states"], row["outcome"], row["how"]) for row in rows)
        texts.append(f"### {suffixes}\n\n{noted_table(('a file states', 'outcome', 'what is done'), cells)}")
    return "\n\n".join(texts)


def formats_tables() -> str:
    """Return the tables of the page of formats."""
    return f"{options_table()}\n\n## What files state\n\n{_OUTCOMES}\n\n{statements_table()}"


def limits_table() -> str:
    """Return each figure that has a limit, with its limit by kind of mine."""
    limits = {kind: limits_of(compose(overrides).validation) for kind, overrides in _KINDS.items()}
    names = sorted({name for kind in limits.values() for name in kind})
    rows = (
        (f"`{name}`", *(format_limit(kind[name]) if name in kind else "" for kind in limits.values())) for name in names
    )
    return noted_table(("figure", *limits), rows)


def limits_of(params: ValidationParams) -> dict[str, Limit]:
    """Return the limits of stage 6 by figure, those of the certificate's clauses among them."""
    return {**params.limits, **{f"{_CLAUSE}{name}": limit for name, limit in params.certificate.limits.items()}}


def volume_limits_table() -> str:
    """Return each figure of a world that is one volume with its limit."""
    limits = compose([]).validation.volume.limits
    return noted_table(("figure", "limit"), ((f"`{name}`", format_limit(limit)) for name, limit in limits.items()))


TABLES = {
    "reference/formats.md": formats_tables,
    "reference/configuration.md": configuration_table,
    "reference/metrics.md": limits_table,
    "reference/heights.md": volume_limits_table,
}


def main() -> int:
    """Write all tables."""
    for name, table in TABLES.items():
        path = FOLDER / name
        write_table(path, table())
        print(f"{path} is written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
