"""List every installed package with version and licence as CycloneDX: `python -m benchmarks sbom`.

The project's version is dynamic, and CycloneDX reads static ones only. So it gets a copy of `pyproject.toml` that
states the version.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import minexplore

OUT = Path("artifacts/sbom.json")
_DYNAMIC = 'dynamic = ["version"]'


def stated(pyproject: str, version: str) -> str:
    """Return the text of a `pyproject.toml` with its version stated.

    Raises
    ------
    ValueError
        If its version is not dynamic.
    """
    if pyproject.count(_DYNAMIC) != 1:
        raise ValueError(f"pyproject.toml: want one line {_DYNAMIC}")
    return pyproject.replace(_DYNAMIC, f'version = "{version}"')


def main() -> int:
    """Write the list for the Python that runs this, with the project at its root; return CycloneDX's exit code."""
    OUT.parent.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder:
        project = Path(folder) / "pyproject.toml"
        project.write_text(stated(Path("pyproject.toml").read_text(), minexplore.__version__))
        words = ["environment", "--pyproject", str(project), "--output-reproducible", "-o", str(OUT), sys.executable]
        return subprocess.run([sys.executable, "-m", "cyclonedx_py", *words], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
