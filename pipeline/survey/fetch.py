"""Download the real plan, poses and sweeps into `data/raw/` and check them against the registry (`make data`)."""

from __future__ import annotations

import argparse
import sys
import urllib.parse
from pathlib import Path

import pooch
import requests

from pipeline.errors import InputError, MineError
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
        If a file cannot be downloaded or differs from the registered one. A wrong file is not kept.
    """
    paths = []
    for name, entry in sorted(entries.items()):
        if not entry.origin.startswith("https://"):
            continue
        target = folder / name
        source = entry.origin if mirror is None else f"{mirror.rstrip('/')}/{urllib.parse.quote(target.name)}"
        local = Path(urllib.parse.unquote(source))
        try:
            if "://" not in source:
                pooch.hashes.hash_matches(str(local), f"sha256:{entry.sha256}", strict=True, source=str(local))
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(local.read_bytes())
            else:
                pooch.retrieve(
                    source,
                    f"sha256:{entry.sha256}",
                    fname=target.name,
                    path=target.parent,
                    downloader=pooch.HTTPDownloader(progressbar=sys.stderr.isatty(), timeout=60),
                )
        except ValueError as error:
            raise InputError(f"{source}: not the registered file ({entry.bytes} bytes): {error}") from error
        except (OSError, requests.RequestException) as error:
            raise InputError(f"{source}: cannot be fetched ({error})") from error
        paths.append(target)
    return paths


def main() -> int:
    """Download the files and list them. Return 2 with one message if a file cannot be downloaded."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.survey.fetch", description=__doc__)
    parser.add_argument("--mirror", help="address or folder that holds the files under their registered names")
    try:
        entries = read_registry()
        for path in fetch_raw(entries, Path("data"), parser.parse_args().mirror):
            print(f"{path}  {verify_input(path, entries)[:12]}  {path.stat().st_size} bytes", flush=True)
    except MineError as error:
        print(f"data: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    pooch.get_logger().setLevel("WARNING")
    sys.exit(main())
