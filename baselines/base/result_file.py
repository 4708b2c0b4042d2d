"""Results files: a head, then one line an episode, each with the hash of the line before it."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from baselines.base.errors import BaselineError
from baselines.base.refusals import first_refusal
from minexplore.limits import UnreadableError, read_plain_file, require_small_json
from minexplore.splits import SIZES

RESULTS = Path(__file__).parents[1] / "results"
CHECKPOINTS = RESULTS / "checkpoints"
FORMAT = "minexplore-results/1"
SAMPLE_STEPS = 20  # control steps between samples of the coverage curve and the path: 2 s

# What a results file may hold at most; the benchmark's largest files hold a hundredth of it.
MOST_BYTES = 16_000_000
MOST_EPISODES = 512
MOST_STEPS = 1_000_000  # of an episode; more than a day
MOST_SAMPLES = MOST_STEPS // SAMPLE_STEPS + 2
MOST_CELLS = 10_000_000
MOST_CM = 10_000_000  # of a coordinate: 100 km
MOST_M = 10_000_000.0  # of a path
MOST_RETURN = 1e9
MOST_FACTS = 64  # numbers of a task or a robot, and versions
MOST_LINES = 2 * max(SIZES.values())  # of a split: two a mine
# What is counted of a line before it is read: bytes, commas and opening brackets, keys, and brackets within brackets.
_HEAD = 100_000, 3 * MOST_FACTS * 10 + MOST_EPISODES + 100, 3 * MOST_FACTS + 20  # a fact has at most 8 numbers
_EPISODE = 2_000_000, 4 * MOST_SAMPLES + 100, 20  # a sample has three numbers of up to 9 digits
_DEEPEST = 3
_MOST_SAID = 200  # characters of a message that come from the file
# A policy's name is a file's name and a module's: no `..`, no dot at an end, and no hyphen as an option begins.
POLICY = r"^[A-Za-z0-9_][A-Za-z0-9_-]*(\.[A-Za-z0-9_-]+)*$"
MOST_POLICY = 64

_Text = Annotated[str, Field(pattern=r"^[ -~]{0,100}$")]  # no control characters: it is printed
_Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,64}$")]
_Policy = Annotated[str, Field(pattern=POLICY, max_length=MOST_POLICY)]
_Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_Count = Annotated[int, Field(ge=0, le=MOST_STEPS)]
_Cells = Annotated[int, Field(ge=0, le=MOST_CELLS)]
_Cm = Annotated[int, Field(ge=-MOST_CM, le=MOST_CM)]
_Seed = Annotated[int, Field(ge=0, lt=2**32)]
_Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e12, le=1e12)]
_Whole = Annotated[int, Field(ge=-(10**12), le=10**12)]
_Fact = bool | _Whole | _Number | _Text | Annotated[list[_Number], Field(max_length=8)]
_Facts = Annotated[dict[_Name, _Fact], Field(max_length=MOST_FACTS)]


class _StrictEntry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, hide_input_in_errors=True)


class Head(_StrictEntry):
    """The first line of a results file: environment, world, task, robot, policy, versions and seeds."""

    format: _Text
    env: _Text
    world_sha256: _Sha256
    task: _Facts
    robot: _Facts
    cells: int = Field(gt=0, le=MOST_CELLS)
    policy: _Policy
    policy_sha256: _Sha256
    versions: Annotated[dict[_Name, _Text], Field(max_length=MOST_FACTS)]
    seeds: list[_Seed] = Field(min_length=1, max_length=MOST_EPISODES)


class Episode(_StrictEntry):
    """One line an episode, sampled at the start, every 2 s, and at the end.

    `seen` counts cells, `path_cm` is x, y in the mine frame, `idle` counts the steps that saw no new cell, `collided`
    those that touched rock; `path_m` is the sum over all control steps. `previous` is the hash of the line before.
    """

    seed: _Seed
    steps: int = Field(ge=1, le=MOST_STEPS)
    seen: list[_Cells] = Field(min_length=2, max_length=MOST_SAMPLES, fail_fast=True)
    path_cm: list[tuple[_Cm, _Cm]] = Field(min_length=2, max_length=MOST_SAMPLES, fail_fast=True)
    idle: _Count
    collided: _Count
    path_m: float = Field(ge=0, le=MOST_M, allow_inf_nan=False)
    returned: float = Field(ge=-MOST_RETURN, le=MOST_RETURN, allow_inf_nan=False)
    previous: str = Field(pattern=r"^([0-9a-f]{64})?$")


def result_path(label: str, env_id: str) -> Path:
    """Return where a policy's results in an environment are kept."""
    return RESULTS / env_id.removeprefix("MineXplore/").replace("/", "-") / f"{label}.jsonl"


def chain(head: Head, episodes: list[Episode]) -> str:
    """Return a results file's text: each line holds the hash of the one before it."""
    lines = [head.model_dump_json()]
    for episode in episodes:
        lines.append(episode.model_copy(update={"previous": line_sha256(lines[-1])}).model_dump_json())
    return "\n".join(lines) + "\n"


def line_sha256(line: str) -> str:
    """Return the hash of a line of a results file; the order of its keys does not matter."""
    return hashlib.sha256(json.dumps(json.loads(line), sort_keys=True).encode()).hexdigest()


def write_results(path: Path, head: Head, episodes: list[Episode]) -> None:
    """Write a results file; an interrupted write leaves the previous file in place."""
    replace_text(path, chain(head, episodes))


def require_place(path: Path) -> None:
    """Make the folder of a file that is to be written; refuse what is no plain file, which no results may replace.

    Raises
    ------
    BaselineError
        Naming the path.
    OSError
        If there can be no such folder.
    """
    if (path.is_symlink() or path.exists()) and not path.is_file():
        raise BaselineError(f"{path}: not a plain file; no results are written there")
    path.parent.mkdir(parents=True, exist_ok=True)


def replace_text(path: Path, text: str) -> None:
    """Write a file whole or not at all, also where two processes write it at once; replace only a plain file."""
    require_place(path)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        fresh.write_text(text)
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


def read_results(path: Path) -> tuple[Head, list[Episode]]:
    """Return a results file's head and episodes.

    Raises
    ------
    BaselineError
        If it is not a results file, or is too large or cut short; the message names the line.
    """
    return parse_results(path, read_text(path))


def parse_results(path: Path, text: str) -> tuple[Head, list[Episode]]:
    """Return head and episodes of a results file's text; errors name `path`."""
    lines = text.split("\n")
    if lines.pop() or not lines:
        raise BaselineError(f"{path}: cut short: the last line has no end")
    if len(lines) > 1 + MOST_EPISODES:
        raise BaselineError(f"{path}: {len(lines)} lines, a results file has at most {1 + MOST_EPISODES}")
    head = _read_head(path, lines[0])
    episodes = [_read_episode(path, number, line) for number, line in enumerate(lines[1:], 2)]
    if [e.seed for e in episodes] != head.seeds:
        raise BaselineError(
            f"{path}: {len(episodes)} episodes, the head says {len(head.seeds)} seeds, in this order: {head.seeds}"
        )
    return head, episodes


def read_text(path: Path) -> str:
    """Return a file's text.

    Raises
    ------
    BaselineError
        If it is no plain file, too large, or no text.
    """
    try:
        data = read_plain_file(path, MOST_BYTES)
        text = data.decode()
    except UnreadableError as error:
        raise BaselineError(f"{path}: {error}") from error
    except UnicodeDecodeError as error:
        raise BaselineError(f"{path}: cannot be read: not UTF-8 text from byte {error.start} on") from error
    if data.count(b"\n") > MOST_LINES:
        raise BaselineError(f"{path}: more than {MOST_LINES:,} lines, the most of a results file")
    return text


def _read_head(path: Path, line: str) -> Head:
    _require_small(f"{path}:1", line, *_HEAD)
    try:
        head = Head.model_validate_json(line)
    except ValidationError as error:
        raise BaselineError(f"{path}:1: not the head of a results file ({_first_of(error)})") from error
    if head.format != FORMAT:
        raise BaselineError(f"{path}:1: format {head.format!r}, this version reads {FORMAT!r}")
    return head


def _require_small(place: str, line: str, size: int, values: int, keys: int) -> None:
    if len(line) > size:
        raise BaselineError(f"{place}: {len(line):,} characters, at most {size:,} are read")
    try:
        require_small_json(line.encode(), values, keys, _DEEPEST)
    except UnreadableError as error:
        raise BaselineError(f"{place}: {error}") from error


def _read_episode(path: Path, number: int, line: str) -> Episode:
    _require_small(f"{path}:{number}", line, *_EPISODE)
    try:
        return Episode.model_validate_json(line)
    except ValidationError as error:
        raise BaselineError(f"{path}:{number}: not an episode ({_first_of(error)})") from error


def _first_of(error: ValidationError) -> str:
    """Return the first value that is refused, as plain text: it and the field's name come from the file."""
    return first_refusal(error).encode("unicode_escape").decode()[: 2 * _MOST_SAID]
