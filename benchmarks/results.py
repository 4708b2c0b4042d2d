"""Rows of measurements, files that other measurements have written, and how commands end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from baselines.base.errors import BaselineError
from pipeline.errors import ArtifactError, MineError

Row = dict[str, Any]


def read_written(path: Path, target: str) -> Any:
    """Return the content of a JSON file.

    Raises
    ------
    ArtifactError
        If the file is missing. The message names the command that writes it.
    """
    try:
        return json.loads(path.read_text())
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; run `python -m benchmarks {target}` first") from None


def run_benchmark(name: str, command: Callable[[], int]) -> int:
    """Run a command; return its exit code, or 2 after an expected error, which is one line."""
    try:
        return command()
    except (MineError, BaselineError, FileNotFoundError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 2
