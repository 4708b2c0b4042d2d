import os
import time

import numpy as np
import pytest

from baselines.confined import Confined, ConfinedPolicy, what_is_held
from baselines.confinement import Limits
from baselines.errors import BaselineError, RejectedError
from baselines.policy import make_policy
from minexplore.robot import RobotParams
from minexplore.task import TaskParams

STRANGERS = '''
import os, socket, time
import numpy as np

os.environ["SECRETS"] = ",".join(k for k in os.environ if "SECRET" in k)
open_files = os.listdir("/proc/self/fd")


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

class Raises(Base):
    def command(self, info):
        raise RuntimeError("\\x1b[2J\\nall is well")

class Reaches(Base):
    """Its command is one bit for each thing that it could do."""
    def command(self, info):
        done = 0
        for bit, attempt in enumerate((self.connect, self.write, self.remove, self.signal, self.read_secret)):
            try:
                attempt()
                done |= 1 << bit
            except OSError:
                pass
        return done / 32
    def connect(self):
        socket.create_connection(("127.0.0.1", int(open("port").read())), 2).close()
    def write(self):
        with open("written", "w") as file:
            file.write("x")
    def remove(self):
        os.remove("port")
    def signal(self):
        os.kill(int(open("pid").read()), 0)
    def read_secret(self):
        if "THE_SECRET" not in os.environ:
            raise OSError
'''
HERE = (TaskParams(), RobotParams())


@pytest.fixture
def strangers(tmp_path, monkeypatch):
    """Go to a folder with a module of policies."""
    (tmp_path / "strangers.py").write_text(STRANGERS)
    (tmp_path / "ctypes.py").write_text("raise SystemExit('imported before the process was confined')")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def act(name, limits=None, count=2):
    """Return the first command of a stranger's policy."""
    with ConfinedPolicy(name, count, *HERE, Confined(limits or Limits())) as policy:
        policy.reset(np.arange(count), np.arange(count))
        return policy.act(np.zeros((count, 19), np.float32), {"pose_m_rad": np.zeros((count, 3)), "cells_seen": 1})


def test_a_confined_policy_gives_the_commands_that_it_gives_here():
    observation = np.random.default_rng(0).random((2, 19)).astype(np.float32)
    here = make_policy("random", 2, *HERE)
    here.reset(np.arange(2), np.array([7, 8]))
    with ConfinedPolicy("random", 2, *HERE, Confined()) as there:
        there.reset(np.arange(2), np.array([7, 8]))
        for _ in range(25):
            info = {"pose_m_rad": np.zeros((2, 3))}
            np.testing.assert_array_equal(here.act(observation, info), there.act(observation, info))
    with pytest.raises(RejectedError, match=r"policy random is [0-9a-f]{12} here, not 000000000000"):
        ConfinedPolicy("random", 2, *HERE, Confined(sha256="0" * 64))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Asks", "KeyError: 'cells_seen'"),
        ("Grows", "MemoryError|Unable to allocate"),
        ("Ends", "it ended"),
        ("Babbles", "it sends|answers"),
        ("Divides", "a command is not finite"),
        ("Shapes", r"commands of shape \(3,\): want \(2, 2\)"),
        ("Raises", r"RuntimeError: \\x1b\[2J\\nall is well"),
        ("Absent", "cannot be imported"),
    ],
)
def test_a_policy_that_fails_ends_with_one_message(strangers, name, message):
    with pytest.raises(BaselineError, match=message) as found:
        act(f"strangers:{name}", Limits(memory_bytes=2 << 30))
    assert "\n" not in str(found.value)


def test_a_policy_that_does_not_answer_is_ended(strangers):
    begun = time.monotonic()
    with pytest.raises(BaselineError, match=r"it takes too long \(limits: 4 GB of memory, 8 s of its own time\)"):
        act("strangers:Sleeps", Limits(time_s=8.0))
    assert time.monotonic() - begun < 40


def test_a_policy_reaches_neither_network_nor_files_nor_processes_nor_secrets(strangers, monkeypatch):
    import socket

    held = what_is_held(Limits())
    monkeypatch.setenv("THE_SECRET", "42")
    with socket.create_server(("127.0.0.1", 0)) as server:
        (strangers / "port").write_text(str(server.getsockname()[1]))
        (strangers / "pid").write_text(str(os.getpid()))
        done = round(32 * act("strangers:Reaches")[0, 0])
    could = {name: bool(done >> bit & 1) for bit, name in enumerate(("network", "write", "remove", "signal", "secret"))}
    assert not could["write"]  # by the limit on files' sizes, on any system
    assert not could["secret"]
    assert not could["network"] or not held.network
    assert not could["remove"] or not held.files
    assert not could["signal"] or not held.processes
