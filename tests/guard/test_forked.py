"""Work in a forked process."""

import os
import signal
import sys
import time

import pytest

from pipeline.errors import ArtifactError, MemoryShortageError
from pipeline.guard.forked import Forked
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
