"""Bring Therion's centrelines (.th) to Survex's form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.errors import InputError
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.survey.solved.survex_text import NAME_CHARACTERS, SurvexText, written_survey
from pipeline.survey.therion.imported import Imports, add_imported, declared_surveys
from pipeline.survey.therion.lines import TherionLine
from pipeline.survey.therion.place import Place, cs_for_survex, date_for_survex, place_of
from pipeline.survey.therion.project import project_lines
from pipeline.survey.therion.shots import Shots
from pipeline.survey.therion.words import (
    SKIPPED_BLOCKS,
    declination_for_survex,
    flags_for_survex,
    number_for_survex,
    numbers_for_survex,
    require_name,
    station_for_survex,
    units_for_survex,
)

_IGNORED_IN_CENTRELINE = {
    "team", "explo-date", "explo-team", "instrument", "instruments", "copyright", "title", "mark", "walls",
    "vthreshold", "extend", "break", "grade", "require", "approx", "declination-date",
    "attr", "author", "id",
}  # fmt: skip
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
    convergence of the meridians. Stations and legs of an imported `.3d` keep their places. Drawings, maps, teams and
    extensions are left out.

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
    """
    made = SurvexText()
    lines = list(project_lines(path, []))
    place = place_of(lines)
    imports = Imports(made, path.parent.resolve(), place is not None, declared_surveys(lines))
    converter = _Converter(made, place, imports)
    for line in lines:
        converter.read(line)
    converter.end(path)
    return made


class _Converter:
    """Where the reading stands: open surveys, the open centreline, and a block that is left out."""

    def __init__(self, made: SurvexText, place: Place | None, imports: Imports) -> None:
        self.made, self.place, self.imports = made, place, imports
        self.is_latitude_first = False  # of the coordinates in the open centreline
        self.surveys: list[tuple[str, bool]] = []  # name, and whether it is part of its stations' names
        self.shots: Shots | None = None
        self.skipped = ""
        self.corrections: list[dict[str, str]] = [{}]  # by quantity, of the centreline and of its open groups
        start = TherionLine(Path(), 1, ())
        self.made.add(start, "*case preserve")
        self.made.add(start, f"*set names {NAME_CHARACTERS}")
        self.commands: dict[str, Callable[[TherionLine], None]] = {
            "data": self._data, "units": self._units, "calibrate": self._calibrate, "sd": self._sd,
            "declination": self._declination, "flags": self._flags, "fix": self._fix, "equate": self._equate,
            "cs": self._cs, "infer": self._infer, "group": self._group, "endgroup": self._endgroup,
            "date": self._date, "grid-angle": self._grid_angle,
        }  # fmt: skip
        if place is not None:
            for text in (f"*cs {place.cs}", f"*cs out {place.cs_out}", self._computed_declination()):
                made.add(place.line, text)

    def read(self, line: TherionLine) -> None:
        if len(self.made.lines) > 3 * reader_limits().survex_shots:
            raise InputError(
                f"{line.where}: more lines than {3 * reader_limits().survex_shots} (survex_shots in {FILE})"
            )
        word = line.words[0]
        if self.skipped:
            self.skipped = "" if word == self.skipped else self.skipped
        elif self.shots is not None:
            self._read_centreline(line)
        elif word == "survey":
            self._survey(line)
        elif word == "endsurvey":
            self._endsurvey(line)
        elif word in ("centreline", "centerline"):
            self.made.add(line, "*begin")
            self.is_latitude_first = False
            if self.place is not None and self.place.date:
                self.made.add(line, f"*date {self.place.date}")
            self.shots = Shots(self.made)
            self.corrections = [{}]
        elif word in SKIPPED_BLOCKS:
            self.skipped = f"end{word}"
        elif word == "equate":
            self._equate(line)
        elif word == "import":
            add_imported(
                self.imports, line, "".join(f"{written_survey(name)}." for name, named in self.surveys if named)
            )
        elif word not in _IGNORED:
            raise InputError(f"{line.where}: {word[:40]!r} is not supported here")

    def end(self, path: Path) -> None:
        if self.shots is not None or self.surveys or self.skipped:
            what = "centreline" if self.shots else self.surveys[-1][0] if self.surveys else self.skipped
            raise InputError(f"{path}: {what} is not closed")

    def _read_centreline(self, line: TherionLine) -> None:
        assert self.shots is not None
        word = line.words[0]
        if word in ("endcentreline", "endcenterline"):
            self.shots.flush()
            self.made.add(line, "*end")
            self.shots = None
        elif word == "station":  # it may stand among the shots of a passage, which goes on
            self._station(line)
        elif word in self.commands:
            self.shots.flush()
            self.commands[word](line)
        elif word not in _IGNORED_IN_CENTRELINE:
            self.shots.read(line)

    def _survey(self, line: TherionLine) -> None:
        if len(line.words) < 2:
            raise InputError(f"{line.where}: a survey without a name")
        if len(self.surveys) >= reader_limits().survex_depth:
            most = reader_limits().survex_depth
            raise InputError(f"{line.where}: surveys are nested more than {most} deep (survex_depth in {FILE})")
        name, named, declination = require_name(line.where, line.words[1]), True, ""
        options = list(line.words[2:])
        while options:
            option = options.pop(0)
            if option not in _OPTIONS or len(options) < _OPTIONS[option]:
                raise InputError(f"{line.where}: survey option {option[:40]!r} is not supported")
            value, options = options[0], options[_OPTIONS[option] :]
            if option == "-namespace":
                named = value != "off"
            elif option == "-declination":
                declination = declination_for_survex(line.where, value.strip("[]").split(), self._convergence())
        self.surveys.append((name, named))
        self.made.add(line, f"*begin {written_survey(name)}" if named else "*begin")
        if declination:
            self.made.add(line, declination)

    def _endsurvey(self, line: TherionLine) -> None:
        if not self.surveys or (len(line.words) > 1 and line.words[1] != self.surveys[-1][0]):
            raise InputError(f"{line.where}: {' '.join(line.words)[:60]!r} closes no survey")
        name, named = self.surveys.pop()
        self.made.add(line, f"*end {written_survey(name)}" if named else "*end")

    def _data(self, line: TherionLine) -> None:
        assert self.shots is not None
        self.shots.order(line)

    def _units(self, line: TherionLine) -> None:
        self.made.add(line, f"*units {units_for_survex(line.where, line.words[1:])}")
        # Survex takes a correction in the units at its line, Therion in those of the readings.
        for quantity, numbers in self.corrections[-1].items():
            self.made.add(line, f"*calibrate {quantity} {numbers}")

    def _calibrate(self, line: TherionLine) -> None:
        self.corrections[-1] |= numbers_for_survex(line.where, line.words[1:])
        for quantity, numbers in self.corrections[-1].items():
            self.made.add(line, f"*calibrate {quantity} {numbers}")

    def _sd(self, line: TherionLine) -> None:
        self.made.add(line, f"*sd {units_for_survex(line.where, line.words[1:])}")

    def _declination(self, line: TherionLine) -> None:
        words = [word.strip("[]") for word in line.words[1:]]
        is_reset = words == ["-"]
        stated = "" if is_reset else declination_for_survex(line.where, words, self._convergence())
        self.made.add(line, stated or self._computed_declination())

    def _computed_declination(self) -> str:
        if self.place is None:
            return "*declination 0 degrees"
        return "*declination auto {:.8f} {:.8f} {:.3f}".format(*self.place.middle)

    def _convergence(self) -> float:
        return 0.0 if self.place is None else self.place.convergence_deg

    def _date(self, line: TherionLine) -> None:
        date = date_for_survex(line.words[1:])
        if date:
            self.made.add(line, f"*date {date}")

    def _flags(self, line: TherionLine) -> None:
        text = flags_for_survex(line.where, line.words[1:])
        if text:
            self.made.add(line, f"*flags {text}")

    def _fix(self, line: TherionLine) -> None:
        if len(line.words) < 5:
            raise InputError(f"{line.where}: expected fix station east north up")
        east, north, up, *_ = (number_for_survex(line.where, word) for word in line.words[2:])
        if self.is_latitude_first:
            east, north = north, east
        self.made.add(line, f"*fix {station_for_survex(line.where, line.words[1])} {east} {north} {up}")

    def _station(self, line: TherionLine) -> None:
        """Keep of a station's flags, which follow its name and a comment, that it is an entrance."""
        flags = [word.lower() for word in line.words[3:]]
        if "entrance" in flags and flags[: flags.index("entrance")][-1:] != ["not"]:
            self.made.add(line, f"*entrance {station_for_survex(line.where, line.words[1])}")

    def _equate(self, line: TherionLine) -> None:
        names = [station_for_survex(line.where, word) for word in line.words[1:]]
        if len(names) < 2:
            raise InputError(f"{line.where}: equate needs two stations")
        self.made.add(line, f"*equate {' '.join(names)}")

    def _cs(self, line: TherionLine) -> None:
        system = cs_for_survex(line.where, line.words[1:])
        if self.place is None:
            raise InputError(f"{line.where}: cs {system.name}, but no station is fixed in it")
        self.is_latitude_first = system.is_latitude_first
        self.made.add(line, f"*cs {system.name}")

    def _grid_angle(self, line: TherionLine) -> None:
        words = [word.strip("[]") for word in line.words[1:]]
        self.made.add(line, declination_for_survex(line.where, words, 0.0))  # it counts from grid north already

    def _infer(self, line: TherionLine) -> None:
        words = [word.lower() for word in line.words[1:]]
        if len(words) != 2 or words[0] not in ("plumbs", "equates") or words[1] not in ("on", "off"):
            raise InputError(f"{line.where}: {' '.join(line.words)[:60]!r} is not supported")
        self.made.add(line, f"*infer {' '.join(words)}")

    def _group(self, line: TherionLine) -> None:
        self.corrections.append(dict(self.corrections[-1]))
        if len(self.corrections) > reader_limits().survex_depth + 1:
            raise InputError(f"{line.where}: groups are nested too deep (survex_depth in {FILE})")
        self.made.add(line, "*begin")

    def _endgroup(self, line: TherionLine) -> None:
        if len(self.corrections) < 2:
            raise InputError(f"{line.where}: endgroup closes no group")
        self.corrections.pop()
        self.made.add(line, "*end")
