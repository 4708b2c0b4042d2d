"""A user's mine, from a file to a world, by the commands that a user types."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys

import cv2
import pytest
import shapely

from benchmarks.fuzzing.hostile import HOSTILE
from benchmarks.pictures.look_at_report import find_browser, look_at
from benchmarks.pictures.paper_drawing import draw_on_paper
from pipeline.__main__ import parse
from pipeline.survey.draw import draw_plan, frame_around
from tests.project import TINY_STATIONS, message_of, set_values


def pipeline(project, *arguments):
    return project.module("pipeline", *arguments)


@pytest.fixture(scope="module")
def owned(tmp_path_factory, repro):
    """Return a project with a world made from a plan with a scale bar, and the result of the command."""
    project = repro.copy(tmp_path_factory.mktemp("own") / "mine")
    tee = shapely.union_all([shapely.box(0, 0, 40, 5), shapely.box(18, 5, 23, 22)])
    plan, _ = draw_plan(tee, frame_around((-10, -20, 50, 40), 8.0), {}, 20.0, 40)
    cv2.imwrite(str(project.folder / "plan.png"), plan)
    words = ("new", "my-tee", "--from", "plan.png", "--licence", "CC0")
    done = project.module("pipeline", *words, COLUMNS="400")
    assert done.returncode == 0, done.stderr
    return project, done


def test_one_command_makes_a_world_a_report_and_an_environment(owned):
    project, done = owned
    printed = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    printed = {key: value.removeprefix("id").strip() for key, value in printed.items()}
    assert printed["world"] == "artifacts/worlds/my-tee/realism/world"
    assert (project.folder / printed["report"]).stat().st_size > 500_000
    assert printed["env"] == "MineXplore/my-tee-v0"
    assert "survey.entrance_m, changes it" in printed["start"]
    assert done.stderr.count("guessed, dropped or assumed") == 1
    assert re.search(r"the bar is 160 px long and represents 20 m \(detected.*--bar-length", done.stderr)
    program = (
        "import gymnasium, minexplore\nenv = gymnasium.make('MineXplore/my-tee-v0')\n"
        "print(env.reset(seed=1)[0].shape)\nassert minexplore.load('my-tee').record['name'] == 'my-tee'"
    )
    played = project.run(sys.executable, "-c", program)
    assert played.stdout.strip() == "(19,)", played.stderr
    line = next(x for x in (project.folder / "data/registry_own.txt").read_text().splitlines() if "my-tee" in x)
    assert line.endswith("CC0")


def test_the_chain_of_an_own_mine_is_verified_and_a_changed_file_breaks_it(owned, tmp_path):
    project = owned[0].copy(tmp_path / "copy")
    verified = project.module("pipeline", "verify", "my-tee")
    assert verified.returncode == 0, verified.stderr
    assert re.fullmatch(r"\d+ artifacts verified; world [0-9a-f]{64}\n", verified.stdout)
    changed = "artifacts/worlds/my-tee/contours/evidence/widths.csv"
    with (project.folder / changed).open("a") as stream:
        stream.write("x")
    broken = project.module("pipeline", "verify", "my-tee")
    assert broken.returncode == 2
    assert broken.stderr.startswith(f"verify: {changed}: sha256")
    assert "the worlds are default, my-tee" in project.module("pipeline", "verify", "other").stderr


def test_a_new_mine_leaves_the_default_up_to_date_for_dvc_which_a_changed_input_does_not(owned, tmp_path):
    project = owned[0].copy(tmp_path / "copy")

    changed = ["conf/rock/andesite.yaml", "data/registry.txt"]
    for name in changed:
        file = project.folder / name
        file.write_text(f"{file.read_text()}# changed\n")
    stale = json.loads(project.run("dvc", "status", "--json", check=True).stdout)
    assert {"compose", "survey"} <= set(stale)
    differing = {name for stage in stale.values() for found in stage for files in found.values() for name in files}
    assert differing == set(changed)


def test_the_default_world_is_unchanged_and_a_second_run_makes_nothing(owned, repro):
    project, _ = owned
    assert {k: v for k, v in project.hashes().items() if not k.startswith("worlds/")} == repro.hashes()
    before = {p: p.stat().st_mtime_ns for p in (project.folder / "artifacts/worlds/my-tee").rglob("manifest.json")}
    again = pipeline(project, "new", "my-tee", "--from", "plan.png")
    assert again.returncode == 0
    assert "exists and is kept" in again.stderr
    assert before == {p: p.stat().st_mtime_ns for p in before}
    moved = message_of(pipeline(project, "new", "my-tee", "--from", "plan.png", "--start", "5,1"))
    assert "survey.entrance_m = [5.0, 1.0]: conf/survey/my-tee.yaml exists and states None" in moved
    corrected = project.folder / "corrected.png"
    corrected.write_bytes((project.folder / "plan.png").read_bytes() + b"\n")
    for options in ((), ("--dry-run",)):
        other = message_of(pipeline(project, "new", "my-tee", "--from", "corrected.png", *options))
        assert "corrected.png: my-tee was read from another file, which is in data/mines/my-tee; remove" in other


def test_an_export_by_name_states_the_licence_of_the_survey(owned):
    project, _ = owned
    done = pipeline(project, "export", "my-tee", "--to", "obj")
    assert done.returncode == 0, done.stderr
    (record,) = (project.folder / "artifacts/export/my-tee-obj").glob("export.json")
    assert json.loads(record.read_text())["world"]["licence"] == "CC0"


def test_worlds_are_listed_shown_and_compared(owned):
    project, _ = owned
    listed = pipeline(project, "list").stdout
    assert re.search(r"^my-tee +\d+ .*MineXplore/my-tee-v0$", listed, flags=re.M)
    assert re.search(r"^default ", listed, flags=re.M)
    shown = pipeline(project, "show", "my-tee").stdout
    assert re.search(r"^certificate\.holds +True +>= 1$|^certificate\.holds +1 +>= 1$", shown, flags=re.M)
    assert "FAILS" not in shown
    compared = pipeline(project, "compare", "default", "my-tee").stdout
    assert re.search(r"^survey\.kind +stations +plan$", compared, flags=re.M)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("new", "a/b", "--from", "plan.png"), "expected a letter, then letters, digits"),
        (("new", "default", "--from", "plan.png"), "name = default: is a reserved word"),
        (("new", "None", "--from", "plan.png"), "name = None: is a reserved word"),
        (("new", "x", "--from", "plan.png", "--bar-length", "-5"), "plan.png: --bar-length = -5.0"),
        (("new", "x", "--from", "plan.png", "--start", "1_0,2"), "'1_0' is not a number"),
        (("new", "x", "--from", "plan.png", "--page", "٣"), "'٣' is not a number"),
        (("report", ".."), "the worlds are default, my-tee"),
        (("new", "plan", "--from", "plan.png"), "is a survey of this project"),
        (("new", "ChileanMine", "--from", "plan.png"), "is an environment of this project"),
        (("new", "x", "--from", "none.png"), "none.png: no such file"),
        (("show", "nowhere"), "the worlds are default, my-tee"),
        (("compare", "default", "../x"), "the worlds are default, my-tee"),
    ],
)
def test_wrong_names_and_files_are_refused_and_leave_nothing(owned, arguments, message):
    project, _ = owned
    assert message in message_of(project.module("pipeline", *arguments))
    assert not (project.folder / "conf/survey/x.yaml").exists()
    assert not (project.folder / "data/mines/x").exists()


def state_of(project):
    """Return the bytes of the files that `new` may write."""
    roots = [project.folder / name for name in ("conf", "data", "artifacts/worlds")]
    return {p: p.read_bytes() if p.is_file() else None for root in roots for p in root.rglob("*")}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--bar-length", "20", "contours.min_tunnel_m2=5000"), "no dark region larger than 5000 m2"),
        (("--bar-length", "20", "contours.tolerence_m=1"), "contours.tolerence_m: unknown"),
        (("--bar-length", "20", "--licence", "a\tb"), "with a tab or line break cannot be registered"),
        (("--bar-length", "nan"), "--bar-length = nan"),
        (("--px-per-m", "1e300"), "--px-per-m = 1e+300"),
    ],
)
def test_a_refused_mine_leaves_nothing_behind(owned, arguments, message):
    project, _ = owned
    before = state_of(project)
    assert message in message_of(pipeline(project, "new", "x", "--from", "plan.png", *arguments))
    assert state_of(project) == before


def test_a_refused_drawing_is_shown_where_asked_and_nothing_else_is_left(owned):
    project, _ = owned
    drawing = draw_on_paper(40)  # of three levels
    cv2.imwrite(str(project.folder / "levels.png"), drawing.picture)
    words = ("new", "x", "--from", "levels.png", "--px-per-m", str(drawing.px_per_m))
    before, names = state_of(project), {path.name for path in project.folder.iterdir()}
    text = message_of(pipeline(project, *words))
    assert text.endswith("--level N chooses one; --detected FILE.png draws what was found")
    assert {path.name for path in project.folder.iterdir()} == names
    for place, message in (
        ("none/found.png", "expected FILE.png in a folder that exists"),
        ("levels.png", "is the plan itself"),
    ):
        assert message in message_of(pipeline(project, *words, "--detected", place))
    text = message_of(pipeline(project, *words, "--detected", "found.png"))
    assert text.endswith("--level N chooses one; found.png shows what was found")
    shown = cv2.imread(str(project.folder / "found.png")).astype(int)
    green = shown[..., 1] - shown[..., [0, 2]].max(axis=2) > 30
    assert all(green[level].mean() > 0.9 for level in drawing.levels)
    assert state_of(project) == before


def test_a_file_with_a_name_that_configuration_would_evaluate_is_refused(owned):
    project, _ = owned
    before = state_of(project)
    shutil.copy(project.folder / "plan.png", project.folder / "${oc.env:HOME}.png")
    text = message_of(pipeline(project, "new", "x", "--from", "${oc.env:HOME}.png"))
    assert "a name with $, line breaks or control characters cannot be used" in text
    assert state_of(project) == before


def test_the_second_of_two_commands_for_one_world_is_refused_and_an_interrupt_ends_the_first(owned, tmp_path):
    project = owned[0].copy(tmp_path / "copy")
    set_values(project.folder / "minesurveys/limits.yaml", {"notice_s": 1})
    before = state_of(project)
    # The view counts for ever, so the command runs until it is interrupted.
    (project.folder / "slow.gpkg").write_bytes(HOSTILE["geopackage"]["view that counts without end"]()["mine.gpkg"])
    command = [sys.executable, "-m", "pipeline", "new", "x", "--from", "slow.gpkg"]
    first = subprocess.Popen(command, cwd=project.folder, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        for line in first.stderr:
            if re.search(r"still reading after \d s, the limit is 60 s", line):
                break
        second = message_of(pipeline(project, "new", "x", "--from", "plan.png"))
        assert second == f"new: name = x: another command is making this world (process {first.pid})"
        os.killpg(first.pid, signal.SIGINT)
        assert first.wait(60) == 130  # the limit on time would end it with 2
        assert first.stderr.read().endswith("new: interrupted\n")
        with pytest.raises(ProcessLookupError):
            os.killpg(first.pid, 0)  # no process of the group is left
    finally:
        first.kill()
        first.stderr.close()
    assert state_of(project) == before


@pytest.mark.slow
def test_a_corrected_survey_section_rebuilds_the_world(owned, tmp_path):
    project = owned[0].copy(tmp_path / "copy")
    conf = project.folder / "conf/survey/my-tee.yaml"
    conf.write_text(conf.read_text().replace("bar_length_m: 20.0", "bar_length_m: 24.0"))
    program = "from pipeline.compose import compose; print(compose(['survey=my-tee']).survey.scale.bar_length_m)"
    assert project.run(sys.executable, "-c", program).stdout.strip() == "24.0"
    project.run(sys.executable, "-m", "pipeline", "new", "my-tee", "--from", "plan.png", "preset=light")
    survey = json.loads((project.folder / "artifacts/worlds/my-tee/survey/mine/survey.json").read_text())
    assert survey["scale"]["px_per_m"] == pytest.approx(160 / 24)


@pytest.mark.slow
def test_a_light_world_of_a_plan_has_a_report_of_what_was_measured(owned, tmp_path):
    project = owned[0].copy(tmp_path / "copy")
    done = pipeline(project, "new", "light-tee", "--from", "plan.png", "preset=light")
    assert done.returncode == 0, done.stderr
    page = (project.folder / "artifacts/worlds/light-tee/report/report.html").read_text()
    assert "Stage 6 measured the certificate alone" in page
    assert "IoU, world against plan" not in page
    shown = pipeline(project, "show", "light-tee")
    assert shown.returncode == 0
    assert "iou.free_space_vs_cleaned" not in shown.stdout  # stage 6 does not ask a light world for it
    assert re.search(r"^certificate\.holds +(1|True) ", shown.stdout, flags=re.M)
    assert "FAILS" not in shown.stdout


def test_the_report_opens_without_a_network_and_draws_the_mine(owned, tmp_path):
    browser = find_browser()
    if browser is None:
        pytest.skip("no Chromium on this machine (Debian: chromium-headless-shell)")
    page = owned[0].folder / "artifacts/worlds/my-tee/report/report.html"
    assert page.stat().st_size < 15e6
    result = look_at(page, browser, tmp_path)
    assert result.console_errors == []
    assert result.requests == []
    assert result.colours > 16
    assert result.phone_px <= 390


@pytest.mark.slow
def test_a_family_of_worlds_is_built_resumed_and_listed_in_one_manifest(owned):
    project, _ = owned
    arguments = (
        "worlds",
        "--count",
        "1",
        "--split",
        "validation",
        "--jobs",
        "1",
        "survey.mine.size_m=[30,40]",
        "survey.mine.style=drift_and_crosscut",
        "survey.mine.spacing_m=16",
    )
    done = pipeline(project, *arguments)
    assert done.returncode == 0, done.stderr
    (world,) = json.loads((project.folder / "artifacts/families/manifest.json").read_text()).values()
    assert world["member"]["seed"] == 1_000_000
    assert world["certificate"]
    assert world["iou"] >= 0.98  # 3 cm of wall error in drifts of 4 m and more
    folder = project.folder / "artifacts/families/validation/0000"
    before = (folder / "survey/manifest.json").stat().st_mtime_ns
    assert pipeline(project, *arguments).returncode == 0
    assert (folder / "survey/manifest.json").stat().st_mtime_ns == before


def test_overrides_may_stand_anywhere_on_the_command_line(capsys):
    words = ["new", "pit", "compile3d.height_m=2.8", "--from", "a.png", "survey.margin_m=3", "--bar-length", "20"]
    assert parse(words).overrides == ["compile3d.height_m=2.8", "survey.margin_m=3"]
    for wrong in (["list", "a=1"], ["new", "pit", "--from", "a.png", "--colour", "red"]):
        with pytest.raises(SystemExit, match="2"):
            parse(wrong)
        assert "unrecognized arguments: " in capsys.readouterr().err


# From the moment at which stage 3 is written, the command may take 30 MB more: too little for the rock.
_LITTLE_MEMORY = """
import resource, sys
from pathlib import Path
def limit(event, arguments):
    if event == "open" and str(arguments[0]).endswith("/.compile3d.partial/new/manifest.json"):
        most = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + 30_000_000
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
sys.addaudithook(limit)
sys.argv = ["pipeline", "new", "small", "--from", "own.csv"]
from pipeline.__main__ import main
sys.exit(main())
"""


@pytest.mark.slow
def test_a_lack_of_memory_in_a_later_stage_is_one_line_and_keeps_the_finished_stages(tmp_path, repro):
    project = repro.copy(tmp_path / "mine")
    (project.folder / "own.csv").write_text(TINY_STATIONS)
    done = project.run(sys.executable, "-c", _LITTLE_MEMORY)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert re.search(
        r"^new: (surface|realism): not enough memory within [\d,]+ bytes of addresses .*$", done.stderr, flags=re.M
    )
    assert "artifacts/worlds/small: the finished stages are kept; the same command continues" in done.stderr
    world = project.folder / "artifacts/worlds/small"
    kept = {path: path.stat().st_mtime_ns for path in world.rglob("manifest.json")}
    assert {path.parent.name for path in kept} >= {"survey", "contours", "compile3d"}
    assert not (world / "validation").exists()
    again = project.run(sys.executable, "-m", "pipeline", "new", "small", "--from", "own.csv")
    assert again.returncode == 0, again.stderr
    assert kept == {path: path.stat().st_mtime_ns for path in kept}
