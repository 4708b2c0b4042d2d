import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from baselines.base.errors import BaselineError, RejectedError
from baselines.policies.policy_lookup import checkpoint_sha256, make_policy
from baselines.policies.policy_source import find_source, read_source, source_sha256
from baselines.sandbox.bubblewrap import Limits, require_sandbox
from baselines.sandbox.confined import Confined, ConfinedPolicy
from baselines.tests.test_learned import write_policy
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from tests.sandbox import needs_sandbox

pytestmark = needs_sandbox

STRANGERS = """
import os, time
import numpy as np


class Base:
    def __init__(self, count, task, robot):
        self.count = count
    def reset(self, robots, seeds):
        self.seeds = seeds
    def act(self, observation, info):
        return self.command(info) * np.ones((self.count, 2))


class Asks(Base):
    def command(self, info):
        return info["cells_seen"]

class Sleeps(Base):
    def command(self, info):
        time.sleep(60)

class Grows(Base):
    def command(self, info):
        return np.ones(10**9).sum()

class Ends(Base):
    def command(self, info):
        os._exit(0)

class Babbles(Base):
    def command(self, info):
        for descriptor in range(3, 64):
            try:
                os.write(descriptor, b"\\xff" * 64)
            except OSError:
                pass
        return 0.0

class Divides(Base):
    def command(self, info):
        return np.nan

class Shapes(Base):
    def act(self, observation, info):
        return np.ones(3)

class Floods(Base):
    # an error of a million bytes, past what the server would send
    def command(self, info):
        import gc
        from baselines.sandbox.channel import FAILED, Channel
        channel = next(found for found in gc.get_objects() if isinstance(found, Channel))
        channel.send(FAILED, b"x" * 1_000_000)

class Raises(Base):
    def command(self, info):
        raise RuntimeError("\\x1b[2J\\nall is well")
"""
HERE = (TaskParams(), RobotParams())


@pytest.fixture
def strangers(tmp_path, monkeypatch):
    """Go to a folder with a module of policies."""
    (tmp_path / "strangers.py").write_text(STRANGERS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def act(name, limits=None, count=2):
    """Return the first command of a stranger's policy."""
    with ConfinedPolicy(name, count, *HERE, Confined(limits or Limits())) as policy:
        policy.reset(np.arange(count), np.arange(count))
        return policy.act(np.zeros((count, 19), np.float32), {"pose_m_rad": np.zeros((count, 3)), "cells_seen": 1})


def test_a_confined_policy_gives_the_commands_that_it_gives_here(tmp_path):
    file = tmp_path / "mine.safetensors"
    write_policy(file, "mlp", hidden=64)
    observation = np.random.default_rng(0).random((2, 19)).astype(np.float32)
    here = make_policy(str(file), 2, *HERE)
    here.reset(np.arange(2), np.array([7, 8]))
    with ConfinedPolicy(str(file), 2, *HERE, Confined(sha256=checkpoint_sha256(file))) as there:
        there.reset(np.arange(2), np.array([7, 8]))
        for _ in range(25):
            info = {"pose_m_rad": np.zeros((2, 3))}
            np.testing.assert_array_equal(here.act(observation, info), there.act(observation, info))


def test_the_hash_is_compared_before_anything_of_a_policy_is_imported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for source in (tmp_path / "alone.py", tmp_path / "package/__init__.py"):
        source.parent.mkdir(exist_ok=True)
        source.write_text(f"open({str(tmp_path / 'imported')!r}, 'w')\nraise SystemExit")
    write_policy(tmp_path / "mine.safetensors", "mlp", hidden=64)
    for name in ("alone:Class", "package.inner:Class", str(tmp_path / "mine.safetensors")):
        with pytest.raises(RejectedError, match=r"policy .* is [0-9a-f]{12} here, not 000000000000"):
            ConfinedPolicy(name, 2, *HERE, Confined(sha256="0" * 64))
    assert not (tmp_path / "imported").exists()
    assert "alone" not in sys.modules


def test_a_policys_hash_covers_every_file_of_its_package_and_nothing_beside_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "solver/data").mkdir(parents=True)
    for name in ("solver/__init__.py", "solver/inner.py", "solver/data/weights.bin", "beside.py"):
        (tmp_path / name).write_text("")

    def found():
        return source_sha256(read_source(find_source("solver")))

    (tmp_path / "solver" / os.fsdecode(b"\xff\x1b.bin")).write_text("")  # a name that is no UTF-8
    first = found()
    (tmp_path / "beside.py").write_text("changed")
    assert found() == first
    (tmp_path / "solver/data/weights.bin").write_text("changed")
    assert found() != first
    (tmp_path / "solver/link.py").symlink_to(tmp_path / "beside.py")
    with pytest.raises(BaselineError, match=r"solver/link\.py: cannot be read"):
        found()
    (tmp_path / "solver/link.py").unlink()
    os.mkfifo(tmp_path / "solver/pipe")
    with pytest.raises(BaselineError, match=r"solver/pipe: not a plain file"):
        found()
    (tmp_path / "solver/pipe").unlink()
    (tmp_path / "solver/folder").symlink_to(tmp_path)
    with pytest.raises(BaselineError, match=r"solver/folder: a link"):
        found()
    (tmp_path / "solver/folder").unlink()
    monkeypatch.setattr("baselines.policies.policy_source._MOST_FILES", 9)
    for number in range(10):
        (tmp_path / f"solver/{number}").mkdir()
    with pytest.raises(BaselineError, match="more than 9 files and folders"):
        found()


def test_a_system_without_bubblewrap_or_namespaces_is_refused_with_what_is_missing(monkeypatch):
    require_sandbox()
    if "--disable-userns" not in subprocess.run(["bwrap", "--help"], capture_output=True, text=True).stdout:
        pytest.skip("bubblewrap 0.8 or newer is not installed (Debian 12 and newer: bubblewrap)")
    # In a namespace that forbids further ones, the real bubblewrap starts no sandbox.
    command = ["bwrap", "--dev-bind", "/", "/", "--unshare-user", "--disable-userns", sys.executable, "-c"]
    done = subprocess.run(
        [*command, "from baselines.sandbox.bubblewrap import require_sandbox; require_sandbox()"],
        capture_output=True,
        text=True,
    )
    assert "BaselineError: bubblewrap starts no sandbox on this system (bwrap: " in done.stderr
    require_sandbox.cache_clear()
    monkeypatch.setenv("PATH", "")
    assert shutil.which("bwrap") is None
    with pytest.raises(BaselineError, match="bubblewrap is not installed: `make setup` installs it"):
        require_sandbox()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Asks", "KeyError: 'cells_seen'"),
        ("Grows", "MemoryError|Unable to allocate"),
        ("Ends", "it ended"),
        ("Babbles", "it sends|answers"),
        ("Divides", "a command is not finite"),
        ("Shapes", r"commands of shape \(3,\): want \(2, 2\)"),
        ("Floods", "xxx$"),
        ("Raises", r"RuntimeError: \\x1b\[2J\\nall is well"),
        ("Absent", "cannot be imported"),
    ],
)
def test_a_policy_that_fails_ends_with_one_message(strangers, name, message):
    with pytest.raises(BaselineError, match=message) as found:
        act(f"strangers:{name}", Limits(memory_bytes=2 << 30))
    assert "\n" not in str(found.value)
    assert len(str(found.value)) < 1000


def test_a_policy_that_does_not_answer_is_ended(strangers):
    with pytest.raises(BaselineError, match=r"it takes too long \(limits: 4 GB of memory, 4 s of its own time\)"):
        act("strangers:Sleeps", Limits(time_s=4.0))
