"""Work in a forked process."""

import multiprocessing
import os
import signal
import sys
import time

import pytest

from pipeline.errors import ArtifactError, MemoryShortageError
from pipeline.guard.forked import Forked, in_shares
from pipeline.remarks import collect_remarks, warn_user

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the work runs in this process there")


def test_the_result_is_that_of_another_process_on_what_this_one_holds():
    held = list(range(5))
    assert Forked(lambda: sum(held)).result() == 10
    assert Forked(os.getpid).result() != os.getpid()
    Forked(held.clear).result()
    assert held == [0, 1, 2, 3, 4]  # the other process has cleared its own


def test_a_refusal_comes_with_its_message():
    def refuse():
        raise ArtifactError("mine.xml: no rock")

    with pytest.raises(ArtifactError, match=r"^mine\.xml: no rock$"):
        Forked(refuse).result()


def test_a_process_that_the_system_ends_is_a_shortage_of_memory():
    with pytest.raises(MemoryShortageError):
        Forked(lambda: os.kill(os.getpid(), signal.SIGKILL)).result()


def test_an_error_of_the_program_is_not_called_a_shortage(capfd):
    with pytest.raises(RuntimeError, match="its error is above"):
        Forked(lambda: 1 // 0).result()
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_a_process_that_is_no_longer_wanted_ends(tmp_path):
    file = tmp_path / "done"
    forked = Forked(lambda: (time.sleep(30), file.touch()))
    start = time.monotonic()
    forked.end()
    assert time.monotonic() - start < 5
    assert not file.exists()


def test_a_forked_process_hands_on_its_remarks():
    with collect_remarks() as remarks, Forked(lambda: warn_user("realism: points are 0.2 m apart")) as forked:
        assert forked.result() is None
    assert [remark.what for remark in remarks] == ["realism: points are 0.2 m apart"]


def test_with_ends_a_process_whose_result_nobody_asks_for():
    start = time.monotonic()
    with pytest.raises(ArtifactError), Forked(lambda: time.sleep(30)):
        raise ArtifactError("mine.xml: no rock")
    assert time.monotonic() - start < 5


def test_a_process_ends_with_the_last_reference_to_it():
    forked = Forked(lambda: time.sleep(30))
    process = forked._process
    other = Forked(forked.end)  # its copy of the first one leaves the process alone
    other.result()
    assert process.is_alive()
    del forked, other
    assert not process.is_alive()


def test_a_process_that_is_done_ends_before_its_result_is_asked_for():
    forked = Forked(lambda: bytes(1 << 20))  # more than a pipe holds
    forked._process.join(20)
    assert forked._process.exitcode == 0
    assert forked.result() == bytes(1 << 20)


def test_a_forked_process_may_fork_and_its_own_ends_with_it(tmp_path):
    assert Forked(lambda: Forked(os.getppid).result() == os.getpid()).result()
    file = tmp_path / "pid"

    def fork_and_wait():
        Forked(lambda: (file.write_text(str(os.getpid())), time.sleep(30))).result()

    forked, start = Forked(fork_and_wait), time.monotonic()
    while not (file.exists() and file.read_text()) and time.monotonic() - start < 20:
        time.sleep(0.01)
    forked.end()
    while time.monotonic() - start < 20:
        try:
            os.kill(int(file.read_text()), 0)
        except ProcessLookupError:
            break
        time.sleep(0.01)
    assert time.monotonic() - start < 20


def test_a_process_that_is_forked_later_may_ask_for_the_result():
    forked = Forked(lambda: 7)
    assert Forked(forked.result).result() == 7
    failed = Forked(lambda: 1 // 0)
    with pytest.raises(RuntimeError, match="its error is above"):
        Forked(failed.result).result()


def shares_of(found):
    return [pid for pid, _ in found], [number for _, numbers in found for number in numbers]


def test_shares_are_in_order_and_of_all_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2})
    started = time.monotonic()

    def work(first, end):
        time.sleep(0.05 if time.monotonic() - started < 2 else 0)  # long enough for others to begin
        return os.getpid(), list(range(first, end))

    processes, numbers = shares_of(in_shares(work, 1001))
    assert numbers == list(range(1001))
    assert len(set(processes)) == 3
    assert in_shares(work, 0) == []


def test_work_is_this_processs_own_on_one_core_when_it_is_little_and_within_a_share(monkeypatch):
    def work(first, end):
        return os.getpid(), list(range(first, end))

    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    assert in_shares(work, 9, least=5) == [(os.getpid(), list(range(9)))]
    within = in_shares(lambda first, end: (os.getpid(), in_shares(work, 100)), 2)
    assert [[pid for pid, _ in found] for _, found in within] == [[pid] for pid, _ in within]
    assert Forked(lambda: {pid for pid, _ in in_shares(work, 100)} == {os.getpid()}).result()
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    assert in_shares(work, 100) == [(os.getpid(), list(range(100)))]


def test_a_refusal_of_any_share_comes_with_its_message_and_leaves_no_process(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    parent, others = os.getpid(), set(multiprocessing.active_children())  # of tests before this one

    def refuse(first, end):
        if os.getpid() != parent:
            raise ArtifactError("mine.xml: no rock")
        time.sleep(0.1)

    with pytest.raises(ArtifactError, match=r"^mine\.xml: no rock$"):
        in_shares(refuse, 100)
    assert set(multiprocessing.active_children()) <= others
    assert len(in_shares(lambda first, end: first, 100)) > 1  # and the next work is shared again
