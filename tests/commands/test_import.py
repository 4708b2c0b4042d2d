"""What the import of a mine writes, and takes back where it cannot write all of it."""

import shutil
from pathlib import Path

import pytest

from pipeline.errors import ArtifactError
from pipeline.import_mine import draft_import, import_mine
from pipeline.params.stated import StatedOptions
from tests.project import ROOT, TINY_STATIONS


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Return a project into whose conf/survey nobody can write, as into a read-only conf/: it is no folder."""
    shutil.copytree(ROOT / "conf", tmp_path / "conf", ignore=shutil.ignore_patterns("survey"))
    (tmp_path / "conf/survey").touch()
    (tmp_path / "data").mkdir()
    (tmp_path / "data/registry.txt").write_text("# name\tsha256\n")
    (tmp_path / "own.csv").write_text(TINY_STATIONS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_mine_whose_configuration_cannot_be_written_leaves_no_file_and_no_folder(project, capsys, monkeypatch):
    monkeypatch.setattr("minesurveys.remarks._printed", set())  # a process prints a remark once
    before = {path for path in project.rglob("*") if path.parent != project / "conf"}
    with pytest.raises(ArtifactError, match=r"conf/survey/x\.yaml: cannot be written"):
        import_mine(draft_import("x", Path("own.csv"), StatedOptions()), "drawn", "CC0")
    assert {path for path in project.rglob("*") if path.parent != project / "conf"} == before
    assert (project / "data/registry.txt").read_text() == "# name\tsha256\n"
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "read as a station survey; conf/survey/x.yaml overrules it"
    assert said[1:] == [
        "the floor is dry, mud and water in thirds from west to east, as in the paper; realism.zones overrules it"
    ]


def test_what_the_import_has_not_made_stays(project):
    (project / "data/mines/x/later").mkdir(parents=True)
    with pytest.raises(ArtifactError):
        import_mine(draft_import("x", Path("own.csv"), StatedOptions()), "drawn", "CC0")
    assert [path.name for path in (project / "data/mines/x").iterdir()] == ["later"]
