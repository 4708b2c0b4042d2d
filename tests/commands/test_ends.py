"""Real commands end in one line: at signals, on a full disk, and where nobody reads their output."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.project import ROOT, TINY_STATIONS

COMMANDS = {
    "pipeline": ["pipeline", "list"],
    "minexplore": ["minexplore", "list"],
    "stages": ["stages.survey", "survey=stations"],
    "baselines": ["baselines.score", "nowhere.jsonl"],
    "benchmarks": ["benchmarks"],
}
LOADED_LATE = {"pipeline": "shapely", "minexplore": "mujoco", "stages": "shapely", "baselines": "mujoco"}
FULL = Path("/dev/full")
SIGNALS = [signal.SIGINT, signal.SIGTERM]


def start(*words, folder=ROOT, **streams):
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=folder,
        env=environment,
        text=True,
        start_new_session=True,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
    )


def wait_for(process, is_reached):
    """Wait until something has happened, or the process has ended."""
    while process.poll() is None and not is_reached():
        time.sleep(0.005)


def has_loaded(process, name):
    """Return whether a process has opened a library."""
    with contextlib.suppress(OSError):
        return name in (ROOT / f"/proc/{process.pid}/maps").read_text()
    return False


def processes_of_group(group):
    """Return the processes of a group that run."""
    found = []
    for entry in os.scandir("/proc"):
        if entry.name.isdigit():
            with contextlib.suppress(OSError, ProcessLookupError):
                if os.getpgid(int(entry.name)) == group:
                    found.append(int(entry.name))
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("kind", SIGNALS)
@pytest.mark.parametrize("name", LOADED_LATE)
def test_a_command_that_is_interrupted_while_it_loads_ends_in_one_line(name, kind):
    library = "numpy" if kind == signal.SIGINT else LOADED_LATE[name]
    process = start(*COMMANDS[name])
    wait_for(process, lambda: has_loaded(process, library))
    process.send_signal(kind)
    _, text = process.communicate(timeout=60)
    if process.returncode in (0, 2):
        pytest.skip("it had ended before the signal came")
    assert process.returncode == 130, text
    assert ": interrupted" in f": {text}"
    assert text.count("\n") == 1


@pytest.mark.parametrize("name", ["pipeline", "minexplore", "benchmarks"])
def test_a_full_disk_under_the_output_is_one_line(name):
    if not FULL.exists():
        pytest.skip("no /dev/full on this system")
    with FULL.open("w") as full:
        process = start(*COMMANDS[name], stdout=full)
        _, text = process.communicate(timeout=60)
    assert process.returncode == 2, text
    assert text.endswith("No space left on device\n")
    assert text.count("\n") == 1


@pytest.mark.parametrize("name", ["pipeline", "minexplore", "benchmarks"])
def test_a_reader_that_goes_away_ends_a_command_in_one_line(name):
    reading, writing = os.pipe()
    os.close(reading)
    process = start(*COMMANDS[name], stdout=writing)
    os.close(writing)
    _, text = process.communicate(timeout=60)
    assert process.returncode == 141, text
    assert text.endswith("nobody reads its output any more\n")
    assert text.count("\n") == 1


def test_a_command_whose_messages_nobody_reads_ends_with_its_code():
    reading, writing = os.pipe()
    os.close(reading)
    process = start("pipeline", "show", "nowhere", stderr=writing)
    os.close(writing)
    process.communicate(timeout=60)
    assert process.returncode == 2


@pytest.fixture
def small_disk(tmp_path):
    """Return a folder on a file system of its own with 64 kB, or skip the test."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True).returncode:
        pytest.skip("only root may mount a file system, and not in every container")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_recording_on_a_full_disk_is_one_line_and_leaves_nothing(small_disk, small_world):
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed (extra `record`)")
    words = ("record", "World", "--world", str(small_world), "--sensors", "depth", "--steps", "3")
    process = start("minexplore", *words, "--out", str(small_disk / "a.mcap"))
    _, text = process.communicate(timeout=120)
    assert process.returncode == 2, text
    assert text == f"record: out = '{small_disk / 'a.mcap'}': cannot be written (No space left on device)\n"
    assert list(small_disk.iterdir()) == []


@pytest.mark.parametrize("kind", SIGNALS)
def test_an_interrupted_recording_is_one_line_and_leaves_nothing(tmp_path, small_world, kind):
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed (extra `record`)")
    words = ("record", "World", "--world", str(small_world), "--sensors", "imu", "--steps", "100000")
    process = start("minexplore", *words, "--out", str(tmp_path / "a.mcap"))
    wait_for(process, lambda: any(tmp_path.iterdir()))
    process.send_signal(kind)
    _, text = process.communicate(timeout=60)
    assert process.returncode == 130, text
    assert text == "record: interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", SIGNALS)
def test_a_build_that_is_interrupted_is_one_line_and_goes_on(unbuilt, tmp_path, kind):
    project = unbuilt.copy(tmp_path / "mine")
    (project.folder / "own.csv").write_text(TINY_STATIONS)
    world = project.folder / "artifacts/worlds/own"
    words = ("pipeline", "new", "own", "--from", "own.csv", "preset=light")
    process = start(*words, folder=project.folder)
    wait_for(process, lambda: (world / "realism/manifest.json").exists())
    os.killpg(process.pid, kind)
    _, text = process.communicate(timeout=120)
    assert process.returncode == 130, text
    assert text == "new: interrupted\n"
    assert processes_of_group(process.pid) == []
    listed = start("minexplore", "list", folder=project.folder)
    assert "`python -m pipeline new own --from own.csv preset=light` ends it" in listed.communicate(timeout=60)[0]
    again = start(*words, folder=project.folder)
    _, text = again.communicate(timeout=300)
    assert again.returncode == 0, text
    listed = start("pipeline", "list", folder=project.folder)
    assert "unfinished" not in next(line for line in listed.communicate()[0].splitlines() if line.startswith("own"))
