"""The legs, equates and fixed stations of a Survex project, as its text states them.

Only what a plain project states is read. `read_network` returns None for any other.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.solved.project_files import COMMAND, included_file, text_lines

MARK = "minexplore"  # begins the names of surveys that we add
_ANONYMOUS = re.compile(r"\.{1,3}")
_NOT_LEGS = {"passage", "ignore", "nosurvey"}  # styles whose lines tie no station to a place
_NOT_TIES = {"equate", "fix", "entrance", "export", "require"}  # commands that name stations, or solve nothing
# These give names, lines or places another meaning than is read here.
_BEYOND = {"prefix", "truncate", "solve", "default"}
_DASH = ["station", "-", ".."]  # what follows `*alias` where a dash is an anonymous station
_PLAIN_SETS = {"decimal", "minus", "names", "plus"}
_CASES: dict[str, Callable[[str], str]] = {"toupper": str.upper, "tolower": str.lower, "preserve": str}


class _BeyondError(Exception):
    """The project states more than is read here."""


@dataclass(frozen=True)
class State:
    """What the commands before a line state.

    Attributes
    ----------
    columns : tuple of int or None
        Where a line of data has the stations of a leg; None if it has none.
    survey : tuple of str
    case : function
        What Survex makes of the letters of a name.
    has_dash : bool
        A dash is the name of an anonymous station.
    """

    columns: tuple[int, int] | None = (0, 1)
    survey: tuple[str, ...] = ()
    case: Callable[[str], str] = str.lower
    has_dash: bool = False

    def name(self, *words: str) -> str:
        """Return the full name of a station, or of one in surveys below this one."""
        return ".".join((*self.survey, *map(self.case, words)))


@dataclass(frozen=True)
class ShotElement:
    """A leg, with all its readings in a row, or a fixed station.

    Attributes
    ----------
    block : str
        A name that no other element has.
    stations : tuple of str
        As the text names them: two, or one that is fixed.
    lines : tuple of str
    state : State
    """

    block: str
    stations: tuple[str, ...]
    lines: tuple[str, ...]
    state: State

    def names(self) -> tuple[str, ...]:
        """Return the full names of the stations."""
        return tuple(self.state.name(station) for station in self.stations)


@dataclass
class ShotNetwork:
    """What a project's text states.

    Attributes
    ----------
    legs, fixed : list of ShotElement
    equal : list of tuple of str
        Full names of stations that are one.
    files : dict of Path to list of str or ShotElement
        The commands of each file, below the main file's folder, with the elements at their places.
    system : str
        That of the results; empty without one.
    """

    legs: list[ShotElement] = field(default_factory=list)
    fixed: list[ShotElement] = field(default_factory=list)
    equal: list[tuple[str, ...]] = field(default_factory=list)
    files: dict[Path, list[str | ShotElement]] = field(default_factory=dict)
    system: str = ""


def read_network(source: Path) -> ShotNetwork | None:
    """Return what the text of a project states; None if it states more than is read here."""
    network = ShotNetwork()
    try:
        _read_file(source, source.parent, network, State())
    except (_BeyondError, InputError):
        return None
    return network


def _read_file(path: Path, folder: Path, network: ShotNetwork, state: State) -> None:
    relative = path.relative_to(folder)
    if relative in network.files:
        raise _BeyondError  # its lines are legs of several surveys
    out = network.files[relative] = []
    above: list[State] = []
    for _, line in text_lines(path):
        command = COMMAND.match(line)
        if command is None:
            _read_data(line, state, network, out)
            continue
        word, words = command[1].lower(), command[2].partition(";")[0].replace(",", " ").split()
        _require_plain(word, words)
        if word == "begin":
            above.append(state)
            state = replace(state, survey=(*state.survey, *map(state.case, words[:1])))
        elif word == "end" and above:
            state = above.pop()
        elif word == "data":
            state = replace(state, columns=_columns(words, state.columns))
        elif word == "case" and words:
            state = replace(state, case=_CASES.get(words[0].lower(), state.case))
        elif word == "alias":
            state = replace(state, has_dash=True)
        elif word == "cs" and words[0].lower() == "out":
            network.system = " ".join(words[1:])
        elif word == "equate":
            network.equal.append(tuple(map(state.name, words)))
        elif word == "fix":
            out.append(_fixed(line, words, state, network))
        elif word == "include":
            file = included_file(str(path), command[2], path, folder.resolve())
            _read_file(file, folder, network, state)
        if word not in _NOT_TIES:
            out.append(line)


def _require_plain(word: str, words: list[str]) -> None:
    first = words[0].lower() if words else ""
    odd = word in _BEYOND or (word == "set" and first not in _PLAIN_SETS) or (word == "infer" and first == "equates")
    odd = odd or (word == "alias" and [name.lower() for name in words] != _DASH)
    if odd or (word in ("equate", "fix") and any("\\" in name for name in words)):
        raise _BeyondError


def _read_data(line: str, state: State, network: ShotNetwork, out: list[str | ShotElement]) -> None:
    words = line.partition(";")[0].replace(",", " ").split()
    if not words or state.columns is None:
        return
    ends = tuple(words[column] for column in state.columns if column < len(words))
    if len(ends) < 2 or any("\\" in end for end in ends):
        raise _BeyondError
    last = out[-1] if out else None
    if isinstance(last, ShotElement) and last.stations == ends:  # another reading of the leg
        out[-1] = network.legs[-1] = replace(last, lines=(*last.lines, line))
    elif not any(_ANONYMOUS.fullmatch(end) or (end == "-" and state.has_dash) for end in ends):
        network.legs.append(ShotElement(f"{MARK}{len(network.legs)}", ends, (line,), state))
        out.append(network.legs[-1])
    else:
        out.append("")  # readings after it are a leg of their own


def _fixed(line: str, words: list[str], state: State, network: ShotNetwork) -> ShotElement:
    if len([word for word in words[1:] if word.lower() != "reference"]) != 3:
        raise _BeyondError  # without a place, or with deviations
    network.fixed.append(ShotElement(f"{MARK}fixed{len(network.fixed)}", (words[0],), (line,), state))
    return network.fixed[-1]


def _columns(words: list[str], before: tuple[int, int] | None) -> tuple[int, int] | None:
    if not words:
        return before
    order = [word.lower() for word in words]
    if order[0] in _NOT_LEGS:
        return None
    if len(order) == 1:
        return (0, 1)
    if "from" not in order or "to" not in order or "newline" in order:
        raise _BeyondError
    return order.index("from") - 1, order.index("to") - 1
