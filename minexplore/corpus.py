"""A corpus: a folder or an address with the bundles of many worlds; one is fetched by its name and hash."""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import gymnasium
import pooch
import requests
from gymnasium.envs.registration import register
from tqdm import tqdm

from minexplore.bundle import RECORD, BundleError
from minexplore.schema.files import is_known
from minexplore.schema.sizes import most_bytes
from minexplore.world import World, load_world

PREFIX = "corpus:"
INDEX, WORLDS, BUNDLE = "corpus.json", "worlds", "world"
FORMAT = "minexplore-corpus/1"
SOURCE = "MINEXPLORE_CORPUS"  # environment variable with the folder or address of a corpus
_NAMESPACE = "MineXplore/corpus"
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}", re.ASCII)
_SHA256 = re.compile(r"[0-9a-f]{64}", re.ASCII)
_MOST_INDEX_BYTES, _MOST_WORLDS = 16 << 20, 10_000
_PIECE_BYTES, _TIMEOUT_S = 1 << 20, 60.0


@dataclass(frozen=True)
class Corpus:
    """Where a corpus is (a folder, or an address without a slash at its end), and the hash of each world's record."""

    source: str
    records: dict[str, str]

    def load(self, name: str) -> World:
        """Fetch a world, check it as every world is checked, and register its environment.

        The environment's id is `MineXplore/corpus:NAME-v0`.

        Parameters
        ----------
        name : str

        Raises
        ------
        FileNotFoundError
            If the corpus has no world of this name; the message lists some of its names.
        BundleError
            If a file cannot be fetched, is larger than a world's may be, has another hash than the index or the world's
            record says, or the tables of `minexplore.schema` refuse the bundle.
        """
        if name not in self.records:
            known = ", ".join(sorted(self.records)[:10])
            raise FileNotFoundError(f"world = {PREFIX + name[:80]!r}: not in {self.source}, which has {known}, ...")
        folder = self._fetch(name) if _is_address(self.source) else Path(self.source, WORLDS, name, BUNDLE)
        found = _sha256_of(folder / RECORD)
        if found != self.records[name]:
            raise BundleError(f"{folder / RECORD}: sha256 {found[:12]}, {INDEX} says {self.records[name][:12]}")
        world = load_world(folder)
        _register(name, folder)
        return world

    def _fetch(self, name: str) -> Path:
        """Return the folder into which a world was fetched; what is there with the right hash is not fetched again."""
        folder = Path(pooch.os_cache("minexplore"), "corpus", self.records[name])
        address = f"{self.source}/{WORLDS}/{name}/{BUNDLE}"
        with requests.Session() as session:
            _retrieve(session, f"{address}/{RECORD}", folder / RECORD, self.records[name])
            files = _listed_files(folder / RECORD)
            for file, sha256 in tqdm(files.items(), desc=name, unit="file", disable=None, leave=False):
                _retrieve(session, f"{address}/{quote(file)}", folder / file, sha256)
        return folder


def open_corpus(source: str | Path | None = None, sha256: str | None = None) -> Corpus:
    """Read the index of a corpus.

    Parameters
    ----------
    source : str or Path, optional
        A folder, or an address that begins with http:// or https://. By default that of the environment variable
        MINEXPLORE_CORPUS, else `artifacts/corpus` of a source checkout.
    sha256 : str, optional
        Of `corpus.json`. It makes the whole corpus that which was published, as the index holds the hash of every
        world's record and the record that of every file.

    Raises
    ------
    FileNotFoundError
        If there is no corpus.
    BundleError
        If the index cannot be fetched, has another hash, or is no index.
    """
    place = str(source or os.environ.get(SOURCE) or Path(__file__).parents[1] / "artifacts" / "corpus").rstrip("/")
    text = _read_address(f"{place}/{INDEX}") if _is_address(place) else _read_file(Path(place, INDEX))
    found = hashlib.sha256(text).hexdigest()
    if sha256 is not None and found != sha256:
        raise BundleError(f"{place}/{INDEX}: sha256 {found[:12]}, want {sha256[:12]}")
    return Corpus(place, _read_index(f"{place}/{INDEX}", text))


def _read_index(path: str, text: bytes) -> dict[str, str]:
    try:
        index: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{path}: not JSON") from error
    if not isinstance(index, dict) or index.get("format") != FORMAT or not isinstance(index.get("worlds"), dict):
        raise BundleError(f"{path}: not the index of a corpus: want format {FORMAT!r} and worlds by name")
    if len(index["worlds"]) > _MOST_WORLDS:
        raise BundleError(f"{path}: {len(index['worlds'])} worlds, at most {_MOST_WORLDS}")
    records = {}
    for name, entry in index["worlds"].items():
        digest = entry.get("record_sha256") if isinstance(entry, dict) else None
        if not _NAME.fullmatch(name) or not isinstance(digest, str) or not _SHA256.fullmatch(digest):
            raise BundleError(f"{path}: worlds: {name[:80]!r}: want letters, digits, - and _, and a record_sha256")
        records[name] = digest
    return records


def _is_address(source: str) -> bool:
    return source.startswith(("http://", "https://"))


def _read_file(path: Path) -> bytes:
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no corpus; give source=, or {SOURCE}, a folder or an address")
    if path.stat().st_size > _MOST_INDEX_BYTES:
        raise BundleError(f"{path}: more than {_MOST_INDEX_BYTES} bytes")
    return path.read_bytes()


def _sha256_of(path: Path) -> str:
    if not path.is_file() or path.stat().st_size > most_bytes(RECORD):
        raise BundleError(f"{path}: missing or too large; the corpus is not whole")
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _read_address(address: str) -> bytes:
    parts: list[bytes] = []
    with requests.Session() as session:
        _stream(session, address, _MOST_INDEX_BYTES, parts.append)
    return b"".join(parts)


def _stream(session: requests.Session, address: str, most: int, take: Callable[[bytes], object]) -> None:
    """Hand over the bytes of an address in pieces; refuse more than `most`."""
    size = 0
    try:
        with session.get(address, stream=True, timeout=_TIMEOUT_S) as response:
            response.raise_for_status()
            for piece in response.iter_content(_PIECE_BYTES):
                size += len(piece)
                if size > most:
                    raise BundleError(f"{address}: more than {most} bytes")
                take(piece)
    except requests.RequestException as error:
        reason = f"HTTP {error.response.status_code}" if error.response is not None else type(error).__name__
        raise BundleError(f"{address}: cannot be fetched ({reason})") from error


def _retrieve(session: requests.Session, address: str, path: Path, sha256: str) -> None:
    """Fetch a file by pooch, which keeps only what has the hash."""

    def download(url: str, output: str, _: object) -> None:
        with Path(output).open("wb") as file:
            _stream(session, url, most_bytes(path.name), file.write)

    logger = pooch.get_logger()
    level = logger.level
    logger.setLevel("WARNING")  # it names every file
    try:
        pooch.retrieve(address, f"sha256:{sha256}", path.name, path.parent, downloader=download)
    except BundleError:
        raise
    except ValueError as error:
        raise BundleError(f"{address}: not the file of the corpus: want sha256 {sha256[:12]}") from error
    except OSError as error:
        raise BundleError(f"{path}: cannot be kept ({error.strerror})") from error
    finally:
        logger.setLevel(level)


def _listed_files(record: Path) -> dict[str, str]:
    """Return the hash of each file that a record lists; a name that no bundle has is refused before it is fetched."""
    try:
        files: Any = json.loads(record.read_bytes()).get("files")
    except (ValueError, RecursionError, AttributeError) as error:
        raise BundleError(f"{record}: not the record of a world") from error
    if not isinstance(files, dict):
        raise BundleError(f"{record}: files: want the hash of each file")
    for name, digest in files.items():
        if not is_known(name) or not isinstance(digest, str) or not _SHA256.fullmatch(digest):
            raise BundleError(f"{record}: files: {name[:80]!r}: no file of a world has this name or hash")
    return files


def _register(name: str, folder: Path) -> None:
    """Register the environment of a world so that `gymnasium.make("MineXplore/corpus:NAME-v0")` finds it.

    Gymnasium imports what stands before a colon as a module and looks up the rest, so that a module of that name
    exists, and the rest is an id of its own.
    """
    from minexplore import ENTRY_POINT, VECTOR_ENTRY_POINT

    sys.modules.setdefault(_NAMESPACE, types.ModuleType(_NAMESPACE))
    short = f"{name}-v0"
    other = gymnasium.registry.get(short)
    if other is not None and other.entry_point != ENTRY_POINT:
        raise BundleError(f"{_NAMESPACE}:{short}: another package has registered {short!r}")
    for env_id in (f"{_NAMESPACE}:{short}", short):
        gymnasium.registry.pop(env_id, None)
        register(
            env_id,
            ENTRY_POINT,
            vector_entry_point=VECTOR_ENTRY_POINT,
            kwargs={"world": str(folder)},
            order_enforce=True,
        )
