"""The registry of inputs: sha256, size, origin and licence of each file, checked before use.

The project's own inputs are in `data/registry.txt`. Those of your mines are in `data/registry_own.txt`; no stage of the
default world depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError
from pipeline.store.files import write_atomically
from pipeline.store.hashing import absence_of, sha256_file
from pipeline.store.locks import hold_lock

REGISTRY, OWN_REGISTRY = Path("data/registry.txt"), Path("data/registry_own.txt")


@dataclass(frozen=True)
class Entry:
    """One line of the registry; `name` is the path below `data/`."""

    name: str
    sha256: str
    bytes: int
    origin: str
    licence: str


def read_registry() -> dict[str, Entry]:
    """Read both registries: tab-separated `name sha256 bytes origin licence`, `#` starts a comment line.

    Raises
    ------
    InputError
        If `data/registry.txt` is missing or a line is malformed.
    """
    if not REGISTRY.is_file():
        raise InputError(f"{REGISTRY}: {absence_of(REGISTRY)}; run from the project's root")
    own = _read_lines(OWN_REGISTRY) if OWN_REGISTRY.is_file() else {}
    return own | _read_lines(REGISTRY)


def _read_lines(path: Path) -> dict[str, Entry]:
    entries = {}
    for number, line in enumerate(path.read_text().splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        fields = line.split("\t")
        if len(fields) != 5 or len(fields[1]) != 64 or not fields[2].isdigit():
            raise InputError(f"{path}:{number}: want name, sha256, bytes, origin and licence, separated by tabs")
        entries[fields[0]] = Entry(fields[0], fields[1], int(fields[2]), fields[3], fields[4])
    return entries


def verify_input(path: Path, entries: dict[str, Entry]) -> str:
    """Check an input below `data/` against the registry and return its sha256.

    Raises
    ------
    InputError
        If the file is missing, unregistered or changed; the message gives the remedy.
    """
    name = path.relative_to("data").as_posix()
    entry = entries.get(name)
    if entry is None:
        raise InputError(f"{path}: not in {REGISTRY}; register it with `python -m pipeline register {path}`")
    if not path.is_file():
        hint = "fetch it with `make data`" if entry.origin.startswith("https://") else "restore it from git"
        raise InputError(f"{path}: {absence_of(path)}; {hint}")
    size = path.stat().st_size
    digest = sha256_file(path)
    if digest != entry.sha256:
        raise InputError(
            f"{path}: sha256 {digest} ({size} bytes) is not the registered {entry.sha256} ({entry.bytes} bytes)"
        )
    return digest


def register(path: Path, origin: str, licence: str, registry: Path = REGISTRY) -> Entry:
    """Append a file below `data/` to a registry; a file that is in one is not added again.

    Raises
    ------
    InputError
        If the file is missing, is not below `data/`, or is registered with another sha256, or if a text holds a tab or
        line break.
    """
    try:
        name = path.relative_to("data").as_posix()
    except ValueError:
        raise InputError(f"{path}: inputs must be below data/; copy it there first") from None
    if not path.is_file():
        raise InputError(f"{path}: {absence_of(path)}")
    if not all(text.isprintable() for text in (name, origin, licence)):
        raise InputError(f"{str(path)!r}: a name, origin or licence with a tab or line break cannot be registered")
    entry = Entry(name, sha256_file(path), path.stat().st_size, origin, licence)
    with hold_lock(_lock_of(registry), None):
        _add_line(path, entry, registry)
    return entry


def _add_line(path: Path, entry: Entry, registry: Path) -> None:
    registered = read_registry().get(entry.name)
    if registered is not None and registered.sha256 != entry.sha256:
        raise InputError(
            f"{path}: registered with sha256 {registered.sha256}, the file has {entry.sha256}; remove that line first"
        )
    if registered is None:
        earlier = registry.read_bytes() if registry.is_file() else b""
        if earlier and not earlier.endswith(b"\n"):
            earlier += b"\n"
        line = [entry.name, entry.sha256, str(entry.bytes), entry.origin, entry.licence]
        write_atomically(registry, earlier + ("\t".join(line) + "\n").encode())


def _lock_of(registry: Path) -> Path:
    return registry.with_name(f".{registry.name}.lock")


def unregister(paths: list[Path]) -> None:
    """Remove files of your mines from their registry; those that are not in it are ignored."""
    names = {path.relative_to("data").as_posix() for path in paths}
    if not names or not OWN_REGISTRY.is_file():
        return
    with hold_lock(_lock_of(OWN_REGISTRY), None):
        lines = OWN_REGISTRY.read_text().splitlines(keepends=True)
        kept = [line for line in lines if line.split("\t")[0] not in names]
        if not kept:
            OWN_REGISTRY.unlink()
        elif kept != lines:
            write_atomically(OWN_REGISTRY, "".join(kept).encode())
