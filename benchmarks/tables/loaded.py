"""What an environment of the default world loads up to its first observation: `python -m benchmarks.tables.loaded`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEFAULT_BUNDLE = Path("artifacts/realism/world")
_LOADS = """
import sys, gymnasium, minexplore
gymnasium.make("MineXplore/World-v0", world=sys.argv[1]).reset(seed=0)
print(*(module.__file__ for module in sys.modules.values() if getattr(module, "__file__", None)), sep="\\n")
"""


def loaded_modules(bundle: Path, root: Path = ROOT) -> dict[str, int]:
    """Return the lines of each module of `minexplore` that an environment of a world loads.

    Parameters
    ----------
    bundle : Path
        Absolute.
    root : Path
        Absolute; the folder that `minexplore` is in.

    Returns
    -------
    dict of int by name
        Empty if no environment can be made; the reason is printed to standard error.
    """
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, "-c", _LOADS, str(bundle)], cwd=root, env=environment, stdout=subprocess.PIPE, text=True
    )
    files = [Path(line) for line in done.stdout.splitlines()]
    own = sorted(file for file in files if file.suffix == ".py" and file.is_relative_to(root / "minexplore"))
    return {module_of(file.relative_to(root).as_posix()): file.read_text().count("\n") for file in own}


def module_of(path: str) -> str:
    """Return the name of a module by its path."""
    return path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")


def main() -> None:
    """Print the lines of each module, and of all."""
    loaded = loaded_modules(ROOT / DEFAULT_BUNDLE)
    for name, lines in loaded.items():
        print(f"{lines:6,} {name}")
    print(f"{sum(loaded.values()):6,} in {len(loaded)} modules")


if __name__ == "__main__":
    main()
