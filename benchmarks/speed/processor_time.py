"""Processor time of tests, with that of their processes: `python -m pytest -p benchmarks.speed.processor_time`.

The seconds of `--durations` are the wall's: on a busy machine they count what other programs do.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import pytest

_SHOWN = 40
_BEGUN = pytest.StashKey[float]()
_seconds: dict[str, float] = {}


def processor_s() -> float:
    """Return the processor time of this process, of its children and of their ended children, s.

    A fork server is a child that runs on; the commands of tests are its children.
    """
    spent = os.times()
    ticks = sum(_ticks_of(pid) for task in Path("/proc/self/task").iterdir() for pid in _children_of(task))
    return spent.user + spent.system + spent.children_user + spent.children_system + ticks / os.sysconf("SC_CLK_TCK")


def _children_of(task: Path) -> list[str]:
    with suppress(OSError):  # the thread has ended
        return (task / "children").read_text().split()
    return []


def _ticks_of(pid: str) -> int:
    """Return the ticks of the clock that a process and its ended children have computed; 0 once it has ended."""
    with suppress(OSError):
        after_name = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return sum(map(int, after_name[11:15]))
    return 0


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Note when a test begins; its fixtures belong to it, also those that later tests share."""
    item.stash[_BEGUN] = processor_s()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add a test's processor time to its last report, which a worker sends to the process that counts."""
    report = yield
    if call.when == "teardown":
        report.user_properties.append(("processor_s", processor_s() - item.stash[_BEGUN]))
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Count a test's processor time."""
    if report.when == "teardown":
        spent = dict(report.user_properties)["processor_s"]
        assert isinstance(spent, float)  # pytest's properties are objects of any kind
        _seconds[report.nodeid] = spent


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the dearest files and tests."""
    files: defaultdict[str, float] = defaultdict(float)
    for test, seconds in _seconds.items():
        files[test.partition("::")[0]] += seconds
    terminalreporter.section(f"processor time: {sum(_seconds.values()):.1f} s")
    for counted in (files, _seconds):
        for name, seconds in sorted(counted.items(), key=lambda row: -row[1])[:_SHOWN]:
            terminalreporter.write_line(f"{seconds:8.2f} s  {name}")
