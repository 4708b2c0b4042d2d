"""Commands of DVC in a process that has loaded the libraries."""

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
with prepared() as environment:
    for _ in range(2):
        done = subprocess.run(sys.argv[1:], env=environment)
sys.exit(done.returncode)
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
