"""The table of security: each threat, the one defence that decides, its code, and how many lines that has."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from benchmarks.tables.configuration import noted_table


@dataclass(frozen=True)
class Defence:
    """What decides against a threat.

    Parameters
    ----------
    threat, decides : str
    code : tuple of str
        Files, and folders whose modules all belong to it, relative to the project.
    """

    threat: str
    decides: str
    code: tuple[str, ...]


DEFENCES = (
    Defence(
        "a survey hangs the command or fills memory or disk",
        "the reading process with its limits",
        ("pipeline/guard/reading_process.py", "pipeline/guard/answers.py", "pipeline/guard/process_limits.py"),
    ),
    Defence(
        "a survey adds text to the configuration or the terminal",
        "plain texts, never evaluated",
        ("pipeline/guard/plain_file.py", "pipeline/guard/plain_number.py"),
    ),
    Defence("a bundle reaches outside its folder, or fills memory", "what a load checks", ("minexplore/sealed",)),
    Defence("a bundle holds what no builder writes", "the table of bundles", ("pipeline/schema",)),
    Defence(
        "a bundle's model differs from its record",
        "the model that the builder makes again",
        (
            "pipeline/proof/rebuilt/whole_bundle.py",
            "pipeline/proof/rebuilt/same_model.py",
            "pipeline/proof/rebuilt/remake.py",
        ),
    ),
    Defence(
        "rock stands in a drift, or a wall leaks",
        "the certificate",
        ("pipeline/proof/certificate.py", "pipeline/proof/rebuilt/visible.py", "pipeline/proof/stress_test.py"),
    ),
    Defence(
        "a results file states what was not driven",
        "driving again",
        ("baselines/scoring/rerun.py", "baselines/scoring/verified_runs.py"),
    ),
    Defence(
        "a policy's code reaches the machine",
        "the sandbox with its filter",
        ("baselines/sandbox",),
    ),
)


def lines_of(paths: tuple[str, ...]) -> int:
    """Return how many lines these files and folders of modules have."""
    files = [file for path in map(Path, paths) for file in (sorted(path.glob("**/*.py")) if path.is_dir() else [path])]
    return sum(len(file.read_text().splitlines()) for file in files)


def defence_table() -> str:
    """Return the table of `docs/security.md`; few changes of the code move lines in hundreds."""
    rows = ((d.threat, d.decides, f"{round(lines_of(d.code), -2):,}", _named(d.code)) for d in DEFENCES)
    return noted_table(("threat", "the defence that decides", "lines, to a hundred", "code"), rows)


def _named(paths: tuple[str, ...]) -> str:
    """Return files by their names below the folder that holds them all."""
    folder = Path(os.path.commonpath([Path(path).parent if path.endswith(".py") else path for path in paths]))
    names = [Path(path).relative_to(folder).with_suffix("").as_posix() for path in paths if path != folder.as_posix()]
    return f"`{folder}/`" + (f": {', '.join(names)}" if names else "")
