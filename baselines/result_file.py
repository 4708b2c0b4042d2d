"""Results files: a head, then one line an episode, each with the hash of the line before it."""

from __future__ import annotations

import hashlib
import itertools
import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from baselines.errors import BaselineError

RESULTS = Path(__file__).parent / "results"
CHECKPOINTS = RESULTS / "checkpoints"
FORMAT = "minexplore-results/1"
SAMPLE_STEPS = 20  # control steps between samples of the coverage curve and the path: 2 s


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Head(_Strict):
    """The first line of a results file: environment, world, task, robot, policy, versions and seeds."""

    format: str
    env: str
    world_sha256: str
    task: dict[str, Any]
    robot: dict[str, Any] = Field(default_factory=dict)  # empty in files written before it was recorded
    cells: int = Field(gt=0)
    policy: str
    policy_sha256: str
    versions: dict[str, str]
    seeds: list[int] = Field(min_length=1)


class Episode(_Strict):
    """One line an episode, sampled at the start, every 2 s, and at the end.

    `seen` counts cells, `path_cm` is x, y in the mine frame, `idle` counts the steps that saw no new cell, `collided`
    those that touched rock; `path_m` is the sum over all control steps. `previous` is the hash of the line before.
    """

    seed: int
    steps: int = Field(ge=1)
    seen: list[int] = Field(min_length=2)
    path_cm: list[tuple[int, int]] = Field(min_length=2)
    idle: int = Field(ge=0)
    collided: int = Field(ge=0)
    path_m: float = Field(ge=0, allow_inf_nan=False)
    returned: float = Field(allow_inf_nan=False)
    previous: str


def result_path(label: str, env_id: str) -> Path:
    """Return where a policy's results in an environment are kept."""
    return RESULTS / env_id.removeprefix("MineXplore/").replace("/", "-") / f"{label.replace(':', '.')}.jsonl"


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
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(".new")
    fresh.write_text(chain(head, episodes))
    fresh.replace(path)


def read_results(path: Path) -> tuple[Head, list[Episode]]:
    """Return a results file's head and episodes.

    Raises
    ------
    BaselineError
        If it is not a results file, is cut short, or a line was changed; the message names the line.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise BaselineError(f"{path}: cannot be read ({error})") from error
    lines = text.splitlines()
    if not lines or not text.endswith("\n"):
        raise BaselineError(f"{path}: cut short: the last line has no end")
    head = _read_head(path, lines[0])
    episodes = [
        _read_episode(path, number, before, line) for number, (before, line) in enumerate(itertools.pairwise(lines), 2)
    ]
    if [e.seed for e in episodes] != head.seeds:
        raise BaselineError(
            f"{path}: {len(episodes)} episodes, the head says {len(head.seeds)} seeds, in this order: {head.seeds}"
        )
    return head, episodes


def _read_head(path: Path, line: str) -> Head:
    try:
        head = Head.model_validate_json(line)
    except ValidationError as error:
        raise BaselineError(f"{path}:1: not the head of a results file ({_first_of(error)})") from error
    if head.format != FORMAT:
        raise BaselineError(f"{path}:1: format {head.format!r}, this version reads {FORMAT!r}")
    return head


def _read_episode(path: Path, number: int, before: str, line: str) -> Episode:
    try:
        episode = Episode.model_validate_json(line)
    except ValidationError as error:
        raise BaselineError(f"{path}:{number}: not an episode ({_first_of(error)})") from error
    if episode.previous != line_sha256(before):
        raise BaselineError(f"{path}:{number}: the line before it was changed: its hash is not the one written here")
    return episode


def _first_of(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
