"""A world bundle's proof: every file under its sha256, and one hash over all of them and the record."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

FORMAT = "minexplore-world/1"
RECORD = "world.json"


class BundleError(ValueError):
    """A bundle is incomplete, changed, or none at all; the message names the file."""


def read_bundle(folder: Path) -> dict[str, Any]:
    """Check a bundle's files against `world.json` and return the record.

    Parameters
    ----------
    folder : Path
        The bundle.

    Returns
    -------
    dict
        What `world.json` says: units are m, rad, kg, s.

    Raises
    ------
    BundleError
        Naming the file that is missing, changed, not listed, or leads out of the bundle.
    """
    file = folder / RECORD
    if not file.is_file():
        raise BundleError(f"{file}: missing; not a world bundle")
    try:
        record = json.loads(file.read_text())
        listed, world, form = dict(record["files"]), str(record["world_sha256"]), record["format"]
    except (ValueError, KeyError, TypeError) as error:
        raise BundleError(f"{file}: not a world bundle's record ({error})") from error
    if form != FORMAT:
        raise BundleError(f"{file}: format {form!r}, this version reads {FORMAT!r}")
    for name, digest in sorted(listed.items()):
        path = folder / name
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise BundleError(f"{file}: the file name {name!r} leads out of the bundle")
        if not path.is_file():
            raise BundleError(f"{path}: missing")
        found = hashlib.sha256(path.read_bytes()).hexdigest()
        if found != digest:
            raise BundleError(f"{path}: sha256 {found} differs from {digest} in {RECORD}")
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p != file):
        if path.relative_to(folder).as_posix() not in listed:
            raise BundleError(f"{path}: not listed in {RECORD}")
    if world_sha256(record) != world:
        raise BundleError(f"{file}: the world's hash {world} does not hold; the record was changed")
    return record


def world_sha256(record: dict[str, Any]) -> str:
    """Return the hash of a world: over its files' hashes and all else that the record says."""
    about = {k: v for k, v in record.items() if k != "world_sha256"}
    lines = {RECORD: hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest(), **record["files"]}
    text = "".join(f"{digest}  {name}\n" for name, digest in sorted(lines.items()))
    return hashlib.sha256(text.encode()).hexdigest()
