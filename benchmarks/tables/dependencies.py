"""The page of the dependencies: each package that `pyproject.toml` names, its lock, the newest, and why it is older.

It asks the package index by `pip index versions`. Exit code 1 if a package is older without a reason.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

PAGE = Path("requirements/README.md")
_LOCKS = ("dev", "baselines", "gpu", "witness")
_NAME = re.compile(r"^[A-Za-z0-9._-]+")
_LOCKED = re.compile(r"^([A-Za-z0-9._-]+)==([^ ;\\]+)", re.MULTILINE)
_WARP = "MuJoCo Warp follows MuJoCo's minor version"
REASONS = {  # why a package is not locked at its newest version
    "gymnasium": "`baselines`, as Ray 2.60 pins 1.2.2, and `gpu`, which may share its environment",
    "mujoco": "4.0.0's Newton solver is wrong with a sparse Jacobian; "
    "[decision 31](../docs/adr/0031-mujoco-4.md) has what 4 needs here",
    "mujoco-warp": _WARP,
    "opencv-python-headless": "5.0.0 makes the same default world, but draws words and lines with other pixels: the "
    "plan of stage 1 and the tests of drawings, which it letters, would change",
    "pillow": "moviepy wants less than 12",
    "torch": "pinned by `pyproject.toml`; trained policies were made with it",
}
_HEAD = """# Locks

`dev.txt` is the lock of `make setup`; `baselines.txt` and `gpu.txt` have all that it has, in versions that go with Ray,
or with MuJoCo Warp and torch. `witness.txt` is of an environment of its own: libraries of others that tests compare
with (`make setup-witness`). `make lock` renews them, and `python -m benchmarks dependencies` this page.

| package | asked for | locked | newest | why not the newest |
|---|---|---|---|---|
"""


def asked() -> dict[str, str]:
    """Return the packages that `pyproject.toml` names, by name in lower case, with the versions it allows."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"].values()
    groups = [project["project"]["dependencies"], *extras, *project["dependency-groups"].values()]
    found: dict[str, set[str]] = {}
    for line in (line for group in groups for line in group):
        name = _NAME.match(line)[0]  # type: ignore[index]
        found.setdefault(name.lower(), set()).add(re.sub(r"^\[[^]]*\]", "", line[len(name) :]).strip())
    return {name: " or ".join(sorted(filter(None, limits))) for name, limits in sorted(found.items())}


def locked() -> dict[str, list[str]]:
    """Return the versions of each package in the locks, the newest Python's last."""
    found: dict[str, list[str]] = {}
    for lock in _LOCKS:
        for name, version in _LOCKED.findall((ROOT / "requirements" / f"{lock}.txt").read_text()):
            versions = found.setdefault(name.lower(), [])
            versions.extend(() if version in versions else (version,))
    return found


def newest(name: str) -> str:
    """Return the newest version of a package for this Python that the index has."""
    command = [sys.executable, "-m", "pip", "index", "versions", "--disable-pip-version-check", name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = re.match(r"\S+ \(([^)]+)\)", done.stdout)
    return found[1] if found else ""


def rows() -> list[tuple[str, str, str, str, str]]:
    """Return the rows of the table: name, versions asked for, locked and newest, and the reason where it is older."""
    locks, found = locked(), []
    for name, limits in asked().items():
        last, versions = newest(name), locks.get(name, [])
        is_old = bool(last) and any(version != last for version in versions or [limits.removeprefix("==")])
        found.append((name, limits, ", ".join(versions), last, REASONS.get(name, "") if is_old else ""))
    return found


def main() -> int:
    """Write the page; exit code 1 if a package is older than the newest and no reason is stated."""
    table = rows()
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in table]
    (ROOT / PAGE).write_text(_HEAD + "\n".join(lines) + "\n")
    old = [row[0] for row in table if row[3] and row[2] and row[3] not in row[2].split(", ") and not row[4]]
    print(f"{len(table)} packages in {PAGE}; older than the newest without a reason: {', '.join(old) or 'none'}")
    return int(bool(old))


if __name__ == "__main__":
    sys.exit(main())
