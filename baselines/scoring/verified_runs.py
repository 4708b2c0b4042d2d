"""Which results files were driven here, by the hash of their contents, in `driven_here.json`."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from baselines.base.errors import BaselineError
from baselines.base.result_file import Episode, Head, chain, replace_text
from minexplore.sealed.json_text import describe_json_error

RECORD = "driven_here.json"  # in the folder of all results: a file's path below it, and the hash of its contents


def note_driven(path: Path, results: Path, head: Head, episodes: list[Episode]) -> bool:
    """Keep that all episodes of a file were driven here; return whether it lies below the folder of results."""
    place, results = path.resolve(), results.resolve()
    if not place.is_relative_to(results):
        return False
    kept = _read_record(results) | {place.relative_to(results).as_posix(): _digest(head, episodes)}
    there = {name: digest for name, digest in sorted(kept.items()) if (results / name).is_file()}
    replace_text(results / RECORD, json.dumps(there, indent=1) + "\n")
    return True


def was_driven_here(path: Path, results: Path, head: Head, episodes: list[Episode]) -> bool:
    """Return whether a file's present contents were driven here."""
    name = path.resolve().relative_to(results.resolve()).as_posix()
    return _read_record(results).get(name) == _digest(head, episodes)


def _read_record(results: Path) -> dict[str, str]:
    file = results / RECORD
    try:
        kept = json.loads(file.read_text()) if file.is_file() else {}
    except OSError as error:
        raise BaselineError(f"{file}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise BaselineError(f"{file}: {describe_json_error(error)}; remove it and drive the runs again") from error
    if not isinstance(kept, dict):
        raise BaselineError(f"{file}: want the hash of each file that was driven here")
    return kept


def _digest(head: Head, episodes: list[Episode]) -> str:
    return hashlib.sha256(chain(head, episodes).encode()).hexdigest()
