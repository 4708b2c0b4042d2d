"""Read surveys in three dimensions: which reader solves which file.

Docs: docs/adr/0013-survex.md says which way is taken when.
"""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.errors import InputError
from pipeline.guard.reading_process import Payload, one_line, run_limited
from pipeline.params.floor_rules import floor_rules
from pipeline.params.reader_limits import FILE
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.passages.sheets import has_relief
from pipeline.survey.solved.cavern import INSTALL, has_cavern, require_cavern, solve
from pipeline.survey.solved.compass_sections import with_sections
from pipeline.survey.solved.model import SolvedSurvey, from_payload, to_payload
from pipeline.survey.solved.node_links import is_node_list, links_of, read_node_links
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.solved.project_files import project_files, text_lines
from pipeline.survey.solved.survex_3d import read_3d
from pipeline.survey.stations.survex import NoPassagesError, read_svx, read_svx_rise
from pipeline.survey.stations.table import read_station_survey
from pipeline.survey.therion.convert import to_survex
from pipeline.survey.therion.lines import therion_lines

SOLVED_SUFFIXES = (".3d", ".svx", ".th", ".dat", ".mak")
_INCLUDE = re.compile(r"[\s,\0]*\*[\s,\0]*include(?![a-z])", re.IGNORECASE)


def read_solved(path: Path) -> SolvedSurvey:
    """Read or solve a survey, in a process with the limits of `conf/reader_limits.yaml`.

    Parameters
    ----------
    path : Path
        `.3d`, and `NAME_nodes.dat` with `NAME_links.dat`, are read; `.svx` (with the files that it includes), `.dat`
        and `.mak` (Compass) are solved by Survex; the centrelines of `.th` (Therion) are brought to Survex's form and
        solved; `.csv` is our own table with elevations.

    Returns
    -------
    SolvedSurvey
        m, in the survey's own frame.

    Raises
    ------
    InputError
        If the file is missing, cannot be read or solved, or Survex is needed and not installed. The message names the
        file, the line and the value.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    return from_payload(run_limited("solved", {"path": str(path)}, str(path), scratch=True))


def read_here(path: str) -> Payload:
    """Read or solve a survey in this process; `read_solved` has limits."""
    return to_payload(solve_file(Path(path)))


def solve_file(path: Path) -> SolvedSurvey:
    """Read or solve a survey in this process.

    Raises
    ------
    InputError
        If the survey cannot be read, or a station's name holds control characters.
    """
    survey = _solved(path)
    odd = next((name for name in survey.names if not name.isprintable()), None)
    if odd is not None:
        raise InputError(f"{path}: station {odd!r:.60}: want a name of printable characters")
    return survey


def _solved(path: Path) -> SolvedSurvey:
    suffix = path.suffix.lower()
    if suffix == ".3d":
        return read_3d(path)
    if suffix == ".csv":
        return read_station_survey(path)
    if is_node_list(path):
        return read_node_links(path)
    if suffix not in SOLVED_SUFFIXES:
        raise InputError(f"{path}: not a survey that Survex solves ({', '.join(SOLVED_SUFFIXES)})")
    require_cavern(path)
    if suffix == ".th":
        made = to_survex(path)
        return solve(path, "\n".join(made.lines) + "\n", made.origin)
    files = project_files(path)
    survey = solve(path)
    return survey if suffix == ".svx" else with_sections(survey, [file for file in files if _is_data(file)])


def _is_data(path: Path) -> bool:
    return path.suffix.lower() == ".dat"


def survey_files(path: Path) -> list[Path]:
    """Return a survey's files: the file and all files that it names.

    Raises
    ------
    InputError
        If a named file is missing or lies outside the folder of the first.
    """
    suffix = path.suffix.lower()
    if suffix == ".th":
        files: list[Path] = []
        for _ in therion_lines(path, files):
            pass
        return list(dict.fromkeys(files))
    if is_node_list(path):
        return [path, links_of(path)]
    if suffix == ".mak" or (suffix == ".svx" and _has_includes(path)):
        return project_files(path)
    return [path]


def read_passages(path: Path, half_width_m: float | None = None) -> tuple[list[SurveyLeg], str | None]:
    """Read the plan view of a survey in three dimensions: its legs, and its coordinate system.

    `half_width_m` is the distance to a wall that nobody measured; None takes the survey's own (`plan_legs`).

    Raises
    ------
    InputError
        If the survey cannot be read, or its workings pass over each other or are too steep for a flat world.
    """
    survey = solve_file(path)
    return plan_legs(path, survey, half_width_m), None if survey.crs is None else one_line(survey.crs, 200)


def read_survex(path: Path, half_width_m: float | None = None) -> tuple[list[SurveyLeg], str | None]:
    """Read a Survex survey.

    A level survey in one file, with passage data, is read by our own reader, so that its world is the same with and
    without Survex; Survex solves what our reader refuses, and a survey whose stations differ in height by more than
    `flat_step_m`. Survex solves a survey in several files; our reader does where Survex is not installed.

    Raises
    ------
    InputError
        If neither can read it, or the stations differ in height and Survex is not installed. Of a survey in one file
        with passage data the message is our reader's.
    """
    if _has_includes(path):
        if has_cavern():
            return read_passages(path, half_width_m)
        try:
            return read_svx(path)
        except InputError as error:
            if FILE in str(error):
                raise
            raise InputError(f"{error}; for all that Survex reads, {INSTALL}") from error
    try:
        legs, crs, rise_m = read_svx_rise(path)
    except NoPassagesError:
        if not has_cavern():
            raise
        return read_passages(path, half_width_m)
    except InputError as error:
        if FILE in str(error) or not has_cavern():
            raise
        try:
            survey = solve_file(path)
        except InputError:
            raise error from None
        return plan_legs(path, survey, half_width_m), survey.crs
    if rise_m <= floor_rules().flat_step_m:
        return legs, crs
    if not has_cavern():
        raise InputError(f"{path}: its stations differ in height by {rise_m:.1f} m, which needs Survex; {INSTALL}")
    solved, solved_crs = read_passages(path, half_width_m)
    return (solved, solved_crs) if has_relief(solved) else (legs, crs)


def _has_includes(path: Path) -> bool:
    return any(_INCLUDE.match(line) for _, line in text_lines(path))
