"""Commands of DVC in a process that has loaded the libraries."""

import json
import os
import socket
import subprocess
import sys

import pytest

from pipeline.prepared import ADDRESS
from tests.project import ROOT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere commands load their libraries themselves")
_CONTOURS = [sys.executable, "-m", "pipeline.prepared", "contours"]
_PREPARED = """
import subprocess, sys
from pipeline.prepared import prepared
with prepared(whole=False) as environment:
    for _ in range(2):
        done = subprocess.run(sys.argv[1:], env=environment)
sys.exit(done.returncode)
"""


_AHEAD = """
import json, os, subprocess, sys, types
import stages.__main__ as listed
from pipeline import stage
from pipeline.guard.forked import Forked
from pipeline.params.reading import composed
from pipeline.prepared import prepared

def begin(params, root):
    return Forked(lambda: params.name)

def second(params, begun=None):
    return {"two": {"begun": begun.result() if begun else None}}

class Section(types.SimpleNamespace):
    def model_dump(self, mode):
        return {}

one, two = (stage.Artifact(name, dict) for name in ("contours/a.json", "compile3d/b.json"))
all_ = [
    stage.Stage("contours", run=lambda params: {"one": {}}, reads={}, writes={"one": one}),
    stage.Stage("compile3d", run=second, begin=begin, begins_with="contours", reads={}, writes={"two": two}),
]
for one in all_:
    sys.modules["stages." + one.name] = types.SimpleNamespace(STAGE=one)
listed.load_stages = lambda: all_
stage.composed_section = composed.composed_section = lambda name: Section(name=name)
stage.read_registry, stage.new_manifest = dict, lambda *fields: {}
with prepared(whole=sys.argv[1] == "whole") as environment:
    for name in sys.argv[2:]:
        subprocess.run([sys.executable, "-m", "pipeline.prepared", name], env=environment, check=True)
print(open("artifacts/compile3d/b.json").read())
"""

_KILLS = """
import os, signal, subprocess, sys, types
import stages.__main__ as listed
from pipeline import prepared, stage

def main(*given):
    os.kill(os.getpid() if sys.argv[1:] == ["command"] else os.getppid(), signal.SIGKILL)
    signal.pause()

def run(name, begun):
    sys.argv[1:] = killed
    main()

killed = sys.argv[1:]
listed.load_stages = list
prepared.run = run
with prepared.prepared(whole=False) as environment:
    done = subprocess.run([sys.executable, "-m", "pipeline.prepared", "contours"], env=environment)
print(done.returncode)
"""


def _run(command, folder, **env):
    return subprocess.run(
        command, cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT), **env}, capture_output=True, text=True
    )


def test_a_command_prints_and_ends_as_it_does_alone(tmp_path):
    alone = _run(_CONTOURS, tmp_path)
    assert alone.returncode == 2
    assert alone.stderr.startswith("contours: artifacts/params.json")
    twice = _run([sys.executable, "-c", _PREPARED, *_CONTOURS], tmp_path)
    assert (twice.returncode, twice.stderr) == (2, 2 * alone.stderr)


def test_a_command_hands_its_streams_to_the_process_of_the_address_and_ends_with_its_code(tmp_path):
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "s"))
        listener.listen()
        with subprocess.Popen(
            _CONTOURS,
            cwd=ROOT,
            env={**os.environ, ADDRESS: str(tmp_path / "s")},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as client:
            asked, _ = listener.accept()
            with asked:
                name, streams, _, _ = socket.recv_fds(asked, 64, 3)
                for stream, text in zip(streams[1:], (b"out", b"error"), strict=True):
                    os.write(stream, text)
                    os.close(stream)
                os.close(streams[0])
                asked.send(bytes([7]))
            assert client.communicate() == (b"out", b"error")
    assert (name, client.returncode) == (b"contours", 7)


def test_a_command_runs_alone_if_the_prepared_process_is_gone(tmp_path):
    alone = _run(_CONTOURS, tmp_path)
    with socket.socket(socket.AF_UNIX) as gone:
        gone.bind(str(tmp_path / "s"))
    for address in ("s", "nothing"):
        done = _run(_CONTOURS, tmp_path, **{ADDRESS: str(tmp_path / address)})
        assert (done.returncode, done.stderr) == (2, alone.stderr)


@pytest.mark.parametrize("kills", ["command", "server"])
def test_a_command_that_the_system_kills_says_so(tmp_path, kills):
    done = _run([sys.executable, "-c", _KILLS, kills], tmp_path)
    assert done.stdout == "247\n"
    assert done.stderr == "contours: the system ended it, perhaps for want of memory\n"


@pytest.mark.parametrize(
    ("asked", "begun"),
    [
        (["whole", "contours", "compile3d"], "compile3d"),
        (["part", "contours", "compile3d"], None),
        (["whole", "compile3d"], None),  # the one before is up to date
    ],
)
def test_a_stage_gets_what_it_began_while_the_one_before_ran(tmp_path, asked, begun):
    done = _run([sys.executable, "-c", _AHEAD, *asked], tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"begun": begun}
