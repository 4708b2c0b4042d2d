"""Therion projects as Therion solves them and as they are read here: `python -m benchmarks therion-projects FOLDER`.

Each `.th` file of a folder is solved by the program `therion` (Debian: therion) and read. Therion's own samples are in
its source. The program is the one on the path, or that of `--therion`.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.base.markdown import markdown_table
from pipeline.errors import MineError
from pipeline.store.files import write_atomically
from pipeline.survey.solved.model import SolvedSurvey
from pipeline.survey.solved.survex_3d import read_3d
from pipeline.survey.solved_surveys import solve_file

TABLE = Path("artifacts/bench/therion-projects.md")
_TIME_S = 60
_SAME_M = 0.02  # both files round to a centimetre
_NUMBER = re.compile(r" \(\d+\)$")
_CONFIG, _OUT = "compare.thconfig", "compare.3d"


@dataclass(frozen=True)
class ProjectVerdict:
    """What became of one file: equal, different, refused, refused by both, or read by us only; and why."""

    verdict: str
    why: str


def compare_file(path: Path, program: str) -> ProjectVerdict:
    """Return how a project as read here compares with Therion's solution of it."""
    theirs = solve_by_therion(path, program)
    try:
        ours = solve_file(path)
    except MineError as error:
        return ProjectVerdict("refused" if theirs else "refused by both", str(error).removeprefix(f"{path}: ")[:160])
    return ProjectVerdict("only read here", f"{len(ours.names)} stations") if theirs is None else compare(theirs, ours)


def compare(theirs: SolvedSurvey, ours: SolvedSurvey) -> ProjectVerdict:
    """Return whether all stations of one survey are in another at the same places, but for one shift of them all.

    Therion and Survex put a survey without a fixed station at different places. Stations of one name at several places
    are compared with the nearest.
    """
    at, other = _places(theirs), _places(ours)
    missing = [name for name in at if name not in other]
    if missing:
        return ProjectVerdict("different", f"{len(missing)} of {len(at)} stations are missing, {missing[0]} first")
    shift = np.median([np.mean(other[name], axis=0) - np.mean(at[name], axis=0) for name in at], axis=0)
    apart_m = max(float(np.linalg.norm(place + shift - other[name], axis=1).min()) for name in at for place in at[name])
    why = f"{len(at)} stations, {len(theirs.legs)} legs, largest distance {apart_m:.3f} m"
    if len(theirs.legs) != len(ours.legs):
        return ProjectVerdict("different", f"{why}; {len(ours.legs)} legs here")
    return ProjectVerdict("equal" if apart_m <= _SAME_M else "different", why)


def _places(survey: SolvedSurvey) -> dict[str, list[np.ndarray]]:
    """Return the places of the stations of each name, without numbers of stations that share it; ~ is a point."""
    places: dict[str, list[np.ndarray]] = {}
    for name, at in zip(survey.names, survey.positions_m, strict=True):
        if name:
            places.setdefault(_NUMBER.sub("", name).replace("~", "."), []).append(at)
    return places


def solve_by_therion(path: Path, program: str) -> SolvedSurvey | None:
    """Return Therion's solution of a project, or none if Therion refuses it.

    Raises
    ------
    FileNotFoundError
        If the program is missing.
    """
    with tempfile.TemporaryDirectory() as scratch:
        config, out = Path(scratch) / _CONFIG, Path(scratch) / _OUT
        config.write_text(f"source {path.resolve()}\nexport model -fmt survex -o {out}\n")
        done = subprocess.run([program, str(config)], cwd=scratch, capture_output=True, timeout=_TIME_S)
        return read_3d(out) if done.returncode == 0 and out.is_file() else None


def table(verdicts: dict[str, ProjectVerdict]) -> str:
    """Return the verdicts as Markdown: their counts, then a row a file."""
    counts = Counter(found.verdict for found in verdicts.values())
    rows = [(name, found.verdict, found.why.replace("|", "/")) for name, found in verdicts.items()]
    return f"{markdown_table(('verdict', 'files'), counts.items())}\n{markdown_table(('file', 'verdict', 'why'), rows)}"


def main(words: list[str]) -> int:
    """Compare a folder's files and print the table; exit code 2 if the program or the folder is missing."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks therion-projects", description=__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--therion", default="therion", help="the program")
    parser.add_argument("--out", type=Path, default=TABLE, help="the table, Markdown")
    typed = parser.parse_args(words)
    files = sorted(typed.folder.rglob("*.th"))
    try:
        verdicts = {str(file.relative_to(typed.folder)): compare_file(file, typed.therion) for file in files}
    except FileNotFoundError as error:
        print(f"therion-projects: {error.filename}: no such program; --therion names it", file=sys.stderr)
        return 2
    if not files:
        print(f"therion-projects: {typed.folder}: no .th file", file=sys.stderr)
        return 2
    text = table(verdicts)
    print(text)
    write_atomically(typed.out, text.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
