"""Which pages of evidence are older than the code, and that renewing them states the code."""

import json
import shutil
import subprocess

import pytest

from benchmarks import freshness
from benchmarks.freshness import OUT_OF_TIME, begin, pages, renew, stale, stamp
from benchmarks.measurements import BENCHMARKS, Benchmark
from pipeline.places import WRITTEN_BY_NEW
from tests.project import ROOT

FILES = {
    "benchmarks/drawings.py": "MOST = 3\n",
    "benchmarks/scans.py": "from pipeline import compose\n",
    "benchmarks/worlds.py": "import minexplore\n",
    "minexplore/__init__.py": "",
    "pipeline/__init__.py": "",
    "pipeline/compose.py": "",
    "conf/survey/plan.yaml": "survey: {}\n",
    "requirements/dev.txt": "mujoco==3.17.0\n",
    "requirements/baselines.txt": "mujoco==3.17.0\n",
    "requirements/gpu.txt": "mujoco==3.17.0\n",
}
PAGE = "# A page\n\nAbout it.\n\n<!-- table -->\n\n| a |\n\n<!-- end of the table -->\n"

CODE = ("baselines", "benchmarks", "conf", "minesurveys", "minexplore", "pieces", "pipeline", "stages", "tests")
DATA = ("data/chilean_mine", "data/sakany", "data/wheal_pell", "docs/evidence/parts", "requirements")
STAGES = {"bench-growth", "bench-pipeline", "claims", "figures", "pieces", "random-mines", "simple-mines"}  # all six


def benchmark(name, minutes, needs="setup", default_world=False):
    command = f"python -m benchmarks.{name}"
    return Benchmark(name, needs, command, f"docs/{name}.md", minutes, default_world=default_world)


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Return a small project with three pages that state its code."""
    monkeypatch.setattr(freshness, "BENCHMARKS", some := [benchmark("scans", 3), benchmark("drawings", 1)])
    monkeypatch.setattr(Benchmark, "pages", property(lambda self: [self.writes]))
    some.append(benchmark("worlds", 2, default_world=True))
    world = tmp_path / freshness.WORLD
    world.parent.mkdir(parents=True)
    world.write_text(json.dumps({"world_sha256": "e" * 64}))
    for name, text in FILES.items() | {(one.writes, PAGE) for one in some}:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    for one in some:
        write(tmp_path, one)
    return tmp_path


def write(root, one):
    """Write the pages of a measurement as it does, and state the code."""
    before = begin(one, root)
    for name in one.pages:
        (root / name).write_text((root / name).read_text() + " ")
    stamp(before, root)
    return 0


def stale_pages(root):
    return {one.page.stem for one in pages(root) if one.why}


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """Return a copy of what pages of this project are measured with, whose pages state its code."""
    root = tmp_path_factory.mktemp("own")
    ignored = shutil.ignore_patterns("__pycache__", "checkpoints", "Family-test")
    for name in (*CODE, *DATA):
        shutil.copytree(ROOT / name, root / name, ignore=ignored)
    for one in BENCHMARKS:
        if one.pages:
            write(root, one)
    assert stale_pages(root) == set()
    return root


@pytest.mark.parametrize(
    ("changed", "old", "new", "wanted"),
    [
        (
            "pipeline/volume/rock/polygons.py",
            "LONGEST_M = 100.0",
            "LONGEST_M = 90.0",
            {*STAGES, "scans", "round-trips", "volumes"},
        ),
        ("pipeline/volume/enclosure.py", "_LEAST_M3 = 1e-12", "_LEAST_M3 = 2e-12", {*STAGES, "volumes"}),
        # The package names this one for all who import anything of it.
        ("minexplore/envs/env.py", "sixteen", "twenty", {"bench", "bench-gpu", "sensors"}),
        (
            *("conf/validation/default.yaml", "rest_mm: {max: 10}", "rest_mm: {max: 9}"),
            {*STAGES, "scans", "round-trips", "volumes", "sensors"},
        ),
        ("baselines/results/training/Family-map-mlp-42.json", '"seed": 42', '"seed": 43', {"claims", "curves"}),
        ("requirements/baselines.txt", "\nmujoco==3", "\nmujoco==4", {"pieces"}),
    ],
)
def test_a_changed_constant_makes_exactly_the_pages_stale_whose_commands_import_or_read_it(
    own, changed, old, new, wanted
):
    text = (own / changed).read_text()
    assert old in text
    (own / changed).write_text(text.replace(old, new, 1))
    found = {one.benchmark.name for one in pages(own) if one.why}
    (own / changed).write_text(text)
    assert found == wanted


def test_the_section_of_an_own_mine_makes_no_page_stale(tree):
    (tree / "conf/survey/mine.yaml").write_text(f"# {WRITTEN_BY_NEW} mine`\nsurvey: {{}}\n")
    assert stale_pages(tree) == set()
    (tree / "conf/survey/plan.yaml").write_text("survey: {kind: plan}\n")
    assert stale_pages(tree) == {"scans"}


def test_another_default_world_makes_those_stale_that_are_measured_in_it(tree):
    (tree / freshness.WORLD).write_text(json.dumps({"world_sha256": "f" * 64}))
    assert stale_pages(tree) == {"worlds"}


def test_the_stale_are_renewed_the_cheapest_first_within_the_budget_and_a_second_run_goes_on(tree, capsys):
    (tree / "requirements/dev.txt").write_text("mujoco==4.0.0\n")
    done = []

    def measure(one, until):
        done.append(one.name)
        return write(tree, one)

    assert renew(tree, 2.5 / 60, measure) == 1
    out = capsys.readouterr().out
    assert out.startswith("3 measurements, about 0.1 h")
    assert "left: scans" in out
    assert renew(tree, None, measure) == 0
    assert done == ["drawings", "worlds", "scans"]
    assert stale(tree) == 0


def test_a_measurement_that_was_ended_at_the_budget_is_left(tree, capsys):
    (tree / "benchmarks/scans.py").write_text("")
    assert renew(tree, 1.0, lambda one, until: OUT_OF_TIME) == 1
    assert "left: scans" in capsys.readouterr().out
    assert stale_pages(tree) == {"scans"}


def test_what_needs_another_set_up_comes_last_and_what_needs_a_gpu_is_left_out_without_one(tree, capsys, monkeypatch):
    some = [benchmark("scans", 1, "setup-baselines"), benchmark("drawings", 1, "setup-gpu"), benchmark("worlds", 9)]
    monkeypatch.setattr(freshness, "BENCHMARKS", some)
    for path in (tree / "docs").glob("*.md"):
        path.write_text(PAGE)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    done = []

    def measure(one, until):
        done.append(one.name)
        return write(tree, one)

    assert stale(tree) == 1
    assert "0.2 h in all" in capsys.readouterr().out
    assert renew(tree, None, measure) == 0
    out = capsys.readouterr().out
    assert out.startswith("drawings: left out, as this machine has no GPU\n2 measurements, about 0.2 h")
    assert "scans, about 1 min; last, as `make setup-baselines` changes .venv" in out
    assert done == ["worlds", "scans"]
    assert stale_pages(tree) == {"drawings"}


@pytest.mark.parametrize(
    ("words", "then"), [(["wheel", "RELEASE=1"], "packaging/build_wheel.py"), (["evidence"], "dvc repro")]
)
def test_a_release_and_the_renewal_of_evidence_begin_with_the_list_of_what_is_stale(words, then):
    command = ["make", "--no-print-directory", "-n", "-o", "setup", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert 0 < done.stdout.index("benchmarks stale") < done.stdout.index(then)


def test_every_page_has_a_measurement_and_states_a_day_and_all_without_a_gpu_take_an_hour_and_a_half_at_most():
    costs = {name: one.minutes for one in BENCHMARKS for name in one.pages}
    parts = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs/evidence/parts").glob("*.md")}
    assert set(costs) == parts
    assert len(parts) <= 20
    assert None not in costs.values()
    assert sum(one.minutes for one in BENCHMARKS if one.pages and one.needs != "setup-gpu") <= 90
    assert all(one.day != "never" for one in pages(ROOT))
