"""Bring the default world up to date: `python -m pipeline.reproduce [STAGE]` sets `$OVERRIDES` and runs `dvc repro`.

DVC takes two seconds to load. It is not started if every command, file and parameter is as `dvc.lock` states it.
"""

from __future__ import annotations

import hashlib
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

from pipeline.commands.maintenance import set_overrides
from pipeline.errors import run_command
from pipeline.prepared import prepared

_DAG, _LOCK, _CACHE = Path("dvc.yaml"), Path("dvc.lock"), Path(".dvc/cache/files/md5")
_SCHEMA = "2.0"  # of the lock
_FIELDS = {"desc", "cmd", "deps", "params", "outs", "metrics"}  # of a stage; another one may mean anything
_FLAGS = {"persist", "cache"}  # of an output


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Reads 2e-05, as DVC writes it, as a number."""


_Loader.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(r"[-+]?\d+[eE][-+]?\d+$"), list("-+0123456789"))


def is_reproduced() -> bool:
    """Return whether nothing differs from `dvc.lock`: commands, parameters, and md5 of all inputs and outputs.

    Outputs must be in DVC's cache, too. What this cannot read counts as a difference, so that DVC decides.
    """
    project = _Project()
    try:
        stages, lock = project.read(_DAG)["stages"], project.read(_LOCK)
        return (
            lock["schema"] == _SCHEMA
            and stages.keys() == lock["stages"].keys()
            and all(project.state(stage) == _locked(lock["stages"][name]) for name, stage in stages.items())
        )
    except (OSError, yaml.YAMLError, LookupError, TypeError, ValueError, AttributeError):
        return False


class _Project:
    """The project's files; each is read once."""

    def __init__(self) -> None:
        self._md5: dict[Path, str] = {}
        self._content: dict[Path, Any] = {}

    def read(self, path: Path) -> Any:
        """Return the content of a file of YAML or JSON."""
        if path not in self._content:
            data = path.read_bytes()
            self._content[path] = json.loads(data) if path.suffix == ".json" else yaml.load(data, _Loader)
        return self._content[path]

    def state(self, stage: dict[str, Any]) -> dict[str, Any]:
        """Return what the lock would hold of a stage if it ran now.

        Raises
        ------
        LookupError
            If the stage or an output has a field that is not known here, or an output is not in the cache.
        """
        outputs = {path: flags for out in (*stage["outs"], *stage.get("metrics", ())) for path, flags in out.items()}
        if not stage.keys() <= _FIELDS or any(not flags.keys() <= _FLAGS for flags in outputs.values()):
            raise LookupError
        if not all(self._is_cached(Path(path)) for path, flags in outputs.items() if flags.get("cache", True)):
            raise LookupError
        of_file = [entry if isinstance(entry, dict) else {"params.yaml": [entry]} for entry in stage.get("params", ())]
        params = {
            file: {key: self.read(Path(file))[key] for key in keys} for of in of_file for file, keys in of.items()
        }
        return {
            "cmd": stage["cmd"],
            "deps": {path: self._md5_of(Path(path)) for path in stage["deps"]},
            "params": _text(params),
            "outs": {path: self._md5_of(Path(path)) for path in outputs},
        }

    def _md5_of(self, path: Path) -> str:
        """Return the md5 of a file, or of a folder as DVC defines it: that of the list of its files."""
        if path not in self._md5:
            if path.is_dir():
                files = {file.relative_to(path).as_posix(): self._md5_of(file) for file in _files(path)}
                listed = json.dumps([{"md5": files[name], "relpath": name} for name in sorted(files)]).encode()
                self._md5[path] = hashlib.md5(listed, usedforsecurity=False).hexdigest() + ".dir"
            else:
                self._md5[path] = hashlib.md5(path.read_bytes(), usedforsecurity=False).hexdigest()
        return self._md5[path]

    def _is_cached(self, path: Path) -> bool:
        """Return whether DVC's cache has the content of a file, or of a folder with all its files."""
        names = map(self._md5_of, [path, *_files(path)])
        return all((_CACHE / name[:2] / name[2:]).is_file() for name in names)


def _files(folder: Path) -> list[Path]:
    """Return the files below a folder, without compiled modules, which `.dvcignore` names; none below a file."""
    return [path for path in folder.rglob("*") if path.parent.name != "__pycache__" and path.is_file()]


def _locked(stage: dict[str, Any]) -> dict[str, Any]:
    return {
        "cmd": stage["cmd"],
        "deps": {file["path"]: file["md5"] for file in stage["deps"]},
        "params": _text(stage.get("params", {})),
        "outs": {file["path"]: file["md5"] for file in stage["outs"]},
    }


def _text(params: dict[str, Any]) -> str:
    """Return parameters as text, in which 1, 1.0 and true differ."""
    return json.dumps(params, sort_keys=True)


def main() -> int:
    """Set the overrides, and run DVC where something differs; return the exit code."""
    code = run_command("set-overrides", set_overrides)
    if code:
        return code
    if is_reproduced():
        print("Data and pipelines are up to date.")
        return 0
    sys.stdout.flush()
    with prepared(whole=not sys.argv[1:]) as environment:
        dvc = subprocess.Popen([sys.executable, "-m", "dvc", "repro", *sys.argv[1:]], env=environment)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # DVC and the stage get it, too, and end as they do alone
        return dvc.wait()


if __name__ == "__main__":
    sys.exit(main())
