"""A corpus: a folder or an address with the bundles of many worlds; one is fetched by its name and hash."""

from __future__ import annotations

import hashlib
import os
import re
import sys
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import gymnasium
import pooch
import requests
from tqdm import tqdm

from minexplore.bundle import RECORD, BundleError
from minexplore.extra.download import Transfer, keep_file, read_address
from minexplore.limits import UnreadableError, read_plain_file
from minexplore.sealed.files import is_known
from minexplore.sealed.json_text import read_json
from minexplore.sealed.sizes import MOST_BUNDLE_BYTES, most_bytes
from minexplore.world import World, load_world

PREFIX = "corpus:"
INDEX, WORLDS, BUNDLE = "corpus.json", "worlds", "world"
FORMAT = "minexplore-corpus/1"
SOURCE = "MINEXPLORE_CORPUS"  # environment variable with the folder or address of a corpus
_NAMESPACE = "MineXplore/corpus"
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}", re.ASCII)
_SHA256 = re.compile(r"[0-9a-f]{64}", re.ASCII)
_MOST_INDEX_BYTES, _MOST_WORLDS = 16 << 20, 10_000
_MOST_INDEX_VALUES = 20 * _MOST_WORLDS  # commas, brackets and keys; an entry of this project's corpus has 6 keys


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
            If a file cannot be fetched or comes too slowly, is larger than a world's may be, has another hash than the
            index or the world's record says, or the bundle is none that `minexplore.sealed` opens.
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
        transfer, left = Transfer(), MOST_BUNDLE_BYTES
        with requests.Session() as session:

            def keep(file: str, sha256: str) -> int:
                most, path = min(left, most_bytes(file)), folder / file
                keep_file(session, f"{address}/{quote(file)}", path, sha256, most, transfer, "the file of the corpus")
                return path.stat().st_size

            left -= keep(RECORD, self.records[name])
            files = _listed_files(folder / RECORD)
            for file, sha256 in tqdm(files.items(), desc=name, unit="file", disable=None, leave=False):
                left -= keep(file, sha256)
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
    place = str(source or os.environ.get(SOURCE) or Path(__file__).parents[2] / "artifacts" / "corpus").rstrip("/")
    if _is_address(place):
        text = read_address(f"{place}/{INDEX}", _MOST_INDEX_BYTES, Transfer())
    else:
        text = _read_file(Path(place, INDEX))
    found = hashlib.sha256(text).hexdigest()
    if sha256 is not None and found != sha256:
        raise BundleError(f"{place}/{INDEX}: sha256 {found[:12]}, want {sha256[:12]}")
    return Corpus(place, _read_index(f"{place}/{INDEX}", text))


def _read_index(path: str, text: bytes) -> dict[str, str]:
    index: Any = read_json(path, text, _MOST_INDEX_BYTES, _MOST_INDEX_VALUES)
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
    return _read_plain(path, _MOST_INDEX_BYTES)


def _read_plain(path: Path, most: int) -> bytes:
    try:
        return read_plain_file(path, most)
    except UnreadableError as error:
        raise BundleError(f"{path}: {error}") from error


def _sha256_of(path: Path) -> str:
    return hashlib.sha256(_read_plain(path, most_bytes(RECORD))).hexdigest()


def _listed_files(record: Path) -> dict[str, str]:
    """Return the hash of each file that a record lists; a name that no bundle has is refused before it is fetched."""
    content: Any = read_json(str(record), _read_plain(record, most_bytes(RECORD)))
    files = content.get("files") if isinstance(content, dict) else None
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
    from minexplore import ENTRY_POINT, register_env

    sys.modules.setdefault(_NAMESPACE, types.ModuleType(_NAMESPACE))
    short = f"{name}-v0"
    other = gymnasium.registry.get(short)
    if other is not None and other.entry_point != ENTRY_POINT:
        raise BundleError(f"{_NAMESPACE}:{short}: another package has registered {short!r}")
    for env_id in (f"{_NAMESPACE}:{short}", short):
        gymnasium.registry.pop(env_id, None)
        gymnasium.registry.pop(env_id.replace(short, f"GoTo-{short}"), None)
        register_env(env_id, {"world": str(folder)})
