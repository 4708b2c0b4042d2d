"""Bring Therion's centrelines (.th) to Survex's form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.survex.survex_text import NAME_CHARACTERS, SurvexText, written_survey
from minesurveys.therion.dates import CENTRELINES, Dates, Declination, dates_of, declination_of
from minesurveys.therion.fixes import Fixes
from minesurveys.therion.imported import Imports, add_imported, declared_surveys
from minesurveys.therion.lines import TherionLine
from minesurveys.therion.place import Place, System, cs_for_survex, place_of
from minesurveys.therion.project import project_lines
from minesurveys.therion.quantities import Grades, Quantities, deviations, grades_of
from minesurveys.therion.shots import ReadingOrder, Shots
from minesurveys.therion.words import SKIPPED_BLOCKS, changed_flags, require_name, station_for_survex

_IGNORED_IN_CENTRELINE = {
    "team", "date", "explo-date", "explo-team", "instrument", "instruments", "copyright", "title", "mark", "walls",
    "vthreshold", "extend", "break", "require", "approx", "declination-date",
    "attr", "author", "id",
}  # fmt: skip
_LINES_A_SHOT = 12  # of the text for Survex at most
_IGNORED = {
    "encoding", "join", "select", "unselect", "title", "date", "person-rename", "copyright", "author", "maps",
    "preview", "sketch",
}  # fmt: skip
_OPTIONS = {  # of a survey: how many words follow each
    "-title": 1, "-author": 2, "-copyright": 2, "-entrance": 1, "-person-rename": 2, "-id": 1, "-attr": 2, "-cs": 1,
    "-namespace": 1, "-declination": 1,
}  # fmt: skip


def to_survex(path: Path) -> SurvexText:
    """Convert a Therion project's centrelines to Survex data.

    Surveys become `*begin` blocks. Consecutive shots between the same two stations are repeated readings of one shot
    and are averaged. Splays keep their flag. With a coordinate system, bearings are turned to grid north, as Therion
    does: by the declination that is stated, or by that of the earth's magnetic field in the middle of the fixed
    stations at the date (Survex computes it; a centreline without a date takes the project's first), and by the
    convergence of the meridians. Vectors of `data cartesian` are turned like bearings. Stations and legs of an imported
    `.3d` keep their places. Drawings, maps, teams and extensions are left out.

    Parameters
    ----------
    path : Path
        The main `.th` file, or the `thconfig` of the project.

    Raises
    ------
    InputError
        If a line cannot be converted. The message names the file, the line and the word.

    References
    ----------
    The Therion Book, "Data format": survey, centreline, data, units, calibrate, declination, flags, fix, equate.
    Therion 6.1.6 is the witness of what the book leaves open.
    """
    made = SurvexText()
    lines = list(project_lines(path, made.files))
    dates = dates_of(lines)
    place = place_of(lines, dates)
    imports = Imports(made, path.parent.resolve(), place is not None, declared_surveys(lines))
    converter = _Converter(made, place, imports, dates, grades_of(lines))
    for line in lines:
        converter.read(line)
    converter.end(path)
    return made


@dataclass
class _Survey:
    """An open survey: its name, whether that is part of its stations' names, and the declination of its data."""

    name: str
    is_named: bool = True
    declination: Declination | None = None


class _Converter:
    """Where the reading stands: open surveys, the open centreline, and a block that is left out."""

    def __init__(self, made: SurvexText, place: Place | None, imports: Imports, dates: Dates, grades: Grades) -> None:
        self.made, self.place, self.imports, self.dates, self.grades = made, place, imports, dates, grades
        self.fixes = Fixes(made)
        self.system: System | None = None  # of the coordinates in the open centreline
        self.surveys: list[_Survey] = []
        self.shots: Shots | None = None
        self.skipped = ""
        self.date = ""  # of the open centreline
        self.groups: list[tuple[ReadingOrder, Quantities]] = []
        start = TherionLine(Path(), 1, ())
        self.made.add(start, "*case preserve")
        self.made.add(start, f"*set names {NAME_CHARACTERS}")
        self.commands: dict[str, Callable[[Shots, TherionLine], None]] = {
            "data": Shots.order,
            "units": lambda shots, line: self._add(line, shots.quantities.state_units(line.where, line.words[1:])),
            "calibrate": lambda shots, line: self._add(line, shots.quantities.calibrate(line.where, line.words[1:])),
            "sd": lambda _, line: self._add(line, deviations(line.where, line.words[1:])),
            "declination": self._declination, "fix": self._fix, "equate": self._equate,
            "cs": self._cs, "infer": self._infer, "group": self._group, "endgroup": self._endgroup,
            "grid-angle": self._grid_angle, "grade": self._grade, "station-names": self._station_names,
        }  # fmt: skip
        if place is not None:
            for text in (f"*cs {place.cs}", f"*cs out {place.cs_out}", self._computed_declination()):
                made.add(place.line, text)

    def read(self, line: TherionLine) -> None:
        most = _LINES_A_SHOT * reader_limits().survex_shots
        if len(self.made.lines) > most:
            raise InputError(f"{line.where}: more lines than {most} (survex_shots in {FILE})")
        word = line.words[0]
        if self.skipped:
            self.skipped = "" if word == self.skipped else self.skipped
        elif self.shots is not None:
            self._read_centreline(self.shots, line)
        elif word == "survey":
            self._survey(line)
        elif word == "endsurvey":
            self._endsurvey(line)
        elif word in CENTRELINES:
            self._begin_centreline(line)
        elif word in SKIPPED_BLOCKS:
            self.skipped = f"end{word}"
        elif word == "equate":
            self._equate(Shots(self.made, False), line)
        elif word == "import":
            add_imported(self.imports, line, self._prefix())
        elif word not in _IGNORED:
            raise InputError(f"{line.where}: {word[:40]!r} is not supported here")

    def end(self, path: Path) -> None:
        if self.shots is not None or self.surveys or self.skipped:
            what = "centreline" if self.shots else self.surveys[-1].name if self.surveys else self.skipped
            raise InputError(f"{path}: {what} is not closed")
        self.fixes.combine()

    def _prefix(self) -> str:
        return "".join(f"{written_survey(survey.name)}." for survey in self.surveys if survey.is_named)

    def _begin_centreline(self, line: TherionLine) -> None:
        self.made.add(line, "*begin")
        self.system, self.groups = None, []
        self.date = self.dates.get((line.path, line.number), "")
        date = self.date or ("" if self.place is None else self.place.date)
        if date:
            self.made.add(line, f"*date {date}")
        stated = next((survey.declination for survey in reversed(self.surveys) if survey.declination), None)
        self.shots = Shots(self.made, self.place is not None or stated is not None)
        if stated is not None:
            self._state_declination(line, stated)

    def _read_centreline(self, shots: Shots, line: TherionLine) -> None:
        word = line.words[0]
        if word in ("endcentreline", "endcenterline"):
            shots.flush()
            self.made.add(line, "*end")
            self.shots = None
        elif word == "station":  # it may stand among the shots of a passage, which goes on
            self._station(shots, line)
        elif word == "flags":  # two readings of one shot may have different ones
            shots.how = replace(shots.how, flags=changed_flags(line.where, shots.how.flags, line.words[1:]))
        elif word in self.commands:
            shots.flush()
            self.commands[word](shots, line)
        elif word not in _IGNORED_IN_CENTRELINE:
            shots.read(line)

    def _survey(self, line: TherionLine) -> None:
        if len(line.words) < 2:
            raise InputError(f"{line.where}: a survey without a name")
        if len(self.surveys) >= reader_limits().survex_depth:
            most = reader_limits().survex_depth
            raise InputError(f"{line.where}: surveys are nested more than {most} deep (survex_depth in {FILE})")
        survey, entrance = _Survey(require_name(line.where, line.words[1])), ""
        options = list(line.words[2:])
        while options:
            option = options.pop(0)
            if option not in _OPTIONS or len(options) < _OPTIONS[option]:
                raise InputError(f"{line.where}: survey option {option[:40]!r} is not supported")
            value, options = options[0], options[_OPTIONS[option] :]
            if option == "-namespace":
                survey.is_named = value != "off"
            elif option == "-declination":
                survey.declination = declination_of(line.where, [value])
            elif option == "-entrance":
                entrance = value
        self.surveys.append(survey)
        self.made.add(line, f"*begin {written_survey(survey.name)}" if survey.is_named else "*begin")
        if entrance:
            self.made.add(line, f"*entrance {station_for_survex(line.where, entrance)}")

    def _endsurvey(self, line: TherionLine) -> None:
        if not self.surveys or (len(line.words) > 1 and line.words[1] != self.surveys[-1].name):
            raise InputError(f"{line.where}: {' '.join(line.words)[:60]!r} closes no survey")
        survey = self.surveys.pop()
        self.made.add(line, f"*end {written_survey(survey.name)}" if survey.is_named else "*end")

    def _grade(self, _: Shots, line: TherionLine) -> None:
        for name in " ".join(word.strip("[]") for word in line.words[1:]).split():
            if name not in self.grades:
                warn_user(f"grade {name[:40]} is not defined; readings have the usual deviations", of=line.path.name)
            self._add(line, self.grades.get(name, []))

    def _add(self, line: TherionLine, texts: list[str]) -> None:
        for text in texts:
            self.made.add(line, text)

    def _declination(self, shots: Shots, line: TherionLine) -> None:
        words = [word.strip("[]") for word in line.words[1:]]
        if words == ["-"]:
            self.made.add(line, self._computed_declination())
            return
        shots.is_turned = True
        self._state_declination(line, declination_of(line.where, words))

    def _state_declination(self, line: TherionLine, stated: Declination) -> None:
        degrees = stated.on(self.date)
        if not self.date and stated.needs_date:
            warn_user(
                f"a centreline without a date takes {degrees:.2f} deg, the mean of its declinations", of=line.path.name
            )
        convergence_deg = 0.0 if self.place is None else self.place.convergence_deg
        self.made.add(line, f"*declination {degrees - convergence_deg:.6f} degrees")

    def _computed_declination(self) -> str:
        if self.place is None:
            return "*declination 0 degrees"
        return "*declination auto {:.8f} {:.8f} {:.3f}".format(*self.place.middle)

    def _fix(self, shots: Shots, line: TherionLine) -> None:
        if len(line.words) < 5:
            raise InputError(f"{line.where}: expected fix station east north up")
        station = shots.station(line.where, line.words[1])
        self.fixes.add(line, station, self._prefix(), self.system, shots.quantities.axes)

    def _station(self, shots: Shots, line: TherionLine) -> None:
        """Keep of a station's flags, which follow its name and a comment, that it is an entrance."""
        flags = [word.lower() for word in line.words[3:]]
        if "entrance" in flags and flags[: flags.index("entrance")][-1:] != ["not"]:
            self.made.add(line, f"*entrance {shots.station(line.where, line.words[1])}")

    def _station_names(self, shots: Shots, line: TherionLine) -> None:
        if len(line.words) != 3:
            raise InputError(f"{line.where}: expected station-names before after")
        before, after = (word.strip("[]") for word in line.words[1:])
        shots.how = replace(shots.how, around=(before, after))

    def _equate(self, shots: Shots, line: TherionLine) -> None:
        names = [shots.station(line.where, word) for word in line.words[1:]]
        if len(names) < 2:
            raise InputError(f"{line.where}: equate needs two stations")
        self.made.add(line, f"*equate {' '.join(names)}")

    def _cs(self, _: Shots, line: TherionLine) -> None:
        self.system = cs_for_survex(line.where, line.words[1:])
        if self.place is None:
            raise InputError(f"{line.where}: cs {self.system.name}, but no station is fixed in it")
        self.made.add(line, f"*cs {self.system.name}")

    def _grid_angle(self, shots: Shots, line: TherionLine) -> None:
        words = [word.strip("[]") for word in line.words[1:]]
        shots.is_turned = True
        degrees = declination_of(line.where, words).on(self.date)  # it counts from grid north already
        self.made.add(line, f"*declination {degrees:.6f} degrees")

    def _infer(self, _: Shots, line: TherionLine) -> None:
        words = [word.lower() for word in line.words[1:]]
        if len(words) != 2 or words[0] not in ("plumbs", "equates") or words[1] not in ("on", "off"):
            raise InputError(f"{line.where}: {' '.join(line.words)[:60]!r} is not supported")
        self.made.add(line, f"*infer {' '.join(words)}")

    def _group(self, shots: Shots, line: TherionLine) -> None:
        self.groups.append(shots.begin_group())
        if len(self.groups) > reader_limits().survex_depth:
            raise InputError(f"{line.where}: groups are nested too deep (survex_depth in {FILE})")
        self.made.add(line, "*begin")

    def _endgroup(self, shots: Shots, line: TherionLine) -> None:
        if not self.groups:
            raise InputError(f"{line.where}: endgroup closes no group")
        shots.end_group(self.groups.pop())
        self.made.add(line, "*end")
