import sys
import zipfile

from tests.project import Project, message_of


def build(project: Project):
    return project.run("env", "PYTHONPATH=.", sys.executable, "packaging/build_wheel.py")


def test_the_wheel_holds_the_default_world(repro: Project, tmp_path):
    project = repro.copy(tmp_path / "mine")
    done = build(project)
    assert done.returncode == 0, done.stderr
    (wheel,) = (project.folder / "dist").glob("minexplore-*.whl")
    packed = zipfile.ZipFile(wheel)
    record = packed.read("minexplore/worlds/chilean_mine/world.json")
    assert record == (project.folder / "artifacts" / "realism" / "world" / "world.json").read_bytes()


def test_a_world_made_with_overrides_is_not_packed(repro: Project, tmp_path):
    project = repro.copy(tmp_path / "mine")
    (project.folder / "params.yaml").write_text('overrides: "realism.tilt_deg=3"\n')
    project.module("pipeline.compose").check_returncode()
    message = message_of(build(project))
    assert "realism.tilt_deg = 3.0, the default world has 5.0" in message
    assert len(message.splitlines()) == 1
    assert not (project.folder / "dist").exists()


def test_a_world_that_another_chain_made_is_not_packed(repro: Project, tmp_path):
    project = repro.copy(tmp_path / "mine")
    project.stage("contours", "contours.tolerance_m=0.15").check_returncode()
    message = message_of(build(project))
    assert "made with other params than those in artifacts/params.yaml" in message
