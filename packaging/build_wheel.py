"""Build the environment's wheel with the default world inside, after the world's hashes were checked."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from minexplore.__main__ import page
from minexplore.bundle import BundleError, read_bundle

WORLD, DIST = Path("artifacts/realism/world"), Path("dist")


def main() -> int:
    """Stage the package in a folder of its own and build it there."""
    try:
        read_bundle(WORLD)
    except BundleError as error:
        print(f"wheel: {error}; run `make all` first", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree("minexplore", folder / "minexplore", ignore=shutil.ignore_patterns("__pycache__", "worlds"))
        shutil.copytree(WORLD, folder / "minexplore" / "worlds" / "chilean_mine")
        shutil.copy2("packaging/pyproject.toml", folder)
        shutil.copy2("LICENSE", folder)
        (folder / "README.md").write_text(page())
        done = subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(DIST.resolve())], cwd=folder,
            capture_output=True, text=True,
        )  # fmt: skip
    if done.returncode:
        print(f"wheel: {done.stderr.strip() or done.stdout.strip()}", file=sys.stderr)
        return 2
    wheel = max(DIST.glob("minexplore-*.whl"), key=lambda p: p.stat().st_mtime)
    print(f"{wheel}  {wheel.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
