"""Kinds of work, where pieces of them are done, and the options of a command that does many."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pieces.results import PiecesError

KEPT = "artifacts/pieces"  # where results are kept without `--to`


@dataclass(frozen=True)
class Work:
    """A kind of work; what a piece needs of processors and memory is what its kind measured."""

    title: str  # of the progress, and the folder of the results
    do: Callable[[Any], Any]  # returns the result of an item; a function of a module, or a partial of one
    result: Any  # type, as pydantic reads it from JSON
    code: str  # hash of the code that decides the result
    inputs: Any = None  # what else decides it beside the item, as JSON
    kept: str | None = KEPT  # where results are kept without `--to`; nowhere if it is None
    processors: float = 1.0
    memory_gb: float = 1.0
    label: Callable[[Any], str] = str  # returns an item's name for people
    problem: Callable[[Any], str | None] | None = None  # returns why a result does not count; it is not kept
    folder: Callable[[Any], Path] | None = None  # returns the folder that a piece writes, kept with `--to` as well
    holds: Callable[[Any, Any], bool] | None = None  # returns whether the folder of an item here is that of a result


@dataclass(frozen=True)
class Where:
    """Where pieces are done; `piece` is the label of the only one to do."""

    jobs: int = 1
    on: str = "local"
    to: str | None = None
    piece: str | None = None


HERE = Where()  # one after another in this process


def add_options(parser: argparse.ArgumentParser, jobs: int = os.cpu_count() or 1, keeps: bool = True) -> None:
    """Declare the options whose values are those of `Where`; without `keeps` none about results that are kept."""
    parser.add_argument("--jobs", type=int, default=jobs, help="processes on this machine")
    on = "ray: the cluster at RAY_ADDRESS, or one started here"
    parser.add_argument("--on", choices=["local", "ray"], default="local", help=on)
    parser.set_defaults(to=None)
    if keeps:
        parser.add_argument("--to", metavar="ADDRESS", help="folder or object store of the results of pieces")
    parser.add_argument("--piece", metavar="LABEL", help="do this piece alone, again, and end")


def where_of(given: argparse.Namespace) -> Where:
    """Return what the options state; `PiecesError` without a process."""
    if given.jobs < 1:
        raise PiecesError(f"jobs = {given.jobs}: want 1 or more")
    return Where(given.jobs, given.on, given.to, given.piece)


def code_sha256(*packages: str) -> str:
    """Return one hash of the modules of packages, without tests."""
    specs = [spec for name in packages if (spec := find_spec(name)) is not None]
    roots = [Path(root) for spec in specs for root in spec.submodule_search_locations or ()]
    paths = [path for root in roots for path in sorted(root.rglob("*.py")) if "tests" not in path.parts]
    return sha256(b"\0".join(path.read_bytes() for path in paths)).hexdigest()
