"""Cave surveys as their own programs solve them and as they are read here.

`python -m benchmarks survey-programs FOLDER`: each `.th` file of a folder is solved by `therion`, each `.svx`, `.mak`,
`.dat` and `.clp` by `cavern`, and both are compared with what is read here; a `.3d` is compared with what `dump3d`
prints of it (Debian: therion, survex). Where `NAME.dump` or `NAME.pos` lies beside Compass data, as in Survex's own
tests, this solution is taken: older versions of Survex misread corrections in feet. The sources of both programs hold
samples. The programs are those on the path, or that of `--therion`.
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
from tqdm import tqdm

from baselines.base.markdown import markdown_table
from minesurveys.solved.model import SolvedSurvey
from minesurveys.solved.survex_3d import read_3d
from minesurveys.solved_surveys import solve_file
from pipeline.errors import MineError
from pipeline.store.files import write_atomically

TABLE = Path("artifacts/bench/survey-programs.md")
_TIME_S = 20
_SAME_M = 0.02  # both files round to a centimetre
_NUMBER = re.compile(r" \(\d+\)$")
_CONFIG, _OUT = "compare.thconfig", "compare.3d"
_COMPASS = (".mak", ".dat", ".clp")
_BY_CAVERN = (".svx", *_COMPASS)
_NODE = re.compile(r"NODE (\S+) (\S+) (\S+) \[(.*)\]")  # of dump3d
_SEPARATOR = re.compile(r"^SEPARATOR '(.)'$", re.MULTILINE)
_POSITION = re.compile(r"\(\s*([-.\d]+),\s*([-.\d]+),\s*([-.\d]+)\s*\)\s+(\S+)")  # of a .pos file


@dataclass(frozen=True)
class ProjectVerdict:
    """What became of one file: equal, different, refused, refused by both, or read by us only; and why."""

    verdict: str
    why: str


def compare_file(path: Path, therion: str) -> ProjectVerdict:
    """Return how a survey as read here compares with its program's solution."""
    theirs = _kept_solution(path) if path.suffix.lower() in _COMPASS else None
    if theirs is None:
        theirs = solve_by_therion(path, therion) if path.suffix.lower() == ".th" else solve_by_survex(path)
    try:
        ours = solve_file(path)
    except MineError as error:
        return ProjectVerdict("refused" if theirs else "refused by both", str(error).removeprefix(f"{path}: ")[:160])
    return ProjectVerdict("only read here", f"{len(ours.names)} stations") if theirs is None else compare(theirs, ours)


def _kept_solution(path: Path) -> SolvedSurvey | None:
    """Return the solution that lies beside a file, if there is one."""
    for suffix, read in ((".dump", read_dump), (".pos", read_positions)):
        if path.with_suffix(suffix).is_file():
            return read(path.with_suffix(suffix).read_text("utf-8", "replace"))
    return None


def compare(theirs: SolvedSurvey, ours: SolvedSurvey) -> ProjectVerdict:
    """Return whether all stations of one survey are in another at the same places, but for one shift of them all.

    Therion and Survex put a survey without a fixed station at different places. Stations of one name at several places
    are compared with the nearest.
    """
    at, other = _places(theirs), _places(ours)
    if not at:
        return ProjectVerdict("different" if other else "equal", f"no stations of a name, {len(other)} here")
    missing = [name for name in at if name not in other]
    if missing:
        return ProjectVerdict("different", f"{len(missing)} of {len(at)} stations are missing, {missing[0]} first")
    shift = np.median([np.mean(other[name], axis=0) - np.mean(at[name], axis=0) for name in at], axis=0)
    apart_m = max(float(np.linalg.norm(place + shift - other[name], axis=1).min()) for name in at for place in at[name])
    why = f"{len(at)} stations, {len(theirs.legs)} legs, largest distance {apart_m:.3f} m"
    if len(theirs.legs) not in (0, len(ours.legs)):  # a table of positions has no legs
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


def solve_by_survex(path: Path) -> SolvedSurvey | None:
    """Return the survey that Survex prints of a file, solved by `cavern` unless it is a `.3d`; none if it refuses it.

    Raises
    ------
    FileNotFoundError
        If a program is missing.
    """
    with tempfile.TemporaryDirectory() as scratch:
        solved = path
        if path.suffix.lower() in _BY_CAVERN:
            solved = Path(scratch) / _OUT
            command = ["cavern", "--quiet", f"--output={solved}", str(path.resolve())]
            try:
                done = subprocess.run(command, cwd=scratch, capture_output=True, timeout=_TIME_S)
            except subprocess.TimeoutExpired:  # older versions read some broken projects without end
                return None
            if done.returncode != 0 or not solved.is_file():
                return None
        printed = subprocess.run(["dump3d", str(solved)], capture_output=True, timeout=_TIME_S)
        return read_dump(printed.stdout.decode("utf-8", "replace")) if printed.returncode == 0 else None


def read_dump(text: str) -> SolvedSurvey:
    """Return the stations and the number of legs in the text that `dump3d` prints."""
    nodes = [found.groups() for found in map(_NODE.match, text.splitlines()) if found]
    legs = sum(line.startswith(("LINE ", "LEG ")) for line in text.splitlines())
    separator = next(iter(_SEPARATOR.findall(text)), ".")
    return _survey([(name.replace(separator, "."), place) for *place, name in nodes], legs)


def read_positions(text: str) -> SolvedSurvey:
    """Return the stations of a `.pos` file of Survex, whose legs are not stated."""
    rows = [found.groups() for found in map(_POSITION.match, text.splitlines()) if found]
    return _survey([(name, place) for *place, name in rows], 0)


def _survey(stations: list[tuple[str, list[str]]], legs: int) -> SolvedSurvey:
    return SolvedSurvey(
        names=tuple(name for name, _ in stations),
        positions_m=np.array([place for _, place in stations], float).reshape(-1, 3),
        station_flags=np.zeros(len(stations), np.uint8),
        legs=np.zeros((legs, 2), int),
        leg_flags=np.zeros(legs, np.uint8),
        leg_styles=np.zeros(legs, np.uint8),
        passages=(),
        title="",
        crs=None,
        date="",
    )


def table(verdicts: dict[str, ProjectVerdict]) -> str:
    """Return the verdicts as Markdown: their counts, then a row a file."""
    counts = Counter(found.verdict for found in verdicts.values())
    read = sum(counts[verdict] for verdict in ("equal", "different", "refused"))
    share = f"Of {read} files that their own program reads, {counts['equal']} are read equally.\n"
    rows = [(name, found.verdict, found.why.replace("|", "/")) for name, found in verdicts.items()]
    summary = markdown_table(("verdict", "files"), counts.items())
    return f"{share}\n{summary}\n{markdown_table(('file', 'verdict', 'why'), rows)}"


def main(words: list[str]) -> int:
    """Compare a folder's files and print the table; exit code 2 if the program or the folder is missing."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks survey-programs", description=__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--therion", default="therion", help="the program")
    parser.add_argument("--out", type=Path, default=TABLE, help="the table, Markdown")
    typed = parser.parse_args(words)
    files = sorted(path for path in typed.folder.rglob("*") if path.suffix.lower() in (".th", ".3d", *_BY_CAVERN))
    try:
        verdicts = {
            str(file.relative_to(typed.folder)): compare_file(file, typed.therion)
            for file in tqdm(files, unit="file", disable=None)
        }
    except FileNotFoundError as error:
        print(f"survey-programs: {error.filename}: no such program (Debian: survex, therion)", file=sys.stderr)
        return 2
    if not files:
        print(f"survey-programs: {typed.folder}: no .th, .3d, {', '.join(_BY_CAVERN)} file", file=sys.stderr)
        return 2
    text = table(verdicts)
    print(text)
    write_atomically(typed.out, text.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
