"""Systems without the modules of POSIX, such as Windows: what starts there, and what it warns of."""

import json
import re
import subprocess
import sys

import pytest
import shapely

from minesurveys.errors import describe_shortage
from pieces.work import HERE
from pipeline.build.family import Member, make_family
from pipeline.errors import InputError
from pipeline.survey.detect import detect_survey
from tests.mines import TEE
from tests.project import ROOT

POSIX = {"fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"}
PACKAGES = ("minesurveys", "minexplore", "pieces", "pipeline", "stages", "baselines")
RUN_ON_LINUX = {"baselines/sandbox/policy_process.py"}  # bubblewrap alone starts it
IMPORTED = re.compile(r"^(?:import|from) (\w+)", re.MULTILINE)  # at the top of a module
# Filelock needs no fcntl on Windows, where it takes another way, so it is imported before.
BLOCKED = (
    "import sys, filelock; sys.modules |= dict.fromkeys({names}); from pipeline.__main__ import main; sys.exit(main())"
)


@pytest.fixture
def no_posix(monkeypatch):
    for name in POSIX:
        monkeypatch.setitem(sys.modules, name, None)


def test_no_module_needs_posix_to_be_imported():
    found = {
        path.relative_to(ROOT).as_posix(): POSIX & set(IMPORTED.findall(path.read_text()))
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        if "tests" not in path.parts
    }
    assert len(found) > 300
    assert {path for path, names in found.items() if names} == RUN_ON_LINUX


def test_a_command_starts_without_the_modules_of_posix():
    program = BLOCKED.format(names=sorted(POSIX))
    done = subprocess.run([sys.executable, "-c", program, "list"], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


def test_a_survey_is_read_in_this_process_and_one_line_warns_that_nothing_bounds_it(no_posix, tmp_path, capsys):
    path = tmp_path / "tee.geojson"
    path.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(TEE)}))
    assert detect_survey(path).values["kind"] == "vector"
    assert capsys.readouterr().err == (
        f"{path}: this system limits no process: what reads this file is bounded in neither memory nor time; "
        "read only files that you trust\n"
    )
    path.write_text("{")
    with pytest.raises(InputError, match=r"tee\.geojson: "):
        detect_survey(path)


def test_a_lack_of_memory_is_one_line_without_a_limit(no_posix):
    assert describe_shortage(MemoryError("1 GB")) == "not enough memory (1 GB)"


def test_a_family_of_worlds_is_refused_where_no_process_forks(no_posix):
    with pytest.raises(InputError, match="this system forks no processes"):
        make_family([Member("a", "test", 1, "cave", [])], HERE)
