"""Results files: read them, and print what they say."""

from __future__ import annotations

import itertools
from pathlib import Path

from pydantic import ValidationError

from baselines.errors import BaselineError
from baselines.protocol import FORMAT, Episode, Head, line_sha256
from baselines.statistics import Figure

RESULTS = Path(__file__).parent / "results"


def read_results(path: Path) -> tuple[Head, list[Episode]]:
    """Return a results file's head and episodes.

    Raises
    ------
    BaselineError
        If it is none, is cut short, or a line was changed; the message names the line.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise BaselineError(f"{path}: cannot be read ({error})") from error
    lines = text.splitlines()
    if not lines or not text.endswith("\n"):
        raise BaselineError(f"{path}: cut short: the last line has no end")
    try:
        head = Head.model_validate_json(lines[0])
    except ValidationError as error:
        raise BaselineError(f"{path}:1: not the head of a results file ({_first(error)})") from error
    if head.format != FORMAT:
        raise BaselineError(f"{path}:1: format {head.format!r}, this version reads {FORMAT!r}")
    episodes = []
    for number, (before, line) in enumerate(itertools.pairwise(lines), 2):
        try:
            episode = Episode.model_validate_json(line)
        except ValidationError as error:
            raise BaselineError(f"{path}:{number}: not an episode ({_first(error)})") from error
        if episode.previous != line_sha256(before):
            raise BaselineError(
                f"{path}:{number}: the line before it was changed: its hash is not the one written here"
            )
        episodes.append(episode)
    if [e.seed for e in episodes] != head.seeds:
        raise BaselineError(
            f"{path}: {len(episodes)} episodes, the head says {len(head.seeds)} seeds, in this order: {head.seeds}"
        )
    return head, episodes


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"


def as_text(name: str, figure: Figure) -> str:
    """Return a figure with its interval as a table has it."""
    if figure.value is None or figure.low is None or figure.high is None:
        return "never"
    percent = name.startswith(("coverage at", "share", "area"))
    scale, digits = (100, 1) if percent else (1, 1)
    unit = " %" if percent else ""
    return f"{scale * figure.value:.{digits}f}{unit} ({scale * figure.low:.{digits}f}-{scale * figure.high:.{digits}f})"
