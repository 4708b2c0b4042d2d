"""Whether the last stage of a world that this source checkout builds has ended, and the command that ends it."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from minexplore.bundle import RECORD

CONTINUE = "# Continue with: "  # begins the line of a world's params.yaml that states the command
PARAMS = "params.yaml"
ARTIFACTS = Path(os.path.abspath(__file__)).parents[1] / "artifacts"  # noqa: PTH100  a link stays one
_BUNDLE = ("realism", "world")
_MOST_BYTES = 16_000_000  # of a manifest; the largest names a few thousand files
_MOST_SHOWN = 500  # characters of a command


def command_to_end(bundle: Path, artifacts: Path = ARTIFACTS) -> str | None:
    """Return the command that ends the build of a world, or None if the build has ended.

    It has ended when the manifest of stage 6 names this `world.json`, which holds the hash of every file. A limit that
    stage 6 found breached does not matter: its figures say so. Folders outside `artifacts`, by default that of
    this source checkout, are not judged.
    """
    place = Path(os.path.abspath(bundle))  # noqa: PTH100  a link stays one
    if place.parts[-2:] != _BUNDLE or not place.is_relative_to(artifacts):
        return None
    root = place.parents[1]
    if _validated_sha256(root / "validation" / "manifest.json") == _sha256(place / RECORD):
        return None
    return "make all" if root == artifacts else _stated_command(root / PARAMS) or _usual_command(root)


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "missing"


def _validated_sha256(manifest: Path) -> str | None:
    """Return the hash of the `world.json` that stage 6 read, or None if there is no manifest of it."""
    try:
        if manifest.stat().st_size > _MOST_BYTES:
            return None
        stated: Any = json.loads(manifest.read_bytes())
        inputs = stated["inputs"] if stated["stage"] == "validation" else {}
        end = "/".join(("", *_BUNDLE, RECORD))
        return next((str(digest) for name, digest in inputs.items() if name.endswith(end)), None)
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
        return None


def _stated_command(params: Path) -> str:
    """Return the command that the build has noted; older builds noted none."""
    try:
        with params.open(encoding="utf-8") as lines:
            line = next((text for text in (next(lines, ""), next(lines, "")) if text.startswith(CONTINUE)), "")
    except (OSError, ValueError):
        return ""
    command = line.removeprefix(CONTINUE).strip()
    return command if command.isprintable() and len(command) <= _MOST_SHOWN else ""


def _usual_command(root: Path) -> str:
    if root.parent.name == "worlds":
        return f"python -m pipeline new {root.name} --from FILE"
    return "python -m pipeline worlds"
