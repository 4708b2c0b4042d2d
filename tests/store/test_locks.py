"""Locks between processes: one holder, no stale lock, no file left."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from pipeline.errors import ArtifactError
from pipeline.store.locks import hold_lock
from tests.project import ROOT

HOLD = "from pathlib import Path; from pipeline.store.locks import hold_lock\nwith hold_lock(Path({!r}), 'busy'):\n    "


def holder(path):
    program = HOLD.format(str(path)) + "print('held', flush=True); input()"
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_holder_is_refused_with_the_process_that_holds_the_lock(tmp_path):
    path = tmp_path / "worlds" / ".a.lock"
    process = holder(path)
    with (
        pytest.raises(ArtifactError, match=rf"^name = a: busy \(process {process.pid}\)$"),
        hold_lock(path, "name = a: busy"),
    ):
        pass
    process.communicate("\n")
    with hold_lock(path, "busy"):
        assert path.read_text() == f"{os.getpid()}\n"
    assert not path.parent.exists()  # the lock made this folder


def test_the_lock_of_a_killed_process_is_free(tmp_path):
    path = tmp_path / ".a.lock"
    process = holder(path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert path.exists()
    with hold_lock(path, "busy"):
        pass
    assert not path.exists()


def test_a_folder_with_other_files_is_kept(tmp_path):
    path = tmp_path / "worlds" / ".a.lock"
    with hold_lock(path, "busy"):
        (path.parent / "b").write_text("")
    assert [p.name for p in path.parent.iterdir()] == ["b"]


def test_holders_of_a_waiting_lock_run_one_after_the_other(tmp_path):
    path = tmp_path / "list.txt"
    path.write_text("")

    def append(number):
        with hold_lock(tmp_path / ".list.lock", None):
            text = path.read_text()
            partial = path.with_name(f"{number}.partial")
            partial.write_text(f"{text}{number}\n")
            partial.replace(path)

    threads = [threading.Thread(target=append, args=[number]) for number in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(map(int, path.read_text().split())) == list(range(20))


def test_a_lock_without_a_message_waits_and_is_removed(tmp_path):
    path = tmp_path / ".a.lock"
    process = holder(path)
    reached = threading.Event()

    def wait():
        with hold_lock(path, None):
            reached.set()

    waiting = threading.Thread(target=wait)
    waiting.start()
    assert not reached.wait(0.5)
    process.communicate("\n")
    waiting.join(60)
    assert reached.is_set()
    assert not path.exists()
