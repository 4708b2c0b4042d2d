import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from stages.__main__ import load_stages, render_dag
from tests.project import ROOT


def test_dvc_yaml_is_that_of_the_declarations():
    assert (ROOT / "dvc.yaml").read_text() == render_dag(ROOT), "run `make dag`"


def test_a_changed_module_makes_stale_the_stages_that_import_it_and_no_other(unbuilt, tmp_path):
    project = unbuilt.copy(tmp_path / "mine")
    stages = [stage.name for stage in load_stages()]

    def composed():
        project.module("pipeline.compose").check_returncode()
        return json.loads((project.folder / "artifacts/code.json").read_text())

    def changed(name):
        path = project.folder / name
        path.write_text(path.read_text() + "\n")
        states.append(composed())
        before, after = states[-2:]
        return {stage for stage in before if before[stage] != after[stage]}

    states = [composed()]
    assert changed("pipeline/geometry/drawing/gaps.py") == {"survey"}
    assert changed("pipeline/report/page.py") == {"report"}
    assert changed("pipeline/errors.py") == {*stages, "report"}
    dag = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]
    assert all({"artifacts/code.json": [name]} in dag[name]["params"] for name in (*stages, "report"))
    assert {"minesurveys", "minexplore", "pipeline", "stages"} <= set(dag["compose"]["deps"])


def test_dvc_yaml_names_each_input_of_the_default_world_and_none_of_your_mines(unbuilt, tmp_path):
    project = unbuilt.copy(tmp_path / "mine")
    tracked = {p.relative_to(project.folder).as_posix() for p in (project.folder / "conf").rglob("*.yaml")}
    read = {name for name in tracked if not name.startswith("conf/train/")}
    (project.folder / "conf/survey/mine.yaml").write_text("# Written by `python -m pipeline new mine`\nkind: plan\n")
    written = project.module("stages").stdout
    deps = {name: stage["deps"] for name, stage in yaml.safe_load(written)["stages"].items()}
    assert read <= set(deps["compose"])
    assert {"data/chilean_mine/tiny.csv", "data/registry.txt"} <= set(deps["survey"])
    assert "data/chilean_mine/roughness.json" in deps["surface"]
    assert not {"conf", "data"} & {name for names in deps.values() for name in names}
    assert "conf/survey/mine.yaml" not in written


def test_every_stage_reads_only_outputs_of_earlier_stages():
    written: set[str] = set()
    for stage in load_stages():
        assert {a.path for a in stage.reads.values()} <= written, stage.name
        outs = {a.path for a in stage.writes.values()}
        assert all(path.startswith(f"{stage.name}/") for path in outs)
        assert not outs & written
        written |= outs


@pytest.mark.slow  # `make check` runs it too
def test_packages_import_each_other_in_one_direction_only():
    done = subprocess.run([Path(sys.prefix) / "bin" / "lint-imports"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_locks_contain_hashes_and_no_address_of_a_package_index():
    for lock in sorted((ROOT / "requirements").glob("*.txt")):
        text = lock.read_text()
        assert not re.search(r"https?://|--(extra-)?index-url|--find-links", text), lock.name
        pinned = re.findall(r"^[A-Za-z0-9._-]+==", text, flags=re.M)
        assert pinned
        blocks = re.split(r"^(?=[A-Za-z0-9._-]+==)", text, flags=re.M)[1:]
        assert all("--hash=sha256:" in block for block in blocks), lock.name


def test_ci_and_workflow_run_the_two_commands_of_the_readme():
    script = (ROOT / ".ci" / "run").read_text()
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())
    runs = [step.get("run") for job in workflow["jobs"].values() for step in job["steps"]]
    for command in ("make all", "make test"):
        assert f"part {command}" in script.splitlines()
        assert command in runs
        assert f"\n{command}" in (ROOT / "README.md").read_text()


def test_git_tracks_only_data_with_a_clear_licence():
    tracked = subprocess.run(["git", "ls-files", "data"], cwd=ROOT, capture_output=True, text=True).stdout.split()
    ours = {"data/chilean_mine/stations.csv", "data/chilean_mine/roughness.json"}  # measured by this project
    ours.add("data/families/splits.csv")  # seeds and hashes of generated mines
    theirs = {"data/wheal_pell/pell.3d", "data/wheal_pell/LICENSE.md"}  # MIT, by their owners
    theirs |= {f"data/sakany/{name}" for name in ("Sakany_nodes.dat", "Sakany_links.dat", "LICENSE.md")}  # CC0
    allowed = ours | theirs | {"data/registry.txt", "data/README.md", "data/raw/.gitignore"}
    assert set(tracked) <= allowed


def test_ci_ends_with_a_message_when_its_minutes_are_spent_and_without_when_a_part_fails(tmp_path):
    text, minutes = (ROOT / ".ci/run").read_text(), "minutes=75 "
    assert minutes in text
    (tmp_path / ".ci").mkdir()

    def run(budget, all_recipe):
        (tmp_path / ".ci/run").write_text(text.replace(minutes, budget))
        (tmp_path / "Makefile").write_text(f"setup-witness:\nall:\n\t{all_recipe}\n")
        return subprocess.run(["bash", tmp_path / ".ci/run"], capture_output=True, text=True)

    spent = run("minutes=0 ", "sleep 30")
    assert spent.returncode != 0
    assert "CI: its 0 minutes were spent before the end of `make all`" in spent.stderr
    for recipe in ("false", "kill -9 $$PPID"):  # the second ends make as the system does when memory is short
        failed = run(minutes, recipe)
        assert failed.returncode != 0
        assert "minutes were spent" not in failed.stderr
