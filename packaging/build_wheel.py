"""Build the environment's wheel with the default world inside, after the chain of its manifests was checked."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from minexplore.page import page
from minexplore.world import DEFAULT_WORLD
from pipeline.compose import compose
from pipeline.errors import ArtifactError, MineError
from pipeline.places import COMPOSED
from pipeline.store.verify import verify_chain

WORLD, DIST = Path("artifacts/realism/world"), Path("dist")


def main() -> int:
    """Stage the package in a folder of its own and build it there."""
    try:
        require_default_world()
    except MineError as error:
        print(f"wheel: {error}; run `make all` without OVERRIDES first", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree("minexplore", folder / "minexplore", ignore=shutil.ignore_patterns("__pycache__", "worlds"))
        shutil.copytree(WORLD, folder / "minexplore" / "worlds" / DEFAULT_WORLD)
        shutil.copy2("packaging/pyproject.toml", folder)
        shutil.copy2("LICENSE", folder)
        (folder / "README.md").write_text(with_absolute_links(page()))
        done = subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(DIST.resolve())],
            cwd=folder,
            capture_output=True,
            text=True,
        )
    if done.returncode:
        print(f"wheel: {done.stderr.strip() or done.stdout.strip()}", file=sys.stderr)
        return 2
    wheel = max(DIST.glob("minexplore-*.whl"), key=lambda p: p.stat().st_mtime)
    print(f"{wheel}  {wheel.stat().st_size / 1e6:.1f} MB")
    return 0


def require_default_world() -> None:
    """Check that `artifacts/` holds the default world and nothing else.

    The composed parameters must be those without overrides, and the chain of manifests from the survey to the world
    must hold for these parameters, the tracked survey and the present code.

    Raises
    ------
    MineError
        Naming the first parameter that differs, or the first broken link.
    """
    if not COMPOSED.is_file():
        raise ArtifactError(f"{COMPOSED}: missing")
    built = dict(_values(json.loads(COMPOSED.read_bytes())))
    default = dict(_values(compose([]).model_dump(mode="json")))
    for name in [*default, *built]:
        if built.get(name) != default.get(name):
            raise ArtifactError(
                f"{COMPOSED}: {name} = {built.get(name)}, the default world has {default.get(name)}; "
                f"the wheel holds the default world only"
            )
    verify_chain(Path())


def with_absolute_links(text: str) -> str:
    """Return Markdown whose links to other pages of `docs/` lead to the repository; an index shows no other files."""
    urls = tomllib.loads(Path("packaging/pyproject.toml").read_text())["project"]["urls"]
    return re.sub(r"\]\((?!https?:|#|/)([^)]+)\)", rf"]({urls['Repository']}/blob/main/docs/\1)", text)


def _values(section: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each value of nested sections with its dotted name."""
    if not isinstance(section, dict):
        yield name, section
        return
    for key, value in section.items():
        yield from _values(value, f"{name}.{key}" if name else str(key))


if __name__ == "__main__":
    sys.exit(main())
