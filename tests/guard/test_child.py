"""The process that reads a user's file: what it hands back, and how it ends when it exceeds a limit."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from minesurveys.errors import DoubtError, UnexpectedError
from minesurveys.guard import answers
from minesurveys.guard import reading_process as child
from minesurveys.guard.reading_process import Payload, run_limited
from pipeline.errors import GeometryError, InputError
from pipeline.scans.cloud import read_here
from pipeline.survey.detect import detect_here
from tests.project import ROOT, eventually, is_running

SCRATCH = 1_000_000  # bytes


def give_back(number):
    return Payload(
        {"number": number, "nan": float("nan")}, {"a": np.arange(12.0).reshape(3, 4).T, "b": np.zeros((0, 2))}
    )


def doubt():
    raise DoubtError("plan.png: two drawings", np.full((2, 3, 3), 7, np.uint8))


def sleep(seconds):
    time.sleep(seconds)
    return Payload(seconds)


def compute(seconds):
    while time.process_time() < seconds:
        pass


def allocate(size):
    return Payload(int(np.ones(size, np.uint8).sum()))


def return_zeros(size):
    return Payload(None, {"zeros": np.zeros(size, np.uint8)})


def die():
    os.kill(os.getpid(), signal.SIGSEGV)


def raise_error(kind):
    raise {"geometry": GeometryError("no\narea\x1b[31m"), "other": KeyError("a\nb"), "deep": RecursionError("deep")}[
        kind
    ]


def write_file(path):
    Path(path).write_bytes(b"x")


def write_temporary(size):
    with tempfile.NamedTemporaryFile() as file:
        file.write(bytes(size))
        file.flush()
        return Payload(Path(file.name).stat().st_size)


def run_thread():
    return Payload(threading.active_count())


def set_limits(monkeypatch, **limits):
    changed = child.reader_limits().model_copy(update=limits)
    monkeypatch.setattr(child, "reader_limits", lambda: changed)


def test_values_and_arrays_arrive_as_they_were_sent():
    payload = run_limited(give_back, {"number": 0.1}, "mine.dxf")
    assert payload.values["number"] == 0.1
    assert np.isnan(payload.values["nan"])
    assert (payload.arrays["a"] == np.arange(12.0).reshape(3, 4).T).all()
    assert payload.arrays["b"].shape == (0, 2)


def children_of_this_process():
    """Return the process ids of the children; other tests of the process keep a fork server and a tracker."""
    return {pid for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()}


def test_a_reader_that_sleeps_is_ended_by_the_clock_and_progress_is_shown(monkeypatch, capsys):
    set_limits(monkeypatch, time_s=0.2, notice_s=0.2)
    before = children_of_this_process()
    with pytest.raises(InputError, match=r"mine\.dxf: not read within 1 s by the clock, 5 times the limit \(time_s in"):
        run_limited(sleep, {"seconds": 600}, "mine.dxf")
    shown = capsys.readouterr().err
    assert re.search(r"^mine\.dxf: still reading after \d+ s, the limit is 0 s of processor time$", shown, flags=re.M)
    assert children_of_this_process() == before  # the reader has ended


def test_a_reader_is_ended_by_its_own_processor_time_and_not_by_what_other_programs_take(monkeypatch):
    set_limits(monkeypatch, time_s=0.5)  # of processor time; a reader that sleeps takes less than 0.01
    monkeypatch.setattr(child, "_CLOCK", 100.0)  # or a machine with five times as much to do ends it by the clock
    assert run_limited(sleep, {"seconds": 0.8}, "mine.dxf").values == 0.8  # other programs have the processor
    with pytest.raises(InputError, match=r"mine\.dxf: not read within 0 s of processor time, the limit \(time_s in"):
        run_limited(compute, {"seconds": 30}, "mine.dxf")


@pytest.mark.parametrize("size", [4_500_000_000, 10**15])
def test_a_reader_that_needs_too_much_memory_is_refused_with_the_limit(size):
    with pytest.raises(
        InputError, match=r"mine\.dxf: needs more than 4 GB of memory \(memory_bytes in minesurveys/limits"
    ):
        run_limited(allocate, {"size": size}, "mine.dxf")


def test_an_answer_beyond_the_limit_on_output_is_refused(monkeypatch):
    set_limits(monkeypatch, output_bytes=1_000_000)
    monkeypatch.setattr(child, "HEADER_BYTES", 1000)
    assert run_limited(return_zeros, {"size": 900_000}, "a.png").arrays["zeros"].size == 900_000
    with pytest.raises(InputError, match=r"a\.png: reading it gives more than 1,000,000 bytes"):
        run_limited(return_zeros, {"size": 9_000_000}, "a.png")


def test_a_crash_of_a_library_is_one_message_with_the_signal():
    with pytest.raises(InputError, match=r"a\.pdf: the library that reads it crashed \(SIGSEGV\)"):
        run_limited(die, {}, "a.pdf")


def test_errors_keep_their_kind_and_become_one_printable_line():
    with pytest.raises(GeometryError, match=r"^no area \[31m$"):
        run_limited(raise_error, {"kind": "geometry"}, "a.svx")
    for kind, name in (("other", r"KeyError: 'a\nb'"), ("deep", "RecursionError")):
        with pytest.raises(UnexpectedError, match=r"^a\.svx: cannot be read: it is broken, or holds what") as caught:
            run_limited(raise_error, {"kind": kind}, "a.svx")
        assert name in caught.value.detail  # for developers
        assert "Error" not in str(caught.value)


def test_a_doubt_hands_back_the_picture_of_what_was_found():
    with pytest.raises(DoubtError, match=r"^plan\.png: two drawings$") as caught:
        run_limited(doubt, {}, "plan.png")
    assert caught.value.picture.tolist() == np.full((2, 3, 3), 7).tolist()


def test_a_reader_cannot_write_into_a_file(tmp_path):
    with pytest.raises(UnexpectedError) as caught:
        run_limited(write_file, {"path": str(tmp_path / "x")}, "a.gpkg")
    assert "File too large" in caught.value.detail
    assert not (tmp_path / "x").stat().st_size


@pytest.mark.parametrize("fresh", [False, True])
def test_a_task_with_a_scratch_folder_writes_there_up_to_its_limit_and_leaves_nothing(tmp_path, monkeypatch, fresh):
    monkeypatch.setattr(child.tempfile, "tempdir", str(tmp_path))
    if fresh:
        with pytest.raises(InputError, match=r"a\.3d: "):
            run_limited(
                detect_here, {"path": str(tmp_path / "a.3d"), "stated": {}}, "a.3d", fresh=True, scratch_bytes=SCRATCH
            )
    else:
        assert run_limited(write_temporary, {"size": 1000}, "a.svx", scratch_bytes=SCRATCH).values == 1000
        with pytest.raises(UnexpectedError) as caught:
            run_limited(write_temporary, {"size": SCRATCH + 1}, "a.svx", scratch_bytes=SCRATCH)
        assert "File too large" in caught.value.detail
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"\xff" * 8,
        (99).to_bytes(8, "little") + b"{}",
        {"values": 1, "more": 2},
        {"arrays": [["a", "object", [1]]]},
        {"arrays": [["a", "uint8", [-1]]]},
        {"arrays": [["a", "float64", [10**9, 10**9, 10**9]]]},
        {"arrays": [["a", "uint8", [5]]]},
        [],
    ],
)
def test_a_broken_answer_is_refused_before_anything_is_made_of_it(answer):
    if not isinstance(answer, bytes):
        head = json.dumps(answer).encode()
        answer = len(head).to_bytes(8, "little") + head + b"\0\0"
    with pytest.raises(InputError, match="its reader gave a broken answer"):
        answers.decode("a.png", bytearray(answer))


def test_a_new_interpreter_reads_while_other_threads_run(tmp_path):
    (tmp_path / "c.xyz").write_text("".join(f"{2 + k % 2} {k / 100} {k % 5}\n" for k in range(300)))
    limits = {"thin_m": 0.01, "range_m": [0.0, 50.0], "max_points": 10**6, "height_m": [1, 12], "mesh_points_per_m2": 9}
    arguments = {"path": str(tmp_path / "c.xyz"), "units": "m", "limits": limits}
    forked = run_limited(read_here, arguments, "c.xyz")
    end = threading.Event()
    thread = threading.Thread(target=end.wait)
    thread.start()
    try:
        spawned = run_limited(read_here, arguments, "c.xyz")
    finally:
        end.set()
        thread.join()
    assert (spawned.arrays["points"] == forked.arrays["points"]).all()


def test_a_reader_ends_with_a_killed_command():
    program = (
        "from minesurveys.guard import reading_process\n"
        "import os, time\n"
        "fork = os.fork\n"
        "def fork_and_print():\n"
        "    pid = fork()\n"
        "    if pid: print(pid, flush=True)\n"
        "    return pid\n"
        "os.fork = fork_and_print\n"
        "from tests.guard.test_child import sleep\n"
        "reading_process.run_limited(sleep, {'seconds': 600}, 'a.png')\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        time.sleep(0.3)
        parent.kill()
        parent.wait(60)
    assert eventually(lambda: not is_running(pid))
