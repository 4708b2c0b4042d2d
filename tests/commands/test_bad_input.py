"""Bad input on the command line: exit code 2, one message, and unchanged artifacts."""

import json
import os
import shutil
import signal
import subprocess
import sys

import cv2
import numpy as np
import pytest

from baselines.base.errors import run_command as run_baseline
from pipeline.errors import run_command
from pipeline.store.locks import hold_lock
from tests.project import ROOT, TINY_STATIONS, message_of

METRICS = "validation/metrics.json"


@pytest.mark.parametrize(
    ("stage", "override", "message"),
    [
        ("contours", "contours.tolerance_m=-1", "contours.tolerance_m = -1"),
        ("contours", "contours.tolerance_m=12", "contours.tolerance_m = 12"),
        ("contours", "contours.threshold=254 contours.max_workings_share=0.01", "is the plan inverted?"),
        ("contours", "contours.min_tunnel_m2=5000", "no dark region larger than 5000 m2"),
        ("survey", "survey.stations=data/chilean_mine/none.csv", "none.csv: not in data/registry.txt"),
        ("survey", "survey=plan", "data/raw/plan.jpg: missing; fetch it with `make data`"),
        ("survey", "survey.px_per_m=99 survey.margin_m=500", "at most 64000000"),
        ("compile3d", "compile3d.spawn.clearance_m=9", "nothing is 9 m from rock"),
        ("compile3d", "compile3d.spawn.clearance_m=0.2", "less than the robot's radius of 0.35 m"),
        ("surface", "surface.roof_chamfer_m=3.4", "do not fit into 3.5 m"),
        ("realism", "", "compile3d/"),
    ],
)
def test_bad_input_ends_with_one_message_and_keeps_the_artifacts(traced_project, stage, override, message):
    if stage == "surface":
        traced_project.stage("compile3d").check_returncode()
    before = traced_project.hashes()
    text = message_of(traced_project.stage(stage, *override.split()))
    assert message in text
    if stage == "surface":
        shutil.rmtree(traced_project.folder / "artifacts/compile3d")
        before = {k: v for k, v in before.items() if not k.startswith("compile3d")}
    assert traced_project.hashes() == before


def test_a_changed_input_is_refused_with_both_hashes(project):
    project.stages("survey")
    before = project.hashes()
    path = project.folder / "data/chilean_mine/tiny.csv"
    path.write_text(TINY_STATIONS + " \n")
    text = message_of(project.stage("survey"))
    assert "data/chilean_mine/tiny.csv: sha256" in text
    assert "is not the registered" in text
    assert project.hashes() == before


def test_a_survey_with_a_fault_names_file_line_and_value(project):
    project.use_stations(TINY_STATIONS.replace("A,a1,10,0,2.5,2.5", "A,a1,10,0,-2.5,2.5"))
    project.module("pipeline.compose").check_returncode()
    assert "data/chilean_mine/tiny.csv:3: left_m = -2.5" in message_of(project.stage("survey"))
    assert not (project.folder / "artifacts/survey").exists()


def plan_project(project, picture, *overrides):
    """Make `picture` the plan of a project, run the survey stage and return its result."""
    path = project.folder / "data/plan.png"
    path.write_bytes(picture if isinstance(picture, bytes) else cv2.imencode(".png", picture)[1].tobytes())
    project.module("pipeline", "register", "data/plan.png").check_returncode()
    base = ["survey=plan", "survey.image=data/plan.png", "survey.poses=null", "survey.scale.bar_image=null"]
    base += ["survey.origin_px=null", "survey.entrance_m=null"]
    (project.folder / "params.yaml").write_text(json.dumps({"overrides": " ".join([*base, *overrides])}))
    done = project.module("pipeline.compose")
    return done if done.returncode else project.stage("survey")


def drift_picture():
    picture = np.full((160, 900, 3), 255, np.uint8)
    picture[60:100, 20:880] = 30
    picture[140:146, 40:240] = 0  # a bar of 200 px
    return picture


def test_a_scale_bar_in_a_box_is_measured_and_is_not_a_drift(project):
    done = plan_project(
        project, drift_picture(), "survey.scale.bar_box_px=[30,130,260,156]", "survey.scale.bar_length_m=25"
    )
    assert done.returncode == 0, done.stderr
    survey = json.loads((project.folder / "artifacts/survey/mine/survey.json").read_text())
    assert survey["frame"]["px_per_m"] == 8.0
    project.stage("contours").check_returncode()
    facts = json.loads((project.folder / "artifacts/contours/free_space.geojson").read_text())
    assert facts["features"][0]["properties"]["areas"]["tunnel_m2"] == pytest.approx(860 * 40 / 64, rel=0.002)


@pytest.mark.parametrize(
    ("picture", "overrides", "message"),
    [
        (b"", (), "data/plan.png: empty file"),
        (b"GIF89a nonsense", (), "data/plan.png: not a picture that can be read"),
        (np.zeros((99, 99, 3), np.uint8), (), "data/plan.png: the image is all black"),
        (np.full((99, 99, 3), 255, np.uint8), (), "data/plan.png: the image is all white"),
        (drift_picture(), ("survey.scale.bar_box_px=null",), "no bar to measure"),
        (drift_picture(), ("survey.scale.bar_box_px=[0,0,2000,10]",), "not inside the picture of 900 x 160 px"),
        (drift_picture(), ("survey.scale.bar_box_px=[400,5,600,40]",), "no scale bar"),
        (drift_picture(), ("survey.scale.bar_box_px=[45,130,50,156]",), "lie horizontally"),
    ],
    ids=["empty", "nonsense", "black", "white", "no-bar", "outside", "absent", "cut"],
)
def test_a_plan_or_bar_that_cannot_be_used_is_refused(project, picture, overrides, message):
    assert message in message_of(plan_project(project, picture, *overrides))
    assert not (project.folder / "artifacts/survey").exists()


def test_an_inverted_plan_is_refused_by_name(project):
    done = plan_project(project, 255 - drift_picture(), "survey.scale.source=stated", "survey.scale.px_per_m=8")
    assert done.returncode == 0, done.stderr
    text = message_of(project.stage("contours"))
    assert "data/plan.png" in text
    assert "is the plan inverted?" in text


def test_a_full_disk_is_reported_and_the_artifacts_are_kept(traced_project, tmp_path):
    project = traced_project.copy(tmp_path / "copy")
    folder = project.folder
    before = project.hashes()
    # A limit on file size replaces a disk that fills while the stage writes.
    (folder / "filled.py").write_text(
        "import resource, sys\n"
        "from pipeline.stage import main\n"
        "from stages.contours import STAGE\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        "sys.exit(main(STAGE))\n"
    )
    assert "cannot be written" in message_of(project.module("filled"))
    assert project.hashes() == before
    assert not list((folder / "artifacts").glob(".*partial"))


def test_a_killed_stage_keeps_the_old_artifacts_and_the_next_run_recovers(traced_project, tmp_path):
    project = traced_project.copy(tmp_path / "copy")
    folder = project.folder
    before = project.hashes()
    # Kill the stage while it writes the third file, then between the two renames that replace the folder.
    for moment in ("os.fsync", "pathlib.Path.rename"):
        script = (
            "import os, pathlib, signal\n"
            f"real, calls = {moment}, []\n"
            "def kill(*args):\n"
            "    calls.append(1)\n"
            f"    if len(calls) == {3 if moment == 'os.fsync' else 2}: os.kill(os.getpid(), signal.SIGKILL)\n"
            "    return real(*args)\n"
            f"{moment} = kill\n"
            "from pipeline.stage import run_stage\n"
            "from stages.contours import STAGE\n"
            "run_stage(STAGE, ['contours.tolerance_m=0.3'])\n"
        )
        (folder / "killed.py").write_text(script)
        killed = project.module("killed")
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        left = {p.name for p in (folder / "artifacts").iterdir() if p.name.startswith(".contours")}
        assert left == {".contours.partial", ".contours.lock"}  # the kernel has freed the lock
        # A refused run restores the earlier artifacts and changes nothing else.
        message_of(project.stage("contours", "contours.min_tunnel_m2=5000"))
        assert project.hashes() == before
    project.stage("contours", "contours.tolerance_m=0.3").check_returncode()
    assert not [p for p in (folder / "artifacts").iterdir() if p.name.startswith(".contours")]
    assert json.loads((folder / "artifacts/contours/manifest.json").read_text())["params"]["tolerance_m"] == 0.3


def test_a_breached_limit_fails_the_stage_and_names_metric_value_and_limit(repro, tmp_path):
    project = repro.copy(tmp_path / "copy")
    overrides = ("validation.limits.collision.parts.max=2", "validation.extent=certificate")
    text = message_of(project.stage("validation", *overrides))
    assert "collision.parts = " in text
    assert "limit <= 2" in text


@pytest.fixture
def copied(traced_project, tmp_path):
    """Return a private copy of the project whose first two stages have run."""
    return traced_project.copy(tmp_path / "copy")


def test_stations_outside_a_stated_frame_are_refused(traced_project):
    text = message_of(traced_project.stage("survey", "survey.frame_m=[-20,-20,40,40]"))
    assert "beyond survey.frame_m = [-20.0, -20.0, 40.0, 40.0]" in text


def test_a_dark_region_that_is_not_connected_is_reported_and_measured(project):
    picture = drift_picture()
    picture[20:40, 600:700] = 30
    options = ("survey.scale.bar_box_px=[30,130,260,156]", "survey.scale.bar_length_m=25")
    assert plan_project(project, picture, *options).returncode == 0
    done = project.stage("contours")
    assert done.returncode == 0
    assert "31.2 m2 in 1 drawn pieces are connected to nothing" in done.stderr
    facts = json.loads((project.folder / "artifacts/contours/free_space.geojson").read_text())
    assert facts["features"][0]["properties"]["areas"]["unconnected_m2"] == pytest.approx(20 * 100 / 64)


def test_transparent_pixels_of_a_plan_are_white_paper(project):
    opaque = drift_picture()
    alpha = np.where(opaque.min(axis=2) < 255, 255, 0).astype(np.uint8)
    clear = np.dstack([np.where(alpha[..., None] > 0, opaque, 0), alpha])
    options = ("survey.scale.bar_box_px=[30,130,260,156]", "survey.scale.bar_length_m=25")
    assert plan_project(project, clear, *options).returncode == 0
    project.stage("contours").check_returncode()
    facts = json.loads((project.folder / "artifacts/contours/free_space.geojson").read_text())
    assert facts["features"][0]["properties"]["areas"]["tunnel_m2"] == pytest.approx(860 * 40 / 64, rel=0.002)


def set_overrides(project, overrides):
    return project.module("pipeline", "set-overrides", OVERRIDES=overrides)


@pytest.mark.parametrize("overrides", ["contours.tolerance_m=-1", "'"])
def test_make_refuses_wrong_overrides_and_keeps_those_in_params_yaml(traced_project, overrides):
    before = (traced_project.folder / "params.yaml").read_bytes()
    assert overrides.partition("=")[0] in message_of(set_overrides(traced_project, overrides))
    assert (traced_project.folder / "params.yaml").read_bytes() == before


def test_make_without_overrides_clears_wrong_ones(copied):
    (copied.folder / "params.yaml").write_text('overrides: "contours.tolerance_m=-1"\n')
    set_overrides(copied, "").check_returncode()
    assert (copied.folder / "params.yaml").read_text() == 'overrides: ""\n'


def test_make_composes_again_after_the_section_of_an_own_mine_was_edited(copied):
    own = copied.folder / "conf/survey/own.yaml"
    own.write_text((copied.folder / "conf/survey/procedural.yaml").read_text())
    (copied.folder / "params.yaml").write_text('overrides: "survey=own"\n')
    composed = copied.folder / "artifacts/params.json"
    copied.module("pipeline.compose").check_returncode()
    set_overrides(copied, "survey=own").check_returncode()
    assert composed.is_file()
    own.write_text(own.read_text().replace("seed: 0", "seed: 1"))
    set_overrides(copied, "survey=own").check_returncode()
    assert not composed.is_file()  # DVC composes again, as an output is missing


def test_an_error_by_an_override_in_params_yaml_names_that_file_and_the_key(copied):
    (copied.folder / "params.yaml").write_text('overrides: "contours.tolerance_m=-1"\n')
    for done in (copied.module("pipeline.compose"), copied.stage("survey", "survey.drawing_grey=60")):
        assert "params.yaml: contours.tolerance_m = -1: " in message_of(done)


def test_an_error_by_an_override_on_the_command_line_does_not_blame_params_yaml(copied):
    (copied.folder / "params.yaml").write_text('overrides: "contours.tolerance_m=0.3"\n')
    assert "params.yaml" not in message_of(copied.stage("survey", "survey.drawing_grey=-60"))


def test_a_stage_that_fails_lists_the_overrides_that_params_yaml_has(copied):
    (copied.folder / "params.yaml").write_text('overrides: "contours.min_tunnel_m2=5000"\n')
    copied.module("pipeline.compose").check_returncode()
    message = message_of(copied.stage("contours"))
    assert "no dark region larger than 5000 m2" in message
    assert message.endswith("; params.yaml has the overrides contours.min_tunnel_m2=5000")


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("survey/mine/plan.png", b""),
        ("survey/mine/survey.json", b"{"),
        (
            "contours/free_space.geojson",
            b'{"features": [{"geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0]]]}}]}',
        ),
    ],
)
def test_a_broken_artifact_is_named_by_the_stage_that_reads_it(copied, name, data):
    (copied.folder / "artifacts" / name).write_bytes(data)
    stage = "compile3d" if name.startswith("contours") else "contours"
    assert f"artifacts/{name}" in message_of(copied.stage(stage))


def test_an_edited_manifest_and_changed_metrics_break_the_chain(repro, tmp_path):
    project = repro.copy(tmp_path / "copy")
    manifest, metrics = (project.folder / "artifacts" / name for name in ("compile3d/manifest.json", METRICS))
    record = json.loads(manifest.read_text())
    for path, content, message in (
        (manifest, {**record, "inputs": {}}, "names no input from"),
        (manifest, {**record, "code_sha256": "0" * 64}, "made by other code"),
        (manifest, {**record, "stage": "survey"}, "written by stage 'survey'"),
        (manifest, {**record, "params": {**record["params"], "height_m": 9.0}}, "made with other params"),
        (metrics, {"world": 5}, METRICS),
        (metrics, "rubbish", METRICS),
    ):
        before = path.read_bytes()
        path.write_text(json.dumps(content))
        text = message_of(project.module("pipeline", "verify"))
        path.write_bytes(before)
        assert path.relative_to(project.folder / "artifacts").as_posix() in text
        assert message in text


@pytest.mark.parametrize("run", [run_command, run_baseline])
def test_a_missing_package_is_named_with_the_command_that_installs_it(run, capsys):
    def lack(name):
        def command():
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

        return command

    assert run("new", lack("ezdxf.addons")) == 2
    said = capsys.readouterr().err
    assert said == f"new: ezdxf.addons is not installed for {sys.executable}; run `make setup`\n"
    with pytest.raises(ModuleNotFoundError):
        run("new", lack("minexplore.nothing"))


@pytest.mark.parametrize(
    ("package", "command"),
    [
        ("safetensors", ["-m", "baselines.evaluate", "--help"]),
        ("scipy", ["-m", "baselines.score", "x"]),
        ("pyogrio", ["-m", "pipeline", "new", "zz", "--from", "{plan}"]),
    ],
)
def test_commands_without_a_package_end_in_one_line(tmp_path, package, command):
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.machinery as m\n"
        "found = m.PathFinder.find_spec\n"
        "def find(name, path=None, target=None):\n"
        f"    return None if name.split('.')[0] == {package!r} else found(name, path, target)\n"
        "m.PathFinder.find_spec = staticmethod(find)\n"
    )
    plan = tmp_path / "plan.gpkg"
    plan.write_bytes(b"SQLite format 3\0" + bytes(1000))
    done = subprocess.run(
        [sys.executable, *(word.format(plan=plan) for word in command)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    assert f"{package} " in done.stderr
    assert "make setup" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_second_of_two_runs_of_a_stage_is_refused_and_changes_nothing(project):
    project.stages("survey")
    before = project.hashes()
    with hold_lock(project.folder / "artifacts/.survey.lock", "busy"):
        text = message_of(project.stage("survey"))
    assert f"another command is running the stage survey (process {os.getpid()})" in text
    assert project.hashes() == before
    project.stage("survey").check_returncode()
    assert not (project.folder / "artifacts/.survey.lock").exists()
