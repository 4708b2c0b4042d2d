"""Which pages of evidence are older than the code, and that renewing them states the code."""

import json

import pytest

from benchmarks import freshness
from benchmarks.freshness import begin, pages, renew, stale, stamp
from benchmarks.measurements import BENCHMARKS, Benchmark
from tests.project import ROOT

FILES = {
    "benchmarks/drawings.py": "import minexplore\nfrom pipeline.volume import union\nMOST = 3\n",
    "benchmarks/scans.py": "def run():\n    from minexplore.env import Env\n    from pipeline import scans\n",
    "benchmarks/worlds.py": "from stages.__main__ import load_stages\n",
    "minexplore/__init__.py": 'ENTRY_POINT = "minexplore.env:Env"\n',
    "minexplore/env.py": "STEP_S = 0.1\n",
    "pipeline/__init__.py": "",
    "pipeline/volume/__init__.py": "",
    "pipeline/volume/union.py": "STEEPEST = 0.36\n",
    "pipeline/scans.py": "NEAR_M = 1\n",
    "stages/__main__.py": "",
    "stages/survey.py": "from pipeline.volume.union import STEEPEST\n",
}
PAGE = "# A page\n\nAbout it.\n\n<!-- table -->\n\n| a |\n\n<!-- end of the table -->\n"


def benchmark(name, minutes, needs="setup"):
    return Benchmark(name, needs, f"python -m benchmarks.{name}", f"docs/{name}.md", minutes)


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Return a small project with three pages that state its code."""
    monkeypatch.setattr(freshness, "BENCHMARKS", some := [benchmark("scans", 3), benchmark("drawings", 1)])
    monkeypatch.setattr(Benchmark, "pages", property(lambda self: [self.writes]))
    some.append(benchmark("worlds", 2, needs="all"))
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
    """Write a page as its measurement does, and state the code."""
    before = begin(one, root)
    (root / one.writes).write_text((root / one.writes).read_text() + " ")
    stamp(before, root)
    return 0


def stale_pages(root):
    return {one.page.stem for one in pages(root) if one.why}


@pytest.mark.parametrize(
    ("changed", "wanted"),
    [
        ("pipeline/volume/union.py", {"drawings", "worlds"}),
        ("pipeline/scans.py", {"scans"}),
        ("minexplore/env.py", {"scans"}),  # the package names it for all
        ("minexplore/__init__.py", {"drawings", "scans"}),
        ("benchmarks/drawings.py", {"drawings"}),
        ("pipeline/__init__.py", {"drawings", "scans", "worlds"}),
    ],
)
def test_a_changed_constant_makes_exactly_the_pages_stale_whose_command_imports_it(tree, changed, wanted):
    assert stale_pages(tree) == set()
    (tree / changed).write_text(FILES[changed] + "ANOTHER = 4\n")
    assert stale_pages(tree) == wanted


def test_another_default_world_makes_those_stale_that_are_measured_in_it(tree):
    (tree / freshness.WORLD).write_text(json.dumps({"world_sha256": "f" * 64}))
    assert stale_pages(tree) == {"worlds"}


def test_the_stale_are_renewed_the_cheapest_first_within_the_budget_and_a_second_run_goes_on(tree, capsys):
    (tree / "pipeline/__init__.py").write_text("MORE = 1\n")
    done = []

    def measure(one):
        done.append(one.name)
        return write(tree, one)

    assert renew(tree, 2.5 / 60, measure) == 1
    out = capsys.readouterr().out
    assert out.startswith("3 measurements, about 0.1 h")
    assert "left: scans" in out
    assert renew(tree, None, measure) == 0
    assert done == ["drawings", "worlds", "scans"]
    assert stale(tree) == 0


def test_every_page_has_a_measurement_and_states_a_day_and_all_without_a_gpu_take_an_hour_and_a_half_at_most():
    costs = {name: one.minutes for one in BENCHMARKS for name in one.pages}
    parts = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs/evidence/parts").glob("*.md")}
    assert set(costs) == parts
    assert len(parts) <= 20
    assert None not in costs.values()
    assert sum(one.minutes for one in BENCHMARKS if one.pages and one.needs != "setup-gpu") <= 90
    assert all(one.day != "never" for one in pages(ROOT))
