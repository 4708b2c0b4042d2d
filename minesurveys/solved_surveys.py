"""Read surveys in three dimensions: which reader solves which file.

Docs: docs/adr/0013-survex.md says which way is taken when.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

from minesurveys.coordinates.map_axes import coordinate_system, other_units
from minesurveys.errors import InputError, one_line
from minesurveys.formats import FORMATS, format_of
from minesurveys.solved.model import SolvedSurvey, StationFlag
from minesurveys.solved.node_links import is_node_list, links_of, read_node_links
from minesurveys.survex.cavern import require_cavern, require_version, solve
from minesurveys.survex.survex_text import Written
from minesurveys.walls.project import WallsCopy
from minesurveys.walls.sections import with_sections

_VERSION_FOR_WALLS = (1, 4, 9)


def solve_file(path: Path, declination_deg: float | None = None) -> SolvedSurvey:
    """Read or solve a survey in this process, which the caller limits.

    Parameters
    ----------
    path : Path
        `.3d`, `.lox`, `.plt`, and `NAME_nodes.dat` with `NAME_links.dat`, are read; `.svx` (with the files that it
        includes) is solved by Survex; `.th` and `thconfig` (Therion) and `.mak`, `.dat` and `.clp` (Compass) are
        brought to Survex's form and solved; a copy of `.wpj` and `.srv` (Walls) is solved by Survex 1.4.9 or newer;
        `.csv` is our own table with elevations.
    declination_deg : float, optional
        In place of every declination that Survex computes.

    Returns
    -------
    SolvedSurvey
        m, in the survey's own frame.

    Raises
    ------
    InputError
        If the file cannot be read or solved, its coordinate system does not count in metres, a station's name holds
        control characters, or Survex is needed and not installed. The message names the file, the line and the value.
    """
    found = format_of(path)
    if is_node_list(path):
        survey = read_node_links(path)
    elif found.legs:
        survey = resolve_name(found.legs)(path)
    elif found.survex:
        require_cavern(path)
        written: Written = resolve_name(found.survex)(path)
        if isinstance(written, WallsCopy):
            require_version(path, _VERSION_FOR_WALLS, "a Walls survey")
        survey = replace(solve(path, written, declination_deg), files=tuple(dict.fromkeys(written.files)))
        if isinstance(written, WallsCopy):
            survey = with_sections(survey, list(zip(written.surveys, written.options, strict=True)))
    else:
        known = ", ".join(suffix for suffix, form in FORMATS.items() if form.legs or form.survex)
        raise InputError(f"{path}: not a survey of stations ({known})")
    _require_metres(path, survey.crs)
    odd = next((name for name in survey.names if not name.isprintable()), None)
    if odd is not None:
        raise InputError(f"{path}: station {odd!r:.60}: want a name of printable characters")
    return survey if survey.files else replace(survey, files=(path,))


def _require_metres(path: Path, crs: str | None) -> None:
    """Refuse a coordinate system in another unit than metres: Survex takes the places of fixed stations for metres."""
    try:
        units = other_units(coordinate_system(path, crs)) if crs else ""
    except InputError:  # a system that is not known states no unit
        return
    if units:
        raise InputError(
            f"{path}: its coordinate system {one_line(str(crs), 40)!r} counts in {units}, not in metres, which Survex "
            "takes for metres; state one of metres (`*cs out`, UTM) and solve it again"
        )


def survey_files(path: Path) -> list[Path]:
    """Return a survey's files without reading it whole: the file and all files that it names.

    Raises
    ------
    InputError
        If a named file is missing or lies outside the folder of the first.
    """
    if is_node_list(path):
        return [path, links_of(path)]
    survex = format_of(path).survex
    return list(dict.fromkeys(resolve_name(survex)(path).files)) if survex else [path]


def entrances_of(survey: SolvedSurvey) -> list[str]:
    """Return the names of the stations that are open to the surface."""
    is_open = (survey.station_flags & StationFlag.ENTRANCE) != 0
    return sorted({survey.names[k] for k in np.flatnonzero(is_open)} - {""})


def names_of(survey: SolvedSurvey) -> dict[str, str]:
    """Return the station of the legs that each name stands for."""
    _, node, names = survey.nodes()
    return {name: names[number] for name, number in zip(survey.names, node.tolist(), strict=True) if name}
