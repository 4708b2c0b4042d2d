import runpy
import sys
import zipfile

import pytest

from tests.project import ROOT, Project


@pytest.fixture
def refusal(monkeypatch, capsys):
    """Return what builds the wheel of a project in this process and returns the message that refuses it."""

    def build(project: Project) -> str:
        monkeypatch.chdir(project.folder)
        assert runpy.run_path(str(ROOT / "packaging" / "build_wheel.py"))["main"]() == 2
        return capsys.readouterr().err.strip()

    return build


def test_the_wheel_holds_the_default_world(repro: Project, tmp_path):
    project = repro.copy(tmp_path / "mine")
    done = project.run("env", "PYTHONPATH=.", sys.executable, "packaging/build_wheel.py")
    assert done.returncode == 0, done.stderr
    (wheel,) = (project.folder / "dist").glob("minexplore-*.whl")
    packed = zipfile.ZipFile(wheel)
    record = packed.read("minexplore/worlds/chilean_mine/world.json")
    assert record == (project.folder / "artifacts" / "realism" / "world" / "world.json").read_bytes()


def test_a_world_made_with_overrides_is_not_packed(repro: Project, refusal, tmp_path):
    project = repro.copy(tmp_path / "mine")
    (project.folder / "params.yaml").write_text('overrides: "realism.tilt_deg=3"\n')
    project.module("pipeline.compose").check_returncode()
    message = refusal(project)
    assert "realism.tilt_deg = 3.0, the default world has 5.0" in message
    assert len(message.splitlines()) == 1
    assert not (project.folder / "dist").exists()


def test_a_world_that_another_chain_made_is_not_packed(repro: Project, refusal, tmp_path):
    project = repro.copy(tmp_path / "mine")
    project.stage("contours", "contours.tolerance_m=0.15").check_returncode()
    message = refusal(project)
    assert "made with other params than those in artifacts/params.json" in message
