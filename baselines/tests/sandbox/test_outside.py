"""A policy changes nothing outside, and holds no lock of anything there: as root and as a plain user."""

import ast
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from baselines.sandbox.bubblewrap import sandbox_command
from baselines.sandbox.confined import Confined, ConfinedPolicy
from baselines.tests.sandbox.changing import ATTEMPTS, blocked, describe, gained, held, with_children
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from tests.project import ROOT
from tests.sandbox import needs_sandbox

pytestmark = [
    needs_sandbox,
    pytest.mark.skipif(platform.machine() != "x86_64", reason="the attempts use the numbers of x86-64's system calls"),
]
NOBODY = "65534"
MOST_BELOW = 300  # paths that are described of those that a folder holds


def shown_paths():
    """Return what lies outside at the places that a policy sees."""
    words = sandbox_command(None, "")
    sources = [words[k + 1] for k, word in enumerate(words) if word in ("--ro-bind", "--dev-bind")]
    return [*sources, *(path for path in with_children(sources)[:MOST_BELOW] if path not in sources)]


def attempts_in_a_sandbox():
    """Return what each attempt gained, how many paths it was tried on, and what is different or blocked outside."""
    outside = shown_paths()
    before = {path: describe(path) for path in outside}
    os.chdir(Path(__file__).parent)
    with ConfinedPolicy("changing:Changes", len(ATTEMPTS), TaskParams(), RobotParams(), Confined()) as policy:
        count = len(ATTEMPTS)
        found = policy.act(np.zeros((count, 19), np.float32), {"pose_m_rad": np.zeros((count, 3))})
        differs = [path for path in outside if describe(path) != before[path]]
        differs += [f"{path}: {reason}" for path in outside if (reason := blocked(path))]
    gains = {name: int(number) for name, number in zip(ATTEMPTS, found[:, 0], strict=True) if number}
    return gains, int(found[:, 1].min()), differs


def require_nothing_gained(gains, tried, differs):
    assert tried > 100
    assert gains == {}
    assert differs == []


def test_a_policy_of_the_user_changes_and_locks_nothing_outside(monkeypatch):
    monkeypatch.chdir(ROOT)
    require_nothing_gained(*attempts_in_a_sandbox())


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user; the test above runs as a plain user")
@pytest.mark.slow  # it imports all that a policy may use, twice
def test_a_policy_of_a_plain_user_changes_and_locks_nothing_outside():
    code = "from baselines.tests.sandbox import test_outside; print(test_outside.attempts_in_a_sandbox())"
    done = subprocess.run(as_nobody([sys.executable, "-c", code]), cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    require_nothing_gained(*ast.literal_eval(done.stdout))


def as_nobody(command):
    """Return a command that runs another one as a user without rights, who sees the interpreter wherever it lies."""
    python = Path(os.path.realpath(sys.executable)).parents[1]
    closed = [folder for folder in reversed(python.parents) if not folder.stat().st_mode & 0o001]
    words = ["bwrap", "--dev-bind", "/", "/", "--cap-add", "ALL"]
    if closed:
        words += ["--perms", "0755", "--tmpfs", str(closed[0])]
        between = [folder for folder in reversed(python.parents) if closed[0] in folder.parents]
        words += [word for folder in between for word in ("--perms", "0755", "--dir", str(folder))]
        words += ["--ro-bind", str(python), str(python)]
    words += ["--setenv", "PYTHONPATH", str(ROOT), "--setenv", "HOME", "/", "--chdir", str(ROOT)]
    return [*words, "setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", *command]


@pytest.mark.parametrize("name", ATTEMPTS)
def test_an_attempt_gains_something_where_nothing_confines_it(name):
    """They are no attempts that cannot succeed: on a file and a folder of its own each of them does."""
    folder = Path(tempfile.mkdtemp(dir=ROOT / "artifacts"))  # on a disk: a file system in memory has no flags
    try:
        (folder / "file").write_text("")
        if name == "attribute removed":
            os.setxattr(folder / "file", "user.policy", b"")
        assert gained(name, str(folder / "file")) or gained(name, str(folder))
    finally:
        while held:
            os.close(held.pop())
        shutil.rmtree(folder)
