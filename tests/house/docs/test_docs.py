"""Every command in the documentation exists and runs."""

import importlib.util
import re
import shlex
import sys

import cv2
import pytest

from benchmarks.__main__ import BENCHMARKS
from benchmarks.__main__ import COMMANDS as OF_PAGES
from pipeline.__main__ import parse
from pipeline.survey.draw import draw_plan, frame_around
from tests.mines import TEE
from tests.project import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands_of(page):
    """Return the lines of a page's shell blocks, with continued lines joined and without comments."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), flags=re.M | re.S)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line.split("  #")[0].strip() for line in lines if line.strip() and not line.startswith("#")]


# Commands that are not run here, and the place where each is tested.
ELSEWHERE = {
    r"make all.*": "by the fixture `built`; with overrides in tests/commands/test_choices.py",
    r"make test": "this is the test run",
    r"dvc exp run -S \"overrides='contours\.tolerance_m=0\.15'\"": "tests/house/test_pipeline.py, in a small mine",
    r"make corpus": "benchmarks/tests/test_corpus.py, with few worlds",
    r"(python3 -m venv own|own/bin/.*)": "tests/minexplore/test_wheel_clients.py, with a small mine",
    r"sh requirements/setup.sh baselines": "it installs; the tests' environment is used",
    r"python -m baselines.(ppo|graph.training).train .*": "baselines/tests: training, interruption, resumption",
    r"python -m pipeline worlds --light .*": "tests/commands/test_family.py, with small mines",
    r"RAY_ADDRESS=.* python -m pipeline worlds .*": "tests/commands/test_family.py, on a cluster of two nodes",
    r"python -m baselines.ppo.curves": "baselines/tests/ppo/test_ppo.py; it draws the curves of long training",
    r"(make evidence|python -m benchmarks (stale|evidence).*)": "benchmarks/tests/test_freshness.py",
    r"python -m pipeline certify .* --contacts 20000": "tests/proof/test_certificate.py, within 4 GB of addresses",
    r"python -m benchmarks stress-test": "the same with more contacts",
    r"make data": "tests/survey/test_fetch.py, from a mirror",
    r"python -m benchmarks replay": "tests/proof/test_certificate.py; by what `make data` fetches",
    r".*python -m benchmarks train.*": "baselines/tests/ppo/test_ppo.py: training, interruption, resumption, two nodes",
    r"python -m benchmarks worlds .*": "tests/commands/test_family.py, with small mines",
    r"python -m benchmarks curves": "baselines/tests/ppo/test_ppo.py; it draws the curves of long training",
    r"make data .*": "tests/survey/test_fetch.py, from a mirror",
    r"python -m pipeline replay .*": "tests/proof/test_certificate.py; the names of the files are examples",
    r"python -m benchmarks files .*": "benchmarks/tests/test_files.py, with a small folder",
    r"python -m pipeline (new|list|show|compare|report|worlds).*": "the walk-through below",
    r"python -m pipeline verify my-mine": "`verify` of the default is run here; this mine is an example",
    r"python -m baselines.evaluate --policy my-mine-.*": "baselines/tests/ppo/test_ppo.py; the policy is an example",
    r"python -m baselines.split .*": "baselines/tests/test_split.py; it needs the mines of a split",
    r"python -m pipeline export artifacts/realism/world --to sdf .*": "tests/export/test_exporter.py, timed",
    r"python -m pipeline export .* --to usd": "tests/export/test_export_formats.py; it needs the extra `export`",
    r"python -m minexplore play [^ ]+": "tests/minexplore/envs/test_env.py; it opens a window",
    r"python -m minexplore record .* --live": "tests/minexplore/extra/record/test_recording.py; it serves a page",
}


BENCHMARK_NAMES = {*OF_PAGES, *(row.name for row in BENCHMARKS)}

COMMANDS = [(page.relative_to(ROOT).as_posix(), line) for page in PAGES for line in commands_of(page)]


@pytest.mark.parametrize(("page", "line"), COMMANDS)
def test_a_command_in_the_docs_exists(page, line):
    words = [word for word in shlex.split(line.split(" && ")[0]) if not re.fullmatch(r"[A-Z_]+=.*", word)]
    if words[0] == "make":
        for target in words[1:]:
            assert re.search(rf"^{target}:|^STAGES :=.*\b{target}\b", (ROOT / "Makefile").read_text(), flags=re.M), line
    elif words[:3] == ["python", "-m", "benchmarks"]:
        assert words[3] in BENCHMARK_NAMES, line
    elif words[:2] == ["python", "-m"]:
        assert importlib.util.find_spec(words[2]) is not None, line
        if words[2] == "pipeline":
            parse(words[3:])  # exits if the arguments are invalid
    else:
        others = ("dvc", "git", "docker", "ray", "pip", "tensorboard", ".", "sh", "python3", "own/bin/pip")
        assert words[0] in (*others, "own/bin/python"), line


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_a_module_or_a_target_that_a_page_names_exists(page):
    text, makefile = page.read_text(), (ROOT / "Makefile").read_text()
    for module in set(re.findall(r"python -m ([\w.]*\w)", text)):
        assert module == "benchmarks" or importlib.util.find_spec(module) is not None, module
    for name in set(re.findall(r"python -m benchmarks ([a-z][a-z-]+)", text)):
        assert name in BENCHMARK_NAMES, name
    for target in set(re.findall(r"`make ([a-z][a-z0-9-]+)", text)):
        assert target in BENCHMARK_NAMES or re.search(rf"^{target}:|^STAGES :=.*\b{target}\b", makefile, re.M), target


RUN_HERE = [
    line for line in dict.fromkeys(line for _, line in COMMANDS) if not any(re.fullmatch(p, line) for p in ELSEWHERE)
]


@pytest.fixture(scope="module")
def whole_mine(built, tmp_path_factory):
    """Return a copy of the built embedded mine, which commands may change."""
    project = built.copy(tmp_path_factory.mktemp("docs") / "mine")
    (project.folder / "requirements" / "setup.sh").write_text("exit 0\n")  # the tests' environment is used
    return project


@pytest.mark.slow
@pytest.mark.parametrize("line", RUN_HERE)
def test_a_command_in_the_docs_runs_unchanged(whole_mine, line):
    done = whole_mine.run("sh", "-c", line)
    assert done.returncode == 0, (line, done.stdout[-2000:], done.stderr[-2000:])


@pytest.mark.slow
def test_the_walk_through_for_your_own_mine_runs_unchanged(repro, tmp_path):
    project = repro.copy(tmp_path / "mine")
    plan, _ = draw_plan(TEE, frame_around((-10, -20, 90, 60), 8.0), {}, 20.0, 40)
    cv2.imwrite(str(project.folder / "plan.png"), plan)
    lines = commands_of(ROOT / "docs/how-to/own-mine.md")
    assert len(lines) == 7
    for line in lines:
        words = shlex.split(line)
        small = ["survey.mine.size_m=[30,40]"] if "worlds" in words and "--of" not in words else []
        done = project.run(sys.executable, *words[1:], *small)
        assert done.returncode == 0, (line, done.stderr)
