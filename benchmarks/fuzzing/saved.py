"""Files as a library writes them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

Files = dict[str, bytes]
"""The content of files by their names."""


def saved(name: str, write: Callable[[Path], Any]) -> Files:
    """Return the file of a name that a function writes, and behind it the files that it writes beside it."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return {p.name: p.read_bytes() for p in sorted(Path(folder).iterdir(), key=lambda p: p.name != name)}
