"""The table of measurements and the command that runs one."""

import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from importlib.util import find_spec

import pytest

from benchmarks.__main__ import BENCHMARKS, environment_of, main, run_until, table
from benchmarks.freshness import OUT_OF_TIME
from tests.project import ROOT


def run(*words, **variables):
    command = [sys.executable, "-m", "benchmarks", *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=variables or None)


def test_every_measurement_has_a_name_of_its_own_and_a_row_in_the_table():
    names = [b.name for b in BENCHMARKS]
    assert len(set(names)) == len(names)
    assert [line.split()[0] for line in table().splitlines()] == ["name", *names]


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda b: b.name)
def test_the_modules_and_the_target_that_a_measurement_needs_exist(benchmark):
    for module in re.findall(r"python -m ([\w.]+)", benchmark.command):
        assert find_spec(module) is not None, module
    for word in shlex.split(benchmark.command):
        assert not word.startswith("tests/") or (ROOT / word).is_file(), word
    assert re.search(rf"^{benchmark.needs}:", (ROOT / "Makefile").read_text(), flags=re.M)


def test_an_unknown_name_gives_one_line_with_the_nearest_names(capsys):
    assert main(["random-mine"]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1
    assert "random-mines" in message


def test_further_arguments_and_the_exit_code_are_those_of_the_command():
    done = run("fuzz", "--no-such-option")  # its command imports little
    assert done.returncode == 2
    assert "--no-such-option" in done.stderr


def test_a_measurement_gets_the_environment_of_the_caller_not_that_of_the_pipeline():
    assert environment_of(BENCHMARKS[0]).keys() >= {"PATH"}
    program = (
        "from benchmarks.__main__ import BENCHMARKS, environment_of;"
        "print([k for k in ('MUJOCO_GL', 'OPENBLAS_NUM_THREADS') if k in environment_of(BENCHMARKS[0])])"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, env={}, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_no_page_and_no_message_names_a_make_target_that_is_gone():
    rules = re.findall(r"^([a-z][a-z -]*):", (ROOT / "Makefile").read_text(), flags=re.M)
    kept = {name for rule in rules for name in rule.split()}
    gone = {b.name for b in BENCHMARKS} - kept
    files = [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        ROOT / "LEADERBOARD.md",
        *(ROOT / "docs").rglob("*.md"),
        *(
            path
            for folder in ("minexplore", "pipeline", "baselines", "benchmarks")
            for path in (ROOT / folder).rglob("*.py")
        ),
    ]
    named = [
        f"{path.relative_to(ROOT)}: make {name}"
        for path in files
        for name in re.findall(r"`make ([a-z-]+)", path.read_text())
        if name in gone
    ]
    assert not named


# The first command keeps its results when it is interrupted; the second must not begin.
TWO = """
trap 'exit 130' INT
sh -c 'trap "sleep 0.2; touch kept; exit 130" INT; touch begun; sleep 60'
touch more
"""


@pytest.mark.parametrize("by", ["budget", "ctrl-c"])
def test_a_measurement_is_interrupted_at_the_budget_and_with_its_caller_and_keeps_what_it_has(tmp_path, by):
    command = ["sh", "-ec", f"cd {tmp_path}{TWO}"]
    if by == "budget":
        assert run_until(command, dict(os.environ), time.monotonic() + 2.0) == OUT_OF_TIME
    else:
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        threading.Timer(2.0, os.kill, [os.getpid(), signal.SIGINT]).start()
        with pytest.raises(KeyboardInterrupt):
            run_until(command, dict(os.environ), None)
        signal.signal(signal.SIGINT, before)
    assert {path.name for path in tmp_path.iterdir()} == {"begun", "kept"}
