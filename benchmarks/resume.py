"""Measurements that go on where the last run stopped, and how their commands end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from tqdm import tqdm

from baselines.base.errors import BaselineError
from pipeline.errors import MineError

Row = dict[str, Any]


def resume(
    path: Path,
    wanted: Iterable[Any],
    measure: Callable[[list[Any]], Iterable[Row]],
    unit: str,
    key: Callable[[Row], Any] = lambda row: row["seed"],
) -> list[Row]:
    """Return the rows of a file of JSON lines, with those that are missing, which are measured and added to it.

    Parameters
    ----------
    path : Path
    wanted : iterable
        The keys of the rows that the file must hold.
    measure : callable
        Yields the rows of a list of keys, in any order.
    unit : str
        What a row is of, for the progress bar.
    key : callable
        Returns a row's key.
    """
    lines = path.read_text().splitlines() if path.is_file() else []
    rows = {key(row): row for row in map(json.loads, lines)}
    missing = [each for each in wanted if each not in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as log:
        for row in tqdm(measure(missing), total=len(missing), unit=unit, disable=None):
            rows[key(row)] = row
            log.write(json.dumps(row) + "\n")
            log.flush()
    return list(rows.values())


def run_benchmark(name: str, command: Callable[[], int]) -> int:
    """Run a command; return its exit code, or 2 after an expected error, which is one line."""
    try:
        return command()
    except (MineError, BaselineError, FileNotFoundError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 2
