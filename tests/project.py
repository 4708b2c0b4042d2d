"""Copies of the project in which tests run commands."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.forked import run_forked

ROOT = Path(__file__).resolve().parents[1]
STATED = ROOT.parent / "shared/data/turn4"  # files that state something beside their coordinates

TINY_STATIONS = """leg,station,easting_m,northing_m,left_m,right_m
A,a0,0,0,2.5,2.5
A,a1,10,0,2.5,2.5
A,a2,30,0,2.5,2.5
A,a3,60,0,2.5,2.5
B,a2,30,0,2.5,2.5
B,b1,30,12,2.5,2.5
B,b2,30,30,2.5,2.5
"""

# What no command changes in place: a copy links these files, as the disk needs longer for new files than for names.
_LINKED = ("baselines", "benchmarks", "docs", "tests", "minexplore/**/__pycache__", "pipeline/**/__pycache__")

Run = Callable[..., subprocess.CompletedProcess]


def modules_below(package: str) -> list[Path]:
    """Return the modules of a package, without the tests that stand beside them."""
    return [path for path in sorted((ROOT / package).rglob("*.py")) if path.relative_to(ROOT).parts[1] != "tests"]


def _project_files() -> list[str]:
    """Return the paths of the project's files, also of those that git does not know yet."""
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    return [name for name in listed if (ROOT / name).is_file()]


def _compiled() -> list[str]:
    """Return the paths of what Python has compiled: each copy would compile 600 modules anew."""
    packages = ("minesurveys", "minexplore", "pieces", "pipeline", "stages", "baselines", "benchmarks")
    found = (path for name in packages for path in (ROOT / name).rglob("__pycache__/*.pyc"))
    return [path.relative_to(ROOT).as_posix() for path in found]


def _objects_of_checkout() -> str:
    """Return the line with the folder in which git keeps the checkout's objects."""
    command = ["git", "rev-parse", "--path-format=absolute", "--git-path", "objects"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


class Project:
    """A copy of the project's files, with the embedded survey or a small one."""

    def __init__(self, folder: Path, tiny: bool) -> None:
        """Copy the project into `folder` and make it a git repository; `tiny` selects the small survey."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        names = "\0".join([*_project_files(), *_compiled()])
        command = ["xargs", "-0", "cp", "-a", "--parents", "-t", str(folder)]
        subprocess.run(command, cwd=ROOT, input=names, text=True, check=True)
        (folder / ".venv").symlink_to(Path(sys.prefix))
        (folder / "dvc.lock").unlink(missing_ok=True)
        if tiny:
            self.use_stations(TINY_STATIONS)
            self.coarsen()
        self.run("git", "init", "-q")
        # Git looks for what is committed in the checkout, too: 40 MB that neither this nor any copy of it holds.
        (folder / ".git/objects/info/alternates").write_text(_objects_of_checkout())
        self.run("git", "-c", "core.compression=0", "add", "-A")
        self.run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "start")

    def use_stations(self, text: str) -> None:
        """Make `text` the default survey and register it."""
        path = self.folder / "data" / "chilean_mine" / "tiny.csv"
        path.write_text(text)
        registry = self.folder / "data" / "registry.txt"
        kept = [line for line in registry.read_text().splitlines() if not line.startswith("chilean_mine/tiny.csv")]
        registry.write_text("\n".join(kept) + "\n")
        self.module("pipeline", "register", "data/chilean_mine/tiny.csv").check_returncode()
        conf = self.folder / "conf" / "survey" / "stations.yaml"
        set_values(
            conf,
            {
                "stations": "data/chilean_mine/tiny.csv",
                "frame_m": None,
                "margin_m": 12.0,
                "entrance_m": [5.0, 0.0],
                "labels_m": {"A": [10, 12]},  # clear of the drift: what a text covers is rock
                "scale": {"source": "bar", "bar_length_m": 20.0},
            },
        )

    def coarsen(self) -> None:
        """Use a coarse rock mesh, small pictures and few samples, without the limits that need a fine mesh."""
        relief = {"surface.rough.spacing_m": 0.3, "surface.rough.roof_spacing_m": 0.4, "validation.limits": {}}
        samples = {"texture.points_per_m2": 200, "certificate.contacts": 100}
        files: dict[str, dict[str, Any]] = {
            "rock/andesite.yaml": relief,
            "mine/limits/andesite.yaml": {"validation.limits": {}},
            "look/dry.yaml": {"surface.texture.size_px": 128},
            "realism/default.yaml": {"preview_width_px": 400},
            "validation/default.yaml": {**samples, "limits.texture": None, "limits.walls": None},
        }
        for name, values in files.items():
            set_values(self.folder / "conf" / name, values)

    def copy(self, folder: Path) -> Project:
        """Copy this project, with its artifacts, into `folder`, which does not exist."""
        folder.mkdir(parents=True)
        linked = [str(path.relative_to(self.folder)) for name in _LINKED for path in self.folder.glob(name)]
        subprocess.run(["cp", "-al", "--parents", *linked, str(folder)], cwd=self.folder, check=True)
        subprocess.run(["cp", "-an", ".", str(folder)], cwd=self.folder, check=True)
        return Project.at(folder)

    @classmethod
    def at(cls, folder: Path) -> Project:
        """Return the project that already is in `folder`."""
        project = cls.__new__(cls)
        project.folder = folder
        return project

    def run(self, *command: str, check: bool = False, **env: str) -> subprocess.CompletedProcess:
        """Run a command in the project, with the environment's tools first on the path and without PYTHONPATH."""
        variables = {**os.environ, "PATH": f"{Path(sys.prefix) / 'bin'}:{os.environ['PATH']}", **env}
        variables.pop("PYTHONPATH", None)
        return subprocess.run(
            list(command), cwd=self.folder, env=variables, capture_output=True, text=True, check=check
        )

    def stage(self, name: str, *overrides: str, **env: str) -> subprocess.CompletedProcess:
        """Run one stage, in a new interpreter if it needs environment variables."""
        if env:
            return self.run(sys.executable, "-m", f"stages.{name}", *overrides, check=False, **env)
        return self.module(f"stages.{name}", *overrides)

    def module(self, name: str, *arguments: str, **env: str) -> subprocess.CompletedProcess:
        """Run a module as `python -m` does, without the time that its imports take.

        Variables of `env` are those that the module reads; libraries have read theirs before.
        """
        return run_forked(name, arguments, self.folder, env)

    def stages(self, *names: str) -> None:
        """Compose the parameters and run stages; raise if one fails."""
        self.module("pipeline.compose").check_returncode()
        for name in names:
            self.stage(name).check_returncode()

    def hashes(self) -> dict[str, bytes]:
        """Return the bytes of every artifact by name."""
        base = self.folder / "artifacts"
        return {p.relative_to(base).as_posix(): p.read_bytes() for p in sorted(base.rglob("*")) if p.is_file()}


def set_values(path: Path, values: dict[str, Any]) -> None:
    """Set values of a YAML file by dotted keys; raise KeyError for a key that the file does not have."""
    text = path.read_text()
    package = "".join(line for line in text.splitlines(True) if line.startswith("# @package"))
    content = yaml.safe_load(text)
    for key, value in values.items():
        *sections, last = key.split(".")
        section = content
        for name in sections:
            section = section[name]
        if last not in section:
            raise KeyError(f"{path}: no {key}")
        section[last] = value
    path.write_text(package + yaml.safe_dump(content, sort_keys=False))


def message_of(done: subprocess.CompletedProcess) -> str:
    """Return the message of a command that refused its input with exit code 2."""
    assert done.returncode == 2, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr.strip()


def shared_file(name: str) -> Path:
    """Return the path of a shared file; without it the test is skipped."""
    if not (STATED / name).exists():
        pytest.skip(f"../shared/data/turn4/{name} is missing")
    return STATED / name


def eventually(holds: Callable[[], bool], within_s: float = 120) -> bool:
    """Return whether a condition comes to hold within a time."""
    end = time.monotonic() + within_s
    while not holds() and time.monotonic() < end:
        time.sleep(0.05)
    return holds()


def is_running(pid: int) -> bool:
    """Return whether a process runs; one that ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
