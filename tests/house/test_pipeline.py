"""The whole pipeline, run by a user's commands."""

import json
import sys

import numpy as np
import pytest

from pipeline.report.baseline import BASELINE, gated
from pipeline.report.results import ROWS, read_limits, read_metrics, results_table
from stages.__main__ import STAGES
from tests.project import ROOT, Project, message_of


def audit_repro(project):
    """Run `dvc repro`, which must run no stage; return the project's files it read, its processes and its imports."""
    events = project.folder.parent / "events.json"
    command = [sys.executable, "-P", str(ROOT / "tests" / "audited_dvc.py"), str(events), "repro"]
    assert "Running stage" not in project.run(*command, check=True).stdout
    seen = json.loads(events.read_text())
    opened = [project.folder / name for name in seen["open"]]  # a path from the root stays as it is
    inside = [p.relative_to(project.folder) for p in opened if p.is_relative_to(project.folder)]
    read = {p.as_posix() for p in inside if (project.folder / p).is_file() and not p.as_posix().startswith(".")}
    return {name for name in read if not name.endswith(".gitignore")}, seen["process"], seen["import"]


def metrics_of(project):
    return json.loads((project.folder / "artifacts/validation/metrics.json").read_text())


def test_the_embedded_survey_meets_its_limits(built):
    m = metrics_of(built)
    assert m["iou"]["free_space_vs_cleaned"] >= 0.990
    assert m["iou"]["free_space_vs_raw"] >= 0.970
    assert m["navigability"]["blocked"] == 0
    assert m["navigability"]["deepest_blocked_m"] <= 0.21 + 0.1
    assert m["topology"]["loops_plan"] == m["topology"]["loops_world"] == 1
    assert m["topology"]["drifts_lost"] == m["topology"]["drifts_added"] == 0
    certificate = json.loads((built.folder / "artifacts/validation/certificate.json").read_text())
    assert certificate["holds"]
    assert all(clause["holds"] for clause in certificate["clauses"].values())
    assert m["certificate"]["intrusion_mm"] == 0
    assert m["certificate"]["missing_mm"] == 0
    assert m["collision"]["parts"] <= 800
    assert m["world"]["bytes"] <= 60e6
    assert m["areas"]["tunnel_m2"] == pytest.approx(9376, rel=0.005)
    frame = 5329 * 1400 / 7.82**2
    assert m["areas"]["tunnel_m2"] + m["areas"]["islands_m2"] + m["areas"]["outside_m2"] == pytest.approx(
        frame, abs=0.1
    )


def regressions(metrics, baseline):
    """Return the gated metrics that are missing, or fell by more than their allowance."""
    allowed = {name: 0.01 if name.startswith("texture.") else 0.002 for name in baseline}
    return [name for name, before in baseline.items() if metrics.get(name, -1) < before - allowed[name]]


def test_the_gate_fails_for_a_metric_that_fell_too_far_or_is_missing():
    before = {"iou.a": 0.991, "texture.published.overall": 0.95}
    assert regressions({"iou.a": 0.9891, "texture.published.overall": 0.941}, before) == []
    assert len(regressions({"iou.a": 0.9889, "texture.published.overall": 0.939}, before)) == 2
    assert len(regressions({"iou.a": 1.0}, before)) == 1


def test_iou_and_texture_scores_are_not_below_the_accepted_baseline(built):
    metrics = read_metrics(built.folder / "artifacts/validation")
    baseline = json.loads((ROOT / BASELINE).read_text())
    assert set(baseline) == set(gated(metrics))
    assert regressions(metrics, baseline) == []


def test_the_readmes_table_shows_what_is_measured(built):
    folder = built.folder / "artifacts/validation"
    metrics, limits = read_metrics(folder), read_limits(folder)
    headlines = [row for row in ROWS if row.headline]
    assert len(headlines) <= 12
    for rows, page in ((headlines, "README.md"), (ROWS, "docs/evidence/results.md")):
        text, table = (ROOT / page).read_text(), results_table(rows, metrics, limits).splitlines()
        steady = [line for line in table if not line.startswith("| MjModel load")]
        assert [line for line in steady if line not in text] == [], "run `make report`"


def test_two_clean_builds_give_identical_bytes(traced, repro, tmp_path):
    again = traced.copy(tmp_path / "again")  # its first two stages have run, and `dvc` was not there
    for name in list(STAGES)[2:]:
        again.stage(name).check_returncode()
    again.module("pipeline", "report").check_returncode()
    one, two = (build.hashes() for build in (repro, again))
    assert set(one) == set(two)
    differing = [name for name in one if one[name] != two[name]]
    # Only the load times may differ. The report shows them; neither the manifest nor dvc.lock names their file.
    assert set(differing) <= {"validation/timings.json", "report/report.html"}
    assert one["realism/world/world.json"] == two["realism/world/world.json"]


def test_verify_accepts_an_intact_chain_and_names_the_first_broken_link(built, tmp_path):
    project = built.copy(tmp_path / "copy")
    folder = project.folder

    def verify():
        return project.module("pipeline", "verify")

    assert verify().returncode == 0
    mine = folder / "artifacts/realism/world/mine.xml"
    text = mine.read_text()
    mine.write_text(text.replace('friction="0.25', '"friction="0.95'.replace('"f', "f", 1)))
    assert "artifacts/realism/world/mine.xml" in message_of(verify())
    mine.write_text(text)
    plan = folder / "artifacts/survey/mine/plan.png"
    plan.write_bytes(plan.read_bytes() + b"x")
    assert message_of(verify()).startswith("verify: artifacts/survey/mine/plan.png")
    plan.unlink()
    assert "artifacts/survey/mine/plan.png: missing" in message_of(verify())


def test_a_manifest_made_from_another_input_breaks_the_chain(traced_project, tmp_path):
    project = traced_project.copy(tmp_path / "copy")
    folder = project.folder
    project.stage("survey", "survey.drawing_grey=60").check_returncode()
    text = (folder / "artifacts/params.json").read_text().replace('"drawing_grey": 40', '"drawing_grey": 60')
    (folder / "artifacts/params.json").write_text(text)
    done = project.module("pipeline", "verify")
    assert "artifacts/survey/mine/plan.png" in message_of(done)
    assert "the inputs of contours" in done.stderr


def test_dvc_repro_runs_all_stages_once_then_none(repro, tmp_path):
    assert "Running stage 'validation'" in (repro.folder.parent / "stdout").read_text()
    project = repro.copy(tmp_path / "mine")
    read, _, _ = audit_repro(project)
    assert {
        "artifacts/survey/mine/plan.png",
        "artifacts/realism/world/mine.xml",
        "stages/survey.py",
    } <= read  # hashed once
    read, processes, imported = audit_repro(project)
    # DVC compares the values in three files; its state has the hashes of all others.
    assert read == {"dvc.yaml", "dvc.lock", "params.yaml", "artifacts/params.json", "artifacts/code.json"}
    assert processes == []
    assert [name for name in imported if name.split(".")[0] in ("pipeline", "stages", "minexplore")] == []


@pytest.mark.slow
def test_an_experiment_runs_the_changed_stages(repro, tmp_path):
    project = repro.copy(tmp_path / "mine")
    project.run("dvc", "repro", check=True)
    project.run("git", "add", "-A", check=True)
    project.run("git", "-c", "user.name=t", "-c", "user.email=t@e.org", "commit", "-qm", "run", check=True)
    before = metrics_of(project)["iou"]["free_space_vs_cleaned"]
    experiment = project.run("dvc", "exp", "run", "-S", "overrides='contours.tolerance_m=0.15'")
    assert experiment.returncode == 0, experiment.stderr
    assert "Running stage 'survey'" not in experiment.stdout
    params = json.loads((project.folder / "artifacts/params.json").read_text())
    assert params["contours"]["tolerance_m"] == 0.15
    manifest = json.loads((project.folder / "artifacts/contours/manifest.json").read_text())
    assert manifest["params"]["tolerance_m"] == 0.15
    assert metrics_of(project)["iou"]["free_space_vs_cleaned"] != before
    difference = project.run("dvc", "metrics", "diff", check=True).stdout
    assert "iou.free_space_vs_cleaned" in difference
    assert "iou.free_space_vs_cleaned" in project.run("dvc", "metrics", "show", check=True).stdout
    assert "validation" in project.run("dvc", "dag", check=True).stdout
    project.run("dvc", "plots", "show", check=True)


@pytest.mark.slow  # tests/commands/test_choices.py runs `make all`
def test_make_takes_overrides_and_returns_to_the_default(project):
    # `setup` is replaced, because the copy uses the environment of the tests.
    (project.folder / "requirements" / "setup.sh").write_text("exit 0\n")
    done = project.run("make", "contours", OVERRIDES="survey.drawing_grey=60 contours.tolerance_m=0.1")
    assert done.returncode == 0, done.stderr
    params = json.loads((project.folder / "artifacts/params.json").read_text())
    assert (params["survey"]["drawing_grey"], params["contours"]["tolerance_m"]) == (60, 0.1)
    done = project.run("make", "contours", OVERRIDES="")
    assert done.returncode == 0, done.stderr
    assert json.loads((project.folder / "artifacts/params.json").read_text())["survey"]["drawing_grey"] == 40


def test_one_stage_runs_alone_with_overrides(traced_project, tmp_path):
    project = traced_project.copy(tmp_path / "copy")
    folder = project.folder
    project.stage("contours", "contours.tolerance_m=0.15").check_returncode()
    manifest = json.loads((folder / "artifacts/contours/manifest.json").read_text())
    assert manifest["params"]["tolerance_m"] == 0.15
    free = json.loads((folder / "artifacts/contours/free_space.geojson").read_text())
    assert free["features"][0]["properties"]["tolerance_m"] == 0.15


def test_the_tiny_survey_has_the_areas_of_its_stations(traced_project):
    facts = json.loads((traced_project.folder / "artifacts/contours/free_space.geojson").read_text())
    # 60 m and 30 m of drift, 5 m wide, without the overlap, and half a disc at each of the three ends; the drawing
    # has walls up to a quarter of a pixel, 3 cm, farther out.
    expected = 60 * 5 + 27.5 * 5 + 3 * np.pi * 2.5**2 / 2
    assert facts["features"][0]["properties"]["areas"]["tunnel_m2"] == pytest.approx(expected + 190 * 0.03, rel=0.002)


# --- the published plan --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_published_plan_meets_the_same_limits(shared_mine, tmp_path):
    project = Project(tmp_path / "mine", tiny=False)
    command = [sys.executable, "-m", "pipeline.survey.fetch", "--mirror", str(shared_mine)]
    assert project.run(*command).returncode == 0
    (project.folder / "params.yaml").write_text('overrides: "survey=plan"\n')
    project.stages(*STAGES)
    m = metrics_of(project)
    assert m["iou"]["free_space_vs_cleaned"] >= 0.990
    assert m["iou"]["free_space_vs_raw"] >= 0.970
    assert m["navigability"]["blocked"] == 0
    assert m["topology"]["loops_plan"] == m["topology"]["loops_world"] == 1
    assert m["topology"]["drifts_lost"] == m["topology"]["drifts_added"] == 0
    assert json.loads((project.folder / "artifacts/validation/certificate.json").read_text())["holds"]
    assert m["collision"]["parts"] <= 800
    # Pixel counts of the published plan, with more cleaning: about 9,420 m2 of tunnel and an island of 13,490 m2.
    assert m["areas"]["tunnel_m2"] == pytest.approx(9420, rel=0.025)
    assert m["areas"]["islands_m2"] == pytest.approx(13490, rel=0.01)
    survey = json.loads((project.folder / "artifacts/survey/mine/survey.json").read_text())
    assert survey["scale"]["px_per_m"] == pytest.approx(7.82)
    assert abs(survey["scale"]["difference_percent"]["poses"]) < 3
