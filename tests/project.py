"""Copies of the project to run commands in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]

TINY_STATIONS = """leg,station,easting_m,northing_m,left_m,right_m
A,a0,0,0,2.5,2.5
A,a1,10,0,2.5,2.5
A,a2,30,0,2.5,2.5
A,a3,60,0,2.5,2.5
B,a2,30,0,2.5,2.5
B,b1,30,12,2.5,2.5
B,b2,30,30,2.5,2.5
"""

Run = Callable[..., subprocess.CompletedProcess]


class Project:
    """A copy of the tracked files, with a small survey in place of the embedded one."""

    def __init__(self, folder: Path, tiny: bool) -> None:
        """Copy the project into `folder` and make it a git repository of its own."""
        self.folder = folder
        files = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.splitlines()
        for name in files:
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        (folder / ".venv").symlink_to(Path(sys.prefix))
        (folder / "dvc.lock").unlink(missing_ok=True)
        if tiny:
            self.use_stations(TINY_STATIONS)
            self.coarsen()
        self.run("git", "init", "-q")
        self.run("git", "add", "-A")
        self.run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "start")

    def use_stations(self, text: str) -> None:
        """Make `text` the default survey and register it."""
        path = self.folder / "data" / "chilean_mine" / "tiny.csv"
        path.write_text(text)
        registry = self.folder / "data" / "registry.txt"
        kept = [line for line in registry.read_text().splitlines() if not line.startswith("chilean_mine/tiny.csv")]
        registry.write_text("\n".join(kept) + "\n")
        self.run(sys.executable, "-m", "pipeline", "register", "data/chilean_mine/tiny.csv", check=True)
        conf = self.folder / "conf" / "survey" / "stations.yaml"
        set_values(
            conf,
            {
                "stations": "data/chilean_mine/tiny.csv",
                "frame_m": None,
                "margin_m": 12.0,
                "entrance_m": [5.0, 0.0],
                "labels_m": {"A": [10, 8]},
                "scale": {"source": "bar", "bar_length_m": 20.0},
            },
        )

    def coarsen(self) -> None:
        """Lay the rock's mesh wide and sample it thinly; the texture limits, the default's own, are left out."""
        surface, validation = (self.folder / "conf" / name / "default.yaml" for name in ("surface", "validation"))
        set_values(surface, {"rough.spacing_m": 0.3, "rough.roof_spacing_m": 0.4})
        coarse = {"texture.points_per_m2": 200, "certificate.contacts": 100}
        set_values(validation, {**coarse, "limits.texture": None, "limits.walls": None})

    def copy(self, folder: Path) -> Project:
        """Return a private copy, artifacts included."""
        shutil.copytree(self.folder, folder, symlinks=True)
        return Project.at(folder)

    @classmethod
    def at(cls, folder: Path) -> Project:
        """Return a copy that is there already."""
        project = cls.__new__(cls)
        project.folder = folder
        return project

    def run(self, *command: str, check: bool = False, **env: str) -> subprocess.CompletedProcess:
        """Run a command in the project with its own imports and the environment's tools first on the path."""
        variables = {**os.environ, "PATH": f"{Path(sys.prefix) / 'bin'}:{os.environ['PATH']}", **env}
        variables.pop("PYTHONPATH", None)
        return subprocess.run(
            list(command), cwd=self.folder, env=variables, capture_output=True, text=True, check=check
        )

    def stage(self, name: str, *overrides: str, **env: str) -> subprocess.CompletedProcess:
        """Run one stage."""
        return self.run(sys.executable, "-m", f"stages.{name}", *overrides, **env)

    def stages(self, *names: str) -> None:
        """Compose and run stages, all of which must succeed."""
        self.run(sys.executable, "-m", "pipeline.compose", check=True)
        for name in names:
            self.stage(name).check_returncode()

    def hashes(self) -> dict[str, bytes]:
        """Return every artifact's bytes by name."""
        base = self.folder / "artifacts"
        return {p.relative_to(base).as_posix(): p.read_bytes() for p in sorted(base.rglob("*")) if p.is_file()}


def set_values(path: Path, values: dict[str, Any]) -> None:
    """Set values of a YAML file by their dotted keys; a key that the file does not have is a `KeyError`."""
    text = path.read_text()
    package = "".join(line for line in text.splitlines(True) if line.startswith("# @package"))
    held = yaml.safe_load(text)
    for key, value in values.items():
        *sections, last = key.split(".")
        section = held
        for name in sections:
            section = section[name]
        if last not in section:
            raise KeyError(f"{path}: no {key}")
        section[last] = value
    path.write_text(package + yaml.safe_dump(held, sort_keys=False))


def message_of(done: subprocess.CompletedProcess) -> str:
    """Return the one message of a refused command."""
    assert done.returncode == 2, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr.strip()
