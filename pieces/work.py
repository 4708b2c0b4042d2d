"""Kinds of work, where pieces of them are done, and the options of a command that does many."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from pieces.results import PiecesError

KEPT = "artifacts/pieces"  # where results are kept without `--to`


@dataclass(frozen=True)
class Work:
    """A kind of work; `do`, `problem` and `folder` are functions of modules, or partials of them, for processes."""

    title: str  # of the progress, and the folder of the results
    do: Callable[[Any], Any]  # returns the result of an item
    result: Any  # type, as pydantic reads it from JSON
    code: str  # hash of the code that decides the result
    inputs: Any = None  # what else decides it beside the item, as JSON
    kept: str | None = KEPT  # where results are kept without `--to`; nowhere if it is None
    memory_gb: float = 1.0  # of a piece, measured; each has one processor
    label: Callable[[Any], str] = str  # returns an item's name for people
    problem: Callable[[Any], str | None] | None = None  # returns why a result does not count; it is not kept
    folder: Callable[[Any], Path] | None = None  # returns the folder that a piece writes, kept with `--to` as well
    holds: Callable[[Any, Any], bool] | None = None  # returns whether the folder of an item here is that of a result

    def name(self, item: Any) -> str:
        """Return the name of an item's result."""
        return f"{self.title}/{sha256(to_json([self.code, self.inputs, item])).hexdigest()}"


@dataclass(frozen=True)
class Where:
    """Where pieces are done; `piece` is the label of the only one to do."""

    jobs: int = 1
    on: str = "local"
    to: str | None = None
    piece: str | None = None


HERE = Where()  # one after another in this process


def add_options(parser: argparse.ArgumentParser, jobs: int = os.cpu_count() or 1, keeps: bool = True) -> None:
    """Declare the options of `where_of`; without `keeps` none about results that are kept."""
    parser.add_argument("--jobs", type=int, default=jobs, help="processes on this machine")
    on = "ray: the cluster at RAY_ADDRESS, or one started here"
    parser.add_argument("--on", choices=["local", "ray"], default="local", help=on)
    if keeps:
        parser.add_argument("--to", metavar="ADDRESS", help="folder or object store of the results of pieces")
    parser.add_argument("--piece", metavar="LABEL", help="do this piece alone, again, and end")


def where_of(given: argparse.Namespace) -> Where:
    """Return what the options state; `PiecesError` without a process."""
    if given.jobs < 1:
        raise PiecesError(f"jobs = {given.jobs}: want 1 or more")
    return Where(given.jobs, given.on, getattr(given, "to", None), given.piece)


def code_sha256(*packages: str) -> str:
    """Return one hash of the modules of packages, without tests."""
    paths = [path for name in packages for path in sorted(Path(str(files(name))).rglob("*.py"))]
    return sha256(b"\0".join(path.read_bytes() for path in paths if "tests" not in path.parts)).hexdigest()
