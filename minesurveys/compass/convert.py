"""Bring Compass projects and survey data to Survex's form."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from minesurveys.compass.data import CompassShot, CompassSurvey, read_surveys
from minesurveys.compass.project import ProjectFile, ProjectLine, read_project
from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.survex.survex_text import NAME_CHARACTERS, SurvexText, written_name

_FOOT_M = 0.3048
_EXCLUDED, _NO_PASSAGE = "X", {"P", "S"}
_FLAGS = {"L": "duplicate", "P": "surface", "S": "splay"}
# Shots with C stay as they were measured: errors of loops go to other shots.
_FAST = ("*sd position 0.0005 metres", "*sd length 0.0005 metres", "*sd compass clino 0.001 degrees")


@dataclass
class _Users:
    """Which file uses a station's name first, and names that unlinked files share.

    With link stations, Compass takes other equal names of two files for two stations; Survex and we take them for one.
    """

    first: dict[str, Path] = field(default_factory=dict)
    shared: dict[str, None] = field(default_factory=dict)
    has_links: bool = False

    def add(self, file: ProjectFile, shots: list[CompassShot]) -> None:
        """Add a survey of a file."""
        self.has_links = self.has_links or bool(file.links)
        linked = {*file.links, *(fixed.name for fixed in file.fixed)}
        for name in (name for shot in shots for name in (shot.start, shot.end)):
            if self.first.setdefault(name, file.path) != file.path and name not in linked:
                self.shared[name] = None

    def warn(self, path: Path) -> None:
        """Warn of shared names in a project with link stations."""
        if self.has_links and self.shared:
            name = next(iter(self.shared))
            count = f"{len(self.shared)} names of several files are no link stations"
            warn_user(f"{count}, such as {name[:40]}: each is one station", of=path)


def to_survex(path: Path) -> SurvexText:
    """Convert a Compass project, or one file of survey data, to Survex data.

    Survex reads these files, too, but which of their rules it follows differs by its version: 1.4.4 takes a tape
    correction of feet for metres (findings/survex-compass-tape-correction-in-metres.sh) and leaves out folders, base
    locations, and backsights that have formats of their own. Cross-sections and flags of shots, which Survex leaves
    out, are kept: L is duplicate, P surface, S a splay; shots with X are left out, and those with C move least in
    loops. Shots in a row, each from the station where the one before it ends, make a passage.

    Parameters
    ----------
    path : Path
        A `.mak`, `.dat` or `.clp` file.

    Raises
    ------
    InputError
        If a line cannot be read, there are no shots, or they exceed `survex_shots`. The message names the file and the
        line.

    References
    ----------
    Compass, "Survey data file format" and "Project file format". Survex 1.4.22 reads them in the same way.
    """
    line = ProjectLine(path, 1)
    files = read_project(path) if path.suffix.lower() == ".mak" else [ProjectFile(line, path)]
    made, begin = SurvexText([path, *(file.path for file in files)]), ""
    if not any(file.fixed for file in files):
        files, begin = _without_places(path, files)
    for text in ("*case preserve", f"*set names {NAME_CHARACTERS}", "*infer plumbs on", "*infer equates on"):
        made.add(line, text)
    system = base = ""
    count = 0
    users = _Users()
    for file in files:
        system, base = _add_place(made, file, system, base)
        if begin:
            made.add(file.line, begin)
            begin = ""
        for survey, shots in read_surveys(file.path):
            count += len(shots)
            if count > reader_limits().survex_shots:
                raise InputError(
                    f"{file.path}: more than {reader_limits().survex_shots} shots (survex_shots in {FILE})"
                )
            users.add(file, shots)
            _add_survey(made, survey, [shot for shot in shots if _EXCLUDED not in shot.flags], bool(base))
    if not count:
        raise InputError(f"{path}: holds no shots of Compass; of a network of nodes and links, give NAME_nodes.dat")
    users.warn(path)
    return made


def _without_places(path: Path, files: list[ProjectFile]) -> tuple[list[ProjectFile], str]:
    """Return the files of a project that fixes no station, and the command that fixes its first station, or nothing.

    With a base location, where declinations are computed, the first station is put there. Else coordinates are counted
    from it, and a zone says nothing of them.
    """
    based = next((file for file in files if file.base_system), None)
    if based is None:
        if any(file.system for file in files):
            warn_user("no station is fixed; its UTM zone is not used; the first station is at 0, 0, 0", of=path.name)
        return [replace(file, system="") for file in files], ""
    first = next((shots[0].start for file in files for _, shots in read_surveys(file.path) if shots), "")
    warn_user(f"no station is fixed; the first one, {first[:40]}, is put at the project's base location", of=path.name)
    everywhere = [
        replace(file, system=based.base_system, base_system=based.base_system, base_m=based.base_m) for file in files
    ]
    return everywhere, "*fix {} {:.4f} {:.4f} {:.4f}".format(written_name(first), *based.base_m) if first else ""


def _add_place(made: SurvexText, file: ProjectFile, system: str, base: str) -> tuple[str, str]:
    """Add a file's coordinate system, where declinations are computed, and its fixed stations."""
    line = file.line
    if file.base_system:
        stated = "{} {:.3f} {:.3f} {:.3f}".format(file.base_system, *file.base_m)
        if stated != base:
            made.add(line, f"*cs {file.base_system}")
            made.add(line, f"*cs out {system or file.system}")
            made.add(line, f"*declination auto {stated.partition(' ')[2]}")
            system, base = file.base_system, stated
    if file.system and file.system != system:
        made.add(line, f"*cs {file.system}")
        if not system:
            made.add(line, f"*cs out {file.system}")
        system = file.system
    for fixed in file.fixed:
        made.add(line, "*fix {} {:.4f} {:.4f} {:.4f}".format(written_name(fixed.name), *fixed.place_m))
        made.add(line, f"*entrance {written_name(fixed.name)}")
    return system, base


def _add_survey(made: SurvexText, survey: CompassSurvey, shots: list[CompassShot], has_base: bool) -> None:
    made.add(survey, "*begin")
    if survey.date:
        made.add(survey, f"*date {survey.date}")
    if not has_base:
        made.add(survey, f"*declination {survey.declination_deg:.6f} degrees")
    for quantity, correction in (
        ("compass", survey.bearing_deg),
        ("clino", survey.inclination_deg),
        ("backcompass", survey.back_bearing_deg),
        ("backclino", survey.back_inclination_deg),
    ):
        made.add(survey, f"*calibrate {quantity} {-correction:.6f}")
    back = " backcompass backclino" if survey.has_backsights else ""
    made.add(survey, f"*data normal from to tape compass clino{back}")
    flags = ""
    for shot in shots:
        if shot.start == shot.end:
            continue  # it states a cross-section
        letters = "".join(letter for letter in _FLAGS if letter in shot.flags)
        if letters != flags:
            made.add_flags(shot, [_FLAGS[letter] for letter in letters])
            flags = letters
        readings = _shot_words(shot, survey)
        for text in ("*begin", *_FAST, readings, "*end") if "C" in shot.flags else (readings,):
            made.add(shot, text)
    _add_passages(made, survey, shots)
    made.add(survey, "*end")


def _shot_words(shot: CompassShot, survey: CompassSurvey) -> str:
    length_m = (shot.length_ft + survey.length_ft) * _FOOT_M if shot.length_ft else 0.0
    readings = [shot.bearing_deg, shot.inclination_deg]
    if survey.has_backsights:
        readings += [shot.back_bearing_deg, shot.back_inclination_deg]
    words = ["-" if math.isnan(value) else f"{value:.4f}" for value in readings]
    return " ".join([written_name(shot.start), written_name(shot.end), f"{length_m:.6f}", *words])


def _add_passages(made: SurvexText, survey: CompassSurvey, shots: list[CompassShot]) -> None:
    """Add cross-sections: at each shot's first station, or its second. A shot to its own station states that one's."""
    chain: list[tuple[CompassShot, str, tuple[float, ...]]] = []
    unknown = (math.nan,) * 4
    for shot in shots:
        if _NO_PASSAGE & set(shot.flags):
            continue
        if not chain or chain[-1][1] != shot.start:
            _add_passage(made, chain)
            chain = [(shot, shot.start, unknown)]
        if shot.start == shot.end or not survey.is_wall_at_end:
            chain[-1] = (shot, shot.start, shot.lrud_m)
        if shot.start != shot.end:
            chain.append((shot, shot.end, shot.lrud_m if survey.is_wall_at_end else unknown))
    _add_passage(made, chain)


def _add_passage(made: SurvexText, chain: list[tuple[CompassShot, str, tuple[float, ...]]]) -> None:
    if len(chain) < 2 or all(math.isnan(wall) for _, _, walls in chain for wall in walls):
        return
    made.add_passage([(shot, written_name(name), walls) for shot, name, walls in chain])
