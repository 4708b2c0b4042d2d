"""Download the real plan, poses and sweeps into `data/raw/` and check them against the registry (`make data`)."""

from __future__ import annotations

import argparse
import hashlib
import sys
import urllib.parse
from pathlib import Path

import requests

from minesurveys.errors import InputError, describe_os_error
from minexplore.bundle import BundleError
from minexplore.extra.download import Transfer, keep_file
from minexplore.limits import UnreadableError, read_plain_file
from pipeline.errors import run_command
from pipeline.store.registry import Entry, read_registry, verify_input


def fetch_raw(entries: dict[str, Entry], folder: Path, mirror: str | None = None) -> list[Path]:
    """Download every registered file whose origin is an https address.

    Parameters
    ----------
    entries : dict
        The registry. Entries without an https origin are skipped.
    folder : Path
        The data folder.
    mirror : str, optional
        An http(s) address or a folder that holds the files under their registered names. It replaces the origins.

    Returns
    -------
    list of Path
        The path of every such file. A file with the right hash is not downloaded again.

    Raises
    ------
    InputError
        If a file cannot be downloaded, comes too slowly, or differs from the registered one. A wrong file is not kept.
    """
    paths = []
    with requests.Session() as session:
        for name, entry in sorted(entries.items()):
            if not entry.origin.startswith("https://"):
                continue
            target = folder / name
            source = entry.origin if mirror is None else f"{mirror.rstrip('/')}/{urllib.parse.quote(target.name)}"
            if "://" in source:
                _download(session, source, target, entry)
            else:
                _copy(Path(mirror or "", target.name), target, entry)
            paths.append(target)
    return paths


def _download(session: requests.Session, source: str, target: Path, entry: Entry) -> None:
    try:
        keep_file(session, source, target, entry.sha256, entry.bytes, Transfer(), "the registered file")
    except BundleError as error:
        raise InputError(str(error)) from error


def _copy(source: Path, target: Path, entry: Entry) -> None:
    try:
        data = read_plain_file(source, entry.bytes)
        target.parent.mkdir(parents=True, exist_ok=True)
        if hashlib.sha256(data).hexdigest() != entry.sha256:
            raise InputError(f"{source}: not the registered file: want sha256 {entry.sha256[:12]}")
        target.write_bytes(data)
    except UnreadableError as error:
        raise InputError(f"{source}: not the registered file: {error}") from error
    except OSError as error:
        raise InputError(describe_os_error(error)) from error


def main() -> int:
    """Download the files and list them; return the exit code."""
    return run_command("data", _fetch)


def _fetch() -> None:
    parser = argparse.ArgumentParser(prog="python -m pipeline.survey.fetch", description=__doc__)
    parser.add_argument("--mirror", help="address or folder that holds the files under their registered names")
    entries = read_registry()
    for path in fetch_raw(entries, Path("data"), parser.parse_args().mirror):
        print(f"{path}  {verify_input(path, entries)[:12]}  {path.stat().st_size} bytes", flush=True)


if __name__ == "__main__":
    sys.exit(main())
