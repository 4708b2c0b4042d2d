"""Worlds of a corpus, from a folder and from an address: fetched by name, refused by a wrong hash or name."""

import functools
import hashlib
import http.server
import json
import os
import shutil
import threading
from pathlib import Path

import gymnasium
import pytest

import minexplore
from minexplore.bundle import MADE_BY, RECORD, BundleError
from minexplore.extra import corpus
from minexplore.extra.corpus import FORMAT, open_corpus
from tests.mines import BuiltMine

NAME = "a-T"


def write_index(folder: Path, **worlds: str) -> None:
    index = {"format": FORMAT, "worlds": {name: {"record_sha256": digest} for name, digest in worlds.items()}}
    (folder / "corpus.json").write_text(json.dumps(index))


@pytest.fixture
def folder(tmp_path, tee: BuiltMine, monkeypatch):
    """Return a corpus of one world."""
    monkeypatch.setattr(corpus.pooch, "os_cache", lambda name: tmp_path / "cache")
    place = tmp_path / "corpus"
    bundle = place / "worlds" / NAME / "world"
    shutil.copytree(tee.bundle, bundle)
    write_index(place, **{NAME: hashlib.sha256((bundle / RECORD).read_bytes()).hexdigest()})
    return place


@pytest.fixture
def served(folder):
    """Return the address of a server with that corpus, and the paths that were asked of it."""
    asked = []

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *args):
            asked.append(self.path)

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", asked
    server.shutdown()
    server.server_close()


def drive(env_id):
    env = gymnasium.make(env_id)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    record = env.unwrapped.robots.world.record
    env.close()
    return record["world_sha256"]


def test_a_world_of_a_folder_is_read_where_it_is_and_has_an_id(folder, tee: BuiltMine):
    world = minexplore.load(f"corpus:{NAME}", folder)
    assert world.folder == folder / "worlds" / NAME / "world"
    assert drive(f"MineXplore/corpus:{NAME}-v0") == world.record["world_sha256"]
    assert drive(f"MineXplore/corpus:GoTo-{NAME}-v0") == world.record["world_sha256"]
    assert json.loads(gymnasium.spec(f"{NAME}-v0").to_json())["kwargs"] == {"world": str(world.folder)}


def test_a_world_of_an_address_is_fetched_once_and_is_the_same(served, folder, tmp_path):
    address, asked = served
    world = minexplore.load(f"corpus:{NAME}", f"{address}/")
    assert tmp_path / "cache" in world.folder.parents
    assert drive(f"MineXplore/corpus:{NAME}-v0") == world.record["world_sha256"]
    fetched = len(asked)
    assert fetched == 2 + len(world.record["files"])
    minexplore.load(f"corpus:{NAME}", address)
    assert asked[fetched:] == ["/corpus.json"]


def test_the_source_is_taken_from_the_environment(folder, monkeypatch):
    monkeypatch.setenv("MINEXPLORE_CORPUS", str(folder))
    assert minexplore.load(f"corpus:{NAME}").folder.is_relative_to(folder)


def test_a_file_that_was_changed_is_refused_from_folder_and_address_and_not_kept(served, folder, tmp_path):
    path = folder / "worlds" / NAME / "world" / "mine.xml"
    path.write_bytes(path.read_bytes() + b" ")
    for source in (folder, served[0]):
        with pytest.raises(BundleError, match=r"mine\.xml"):
            minexplore.load(f"corpus:{NAME}", source)
    assert not list((tmp_path / "cache").rglob("mine.xml"))


def test_a_record_of_another_hash_than_the_index_says_is_refused(served, folder):
    write_index(folder, **{NAME: "0" * 64})
    for source in (folder, served[0]):
        with pytest.raises(BundleError, match=r"world\.json: .*(sha256|want sha256)"):
            minexplore.load(f"corpus:{NAME}", source)


def test_an_index_of_another_hash_than_the_caller_says_is_refused(folder):
    digest = hashlib.sha256((folder / "corpus.json").read_bytes()).hexdigest()
    assert minexplore.load(f"corpus:{NAME}", folder, digest)
    with pytest.raises(BundleError, match=r"corpus\.json: sha256 .*, want 000"):
        minexplore.load(f"corpus:{NAME}", folder, "0" * 64)


@pytest.mark.parametrize("name", ["../x", "x/y", "x y", "", "x" * 65, "x\n"])
def test_a_name_that_would_leave_the_folder_is_refused(folder, name):
    write_index(folder, **{name: "0" * 64})
    with pytest.raises(BundleError, match="letters, digits"):
        open_corpus(folder)


def test_a_record_that_lists_a_file_outside_the_bundle_fetches_nothing(served, folder, tmp_path):
    record = folder / "worlds" / NAME / "world" / RECORD
    record.write_text(json.dumps({"files": {"../../../stolen": "0" * 64}}))
    write_index(folder, **{NAME: hashlib.sha256(record.read_bytes()).hexdigest()})
    with pytest.raises(BundleError, match="no file of a world has this name"):
        minexplore.load(f"corpus:{NAME}", served[0])
    assert not list(tmp_path.rglob("stolen"))


def test_all_files_of_a_world_together_are_no_larger_than_a_world_may_be(served, folder, monkeypatch):
    record = (folder / "worlds" / NAME / "world" / RECORD).stat().st_size
    monkeypatch.setattr(corpus, "MOST_BUNDLE_BYTES", record + 1000)
    with pytest.raises(BundleError, match="more than 1000 bytes"):
        minexplore.load(f"corpus:{NAME}", served[0])


def test_an_index_of_too_many_values_is_refused_before_it_is_read(folder):
    (folder / "corpus.json").write_text("[" + "0," * 1_000_000 + "0]")
    with pytest.raises(BundleError, match=r"more than 200,000 values"):
        open_corpus(folder)


@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_what_is_no_plain_file_is_no_index(folder, kind):
    place = folder / "corpus.json"
    place.unlink()
    {"pipe": os.mkfifo, "folder": os.mkdir, "device": lambda path: path.symlink_to("/dev/zero")}[kind](place)
    with pytest.raises((FileNotFoundError, BundleError)):
        open_corpus(folder)


def test_a_file_that_does_not_end_is_cut_off(served, folder, monkeypatch):
    monkeypatch.setattr(corpus, "most_bytes", lambda name: 1000)
    with pytest.raises(BundleError, match="more than 1000 bytes"):
        minexplore.load(f"corpus:{NAME}", served[0])


@pytest.mark.parametrize("text", ["", "[]", '{"format": "other/1", "worlds": {}}', "[" * 100_000])
def test_what_is_no_index_is_refused(folder, text):
    (folder / "corpus.json").write_text(text)
    with pytest.raises(BundleError, match=r"corpus\.json: not"):
        open_corpus(folder)


def test_an_address_or_folder_without_a_corpus_and_an_unknown_name_are_named(served, folder, tmp_path):
    with pytest.raises(FileNotFoundError, match="MINEXPLORE_CORPUS"):
        open_corpus(tmp_path / "nothing")
    with pytest.raises(BundleError, match="HTTP 404"):
        open_corpus(f"{served[0]}/nothing")
    with pytest.raises(BundleError, match="cannot be fetched"):
        open_corpus("http://127.0.0.1:9")
    with pytest.raises(FileNotFoundError, match=f"corpus:other.*{NAME}"):
        minexplore.load("corpus:other", folder)


def test_an_id_of_another_package_is_not_replaced(folder):
    record = folder / "worlds" / NAME / "world"
    shutil.copytree(record, folder / "worlds" / "CartPole" / "world")
    write_index(folder, CartPole=hashlib.sha256((record / RECORD).read_bytes()).hexdigest())
    with pytest.raises(BundleError, match="another package"):
        minexplore.load("corpus:CartPole", folder)


def test_a_name_that_is_no_corpus_is_a_shipped_world_or_a_folder(tee: BuiltMine):
    assert minexplore.load(tee.bundle).folder == tee.bundle


def test_a_volume_of_an_address_is_fetched_with_all_its_files(served, folder, ramp):
    address, _ = served
    shutil.copytree(ramp, folder / "worlds" / "deep" / "world")
    write_index(folder, deep=hashlib.sha256((ramp / RECORD).read_bytes()).hexdigest())
    world = minexplore.load("corpus:deep", address)
    assert world.volume is not None
    assert {path.name for path in world.folder.iterdir()} == {path.name for path in ramp.iterdir()} - {MADE_BY}
    assert drive("MineXplore/corpus:deep-v0") == world.record["world_sha256"]
