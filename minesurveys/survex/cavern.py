"""Solve a survey with Survex's `cavern`."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

from minesurveys.errors import InputError, first_few, one_line
from minesurveys.guard.process_limits import die_with_parent
from minesurveys.limits import FILE
from minesurveys.remarks import warn_user
from minesurveys.solved.model import SolvedSurvey
from minesurveys.solved.survex_3d import read_3d
from minesurveys.survex.adjustment import (
    computed_declinations,
    read_traverses,
    require_printed_length,
    state_declination,
    warn_of_computed,
    warn_of_misclosures,
)
from minesurveys.survex.survex_text import Written

_MESSAGE_BYTES = 1_000_000
_ERROR = re.compile(r"^(.*?):(\d+)(?::\d+(?:-\d+)?)?: (?:fatal )?error: (.*)$")
# Survex only warns of readings that no instrument shows: findings/survex-impossible-readings-are-warnings.sh. A mine of
# them would be turned or mirrored in part.
_UNREAL = re.compile(
    r"^(.*?):(\d+)(?::\d+(?:-\d+)?)?: warning: "
    r"(Negative (?:adjusted )?tape.*|Clino reading over 90.*)$"
)
# Survex goes on round the circle. Large published surveys have such readings.
_BEYOND_CIRCLE = re.compile(r"^(.*?):(\d+)(?::\d+(?:-\d+)?)?: warning: (Suspicious compass.*)$")
# Survex only warns of a name that no leg has: mistyped in *equate it leaves a loop open, in *entrance a portal shut.
_OF_NO_LEG = re.compile(
    r"^(.*?):(\d+)(?::\d+(?:-\d+)?)?: warning: "
    r"(Station .(\S+). referred to (?:just once.*|by \*entrance or \*export but never used.*))$"
)
# Survex 1.4 turns bearings by a right angle in systems whose first axis is north, such as EPSG:2193 and EPSG:31467:
# findings/survex-north-first-systems-turn-legs.sh.
_CONVERGENCE = re.compile(r"^(.*?):(\d+)(?::\d+(?:-\d+)?)?: info: (Declination: .*grid convergence: (-?[\d.]+)°.*)$")
_MOST_CONVERGENCE_DEG = 45.0
# Survex 1.4.10 and newer leave out what hangs on no fixed station; older ones refuse it. Both list one station of each
# piece, the newer ones with its file.
_HANGING = "The following survey stations are not attached to a fixed point:"
_HANGING_STATION = re.compile(r"(?:.*: info: )?(\S+)")


def require_cavern(path: Path) -> str:
    """Return the path of `cavern`.

    Raises
    ------
    InputError
        If Survex is not installed.
    """
    program = shutil.which("cavern")
    if program is None:
        raise InputError(
            f"{path}: needs Survex to be solved, and `cavern` is not installed; "
            "`make setup` installs it (Debian: survex)"
        )
    return program


def require_version(path: Path, least: tuple[int, ...], what: str) -> None:
    """Refuse a file that needs a newer version of Survex than is installed.

    Raises
    ------
    InputError
        The message names the version that is installed, and the one that is needed.
    """
    _, output = _run([require_cavern(path), "--version"])
    version = _version(output)
    if version < least:
        needed, installed = (".".join(map(str, numbers)) for numbers in (least, version))
        raise InputError(f"{path}: {what} needs Survex {needed} or newer to be solved; {installed} is installed")


def solve(path: Path, written: Written, declination_deg: float | None = None) -> SolvedSurvey:
    """Solve a project whose files were checked.

    `cavern` runs as a child of this process, inherits its limits on memory, processor time and file size, and ends with
    it. It writes into a temporary folder only. Misclosures, computed declinations and stations that hang on no fixed
    one are listed.

    Parameters
    ----------
    path : Path
        The main file. Errors name it.
    written : Written
        What to solve in place of the file itself. Errors name the lines from which it was made.
    declination_deg : float, optional
        In place of every declination that Survex computes.

    Raises
    ------
    InputError
        If Survex is not installed, refuses the project, or writes no result. Its first error is given with file and
        line.

    References
    ----------
    Survex manual, "cavern".
    """
    program = require_cavern(path)
    with tempfile.TemporaryDirectory(prefix="minexplore-") as name:
        folder = Path(name)
        source = written.write(folder)
        result = folder / f"{path.stem}.3d"
        command = [program, "-q", "-o", str(result), str(source)]
        status, output = _run(command)
        is_computed = status == 0 and bool(computed_declinations(output))
        if declination_deg is not None and is_computed:
            survey = read_3d(result)
            state_declination(declination_deg, survey, [file for file in folder.rglob("*") if file.is_file()])
            status, output = _run(command)
        elif declination_deg is not None:
            warn_user("--declination changes nothing: no declination is computed", of=path.name, option="--declination")
        if status != 0 or not result.is_file():
            raise InputError(_problem(path, source, status, output, written))
        _require_sound(path, source, output, written)
        warn_of_computed(path, _version(output), computed_declinations(output))
        doubt = warn_of_misclosures(path, read_traverses(result.with_suffix(".err")), written.message)
        hanging = hanging_stations(output)
        if hanging:
            some = ", ".join(written.message(station) for station in hanging[:3])
            warn_user(
                f"pieces hang on no fixed station and are left out: that of {some}", of=path.name, count=len(hanging)
            )
        try:
            survey = read_3d(result)
        except InputError as error:
            raise InputError(str(error).replace(str(result), f"{path}: the result of cavern")) from error
        _warn_of_mistyped(path, source, output, written, survey)
        require_printed_length(path, output, survey)
        title = path.stem if survey.title == source.stem else survey.title
        return replace(survey, title=title, names=written.names(survey.names), doubt=doubt)


def _require_sound(path: Path, source: Path, output: str, written: Written) -> None:
    """Refuse readings that no instrument shows and bearings that are turned wrongly.

    Those beyond 360 deg are listed.
    """
    unreal = _named(_UNREAL, path, source, output, written)
    if unreal is not None:
        raise InputError(f"{unreal}; correct it")
    beyond = _named(_BEYOND_CIRCLE, path, source, output, written)
    if beyond is not None:
        count = sum(_BEYOND_CIRCLE.match(line) is not None for line in output.splitlines())
        warn_user(
            "compass readings are beyond 360 deg and go on round the circle, 364 as 4; the first is "
            f"{beyond.rpartition('/')[2]}",
            of=path.name,
            count=count,
        )
    turned = _named(_CONVERGENCE, path, source, output, written)
    if turned is not None:
        raise InputError(
            f"{turned}; this version of Survex turns bearings wrongly in this coordinate system; fix the stations "
            "in another one (UTM), or state *declination as a number"
        )


def _warn_of_mistyped(path: Path, source: Path, output: str, written: Written, survey: SolvedSurvey) -> None:
    """List names that no leg has: those that Survex warns of, with the first's line, and the others of equates.

    Survex warns of none whose equate is in its own survey; such a station has no flag
    (findings/survex-mistyped-equate-is-silent.sh).
    """
    listed = [found[4] for line in output.splitlines() if (found := _OF_NO_LEG.match(line))]
    names = zip(survey.names, survey.station_flags, strict=True)
    others = [name for name, flags in names if name and not flags and name not in listed]
    if not listed and not others:
        return
    first = _named(_OF_NO_LEG, path, source, output, written) or written.names(tuple(others))[0]
    warn_user(
        "names in equates, entrances or exports are of no station of a leg, and tie or open nothing; the first is "
        f"{first.removeprefix(f'{path.parent}/')}",
        of=path.name,
        count=len(listed) + len(others),
    )


def hanging_stations(output: str) -> list[str]:
    """Return a station of each piece of a survey that `cavern` lists as attached to no fixed station."""
    lines = output.partition(f"{_HANGING}\n")[2].splitlines()
    found = (_HANGING_STATION.fullmatch(line) for line in lines)
    return [match[1] for match in takewhile(bool, found) if match is not None]


def _version(output: str) -> tuple[int, ...]:
    """Return the version that `cavern` prints at the start; empty if it prints none."""
    found = re.search(r"Survex (\d+(?:\.\d+)*)", output)
    return tuple(int(part) for part in found[1].split(".")) if found else ()


def _run(command: list[str]) -> tuple[int, str]:
    """Run `cavern`; return its exit status and what it prints, at most 1 MB."""
    parent = os.getpid()
    environment = {"PATH": os.environ.get("PATH", os.defpath), "LC_ALL": "C.UTF-8", "PROJ_NETWORK": "OFF"}
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=environment,
        preexec_fn=lambda: die_with_parent(parent),
    ) as process:
        assert process.stdout is not None
        data = process.stdout.read(_MESSAGE_BYTES)
        if len(data) == _MESSAGE_BYTES:
            process.kill()
    return process.returncode, data.decode("utf-8", "replace")


def _named(kind: re.Pattern[str], path: Path, source: Path, output: str, written: Written) -> str | None:
    """Return the first message of a kind, with the file and line of the user's that it is about."""
    for line in output.splitlines():
        found = kind.match(line)
        if found is None or (kind is _CONVERGENCE and abs(float(found[4])) < _MOST_CONVERGENCE_DEG):
            continue
        file, number = Path(found[1]), int(found[2])
        message = found[3]
        if file.parent == source.parent:
            file, number = written.origin(file, number)
            message = written.message(message)
        elif file.is_relative_to(source.parent):
            file = path.parent / file.relative_to(source.parent)
        return f"{file}:{number}: {one_line(message, 300)} (Survex)"
    return None


def _problem(path: Path, source: Path, status: int, output: str, written: Written) -> str:
    named = _named(_ERROR, path, source, output, written)
    if named is not None:
        return named
    mistyped = _named(_OF_NO_LEG, path, source, output, written)
    likely = "" if mistyped is None else f"; {mistyped.removeprefix(f'{path.parent}/')}"
    hanging = hanging_stations(output)
    if hanging:
        shown = [one_line(written.message(text), 60) for text in hanging]
        return (
            f"{path}: {first_few(shown)}: no leg and no equate leads from there to a fixed station; tie it by one "
            f"of them, or fix a station of it{likely}"
        )
    if status < 0:
        return f"{path}: Survex ended by signal {-status}; the survey needs more than a limit in {FILE}"
    errors = [line.partition("error: ")[2] for line in output.splitlines() if "error: " in line]
    last = errors[:1] or [line for line in output.splitlines() if line.strip()][-1:] or ["no message"]
    return f"{path}: Survex cannot solve it: {one_line(last[0], 300)}{likely}"
