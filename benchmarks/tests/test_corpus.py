"""The corpus of a few worlds: what it holds, what describes it, and that it loads by name."""

import json
import os
import shutil
from datetime import date

import gymnasium
import pytest

import minexplore
from benchmarks.corpus.members import CASES, DEFAULT, CorpusMember, copy_evidence, generated, with_heights
from benchmarks.corpus.metadata import read_entry, write_metadata
from minexplore.splits import STYLES
from pipeline.errors import ArtifactError
from pipeline.store.hashing import sha256_bytes
from tests.mines import BuiltMine

A_TEE = CorpusMember("tee", "surveyed", "A T.", "MIT", "nobody, and 1 more")
SAME = CorpusMember("same", "cave", "The T again.", "Apache-2.0", "this project")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory, tee: BuiltMine):
    """Return a corpus of one world under two names, and its entries."""
    folder = tmp_path_factory.mktemp("corpus")
    for member in (A_TEE, SAME):
        place = folder / "worlds" / member.name
        shutil.copytree(tee.bundle, place / "world")
        (place / "certificate.json").write_text('{"holds": true}')
    entries = [read_entry(folder, member) for member in (A_TEE, SAME)]
    write_metadata(folder, entries, date(2026, 11, 26))
    return folder, entries


def test_a_world_loads_by_the_hash_that_the_card_states(corpus):
    folder, entries = corpus
    digest = sha256_bytes((folder / "corpus.json").read_bytes())
    assert digest in (folder / "README.md").read_text()
    world = minexplore.load("corpus:tee", folder, digest)
    assert world.record["world_sha256"] == entries[0].record["world_sha256"]
    assert gymnasium.spec("MineXplore/corpus:tee-v0").kwargs["world"] == str(world.folder)


def test_croissant_reads_the_table_of_worlds(corpus):
    folder, entries = corpus
    import mlcroissant  # takes half a second to load, in each worker

    dataset = mlcroissant.Dataset(folder / "croissant.json")
    assert not dataset.metadata.ctx.issues.errors
    assert not dataset.metadata.ctx.issues.warnings
    rows = list(dataset.records("worlds"))
    assert [row["worlds/name"] for row in rows] == [b"tee", b"same"]
    assert rows[0]["worlds/world_sha256"].decode() == entries[0].record["world_sha256"]
    assert rows[0]["worlds/bytes"] == entries[0].size
    assert rows[0]["worlds/certificate"] is True


@pytest.mark.parametrize("name", ["README.md", "corpus.json", "worlds.csv", "croissant.json"])
def test_a_file_of_the_user_with_a_name_of_the_corpus_is_kept_and_named(corpus, tmp_path, name):
    folder = shutil.copytree(corpus[0], tmp_path / "corpus")
    write_metadata(folder, corpus[1], date(2026, 11, 27))  # our own are replaced
    (folder / name).write_text("mine")
    with pytest.raises(ArtifactError, match=rf"{name}: is not as written\.json lists it; move it away"):
        write_metadata(folder, corpus[1], date(2026, 11, 26))
    assert (folder / name).read_text() == "mine"


def test_a_description_that_was_written_in_part_is_written_again(corpus, tmp_path, monkeypatch):
    folder = shutil.copytree(corpus[0], tmp_path / "corpus")
    whole = {path.name: path.read_bytes() for path in folder.glob("*.*")}
    real, calls = os.fsync, []

    def stop(descriptor):
        calls.append(descriptor)
        if len(calls) == 5:
            raise KeyboardInterrupt
        real(descriptor)

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", stop)
        with pytest.raises(KeyboardInterrupt):
            write_metadata(folder, corpus[1], date(2026, 11, 27))
    write_metadata(folder, corpus[1], date(2026, 11, 26))
    again = {path.name: path.read_bytes() for path in folder.glob("*.*")}
    del again["written.json"], whole["written.json"]
    assert again == whole


def test_a_folder_at_the_place_of_a_world_is_kept_and_an_unfinished_world_is_not_copied(tmp_path, tee: BuiltMine):
    built, target = tmp_path / "built", tmp_path / "corpus" / "worlds" / "tee"
    shutil.copytree(tee.bundle, built / "realism" / "world")
    with pytest.raises(ArtifactError, match=r"built: unfinished; `.*` ends it"):
        copy_evidence(built, target)
    validation = built / "validation"
    validation.mkdir()
    digest = sha256_bytes((built / "realism/world/world.json").read_bytes())
    manifest = {"stage": "validation", "inputs": {"artifacts/realism/world/world.json": digest}}
    (validation / "manifest.json").write_text(json.dumps(manifest))
    target.mkdir(parents=True)
    (target / "thesis.txt").write_text("mine")
    with pytest.raises(ArtifactError, match="tee: is no whole world of a corpus; move it away"):
        copy_evidence(built, target)
    assert [path.name for path in target.iterdir()] == ["thesis.txt"]
    assert [path.name for path in target.parent.iterdir()] == ["tee"]


def test_the_members_are_the_surveyed_mines_twenty_of_each_style_and_twenty_with_heights():
    members = [DEFAULT, *CASES, *generated(20), *with_heights(20)]
    kinds = [member.kind for member in members]
    assert len({member.name for member in members}) == len(members) == 102
    assert all(kinds.count(style) == 20 for style in STYLES)
    assert sum(member.name.startswith("heights-") for member in members) == 20
