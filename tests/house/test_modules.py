"""The size of modules and folders: 300 lines but for those that say why, and 15 modules."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tests.project import ROOT

PACKAGES = (
    *("minesurveys", "minexplore", "pieces", "pipeline", "stages"),
    *("baselines", "benchmarks", "examples", "packaging"),
)
MOST_LINES = 300
MOST_MODULES = 15  # of a folder, beside its __init__.py
LONGER = {  # and why
    "minexplore/bundle.py": "the contract of a bundle: every name that the pipeline and the environment share",
    "pipeline/mjcf/bundle.py": "what world.json states, beside its reading and sealing",
    "pipeline/types.py": "the types that stages hand on",
    "benchmarks/pictures/paper_drawing.py": "a drawing with all that surrounds workings on paper",
}


def modules_of(packages: Iterable[str]) -> list[Path]:
    """Return the modules of packages by their paths in the project."""
    found = (path.relative_to(ROOT) for package in packages for path in sorted((ROOT / package).rglob("*.py")))
    return [path for path in found if "__pycache__" not in path.parts and path.parts[1] != "tests"]


def crowded(modules: Iterable[Path]) -> dict[str, int]:
    """Return the folders that hold more than 15 modules, with their numbers."""
    counts = Counter(path.parent.as_posix() for path in modules if path.name != "__init__.py")
    return {folder: count for folder, count in counts.items() if count > MOST_MODULES}


def test_no_module_is_over_300_lines_but_the_listed_ones():
    lines = {path.as_posix(): len((ROOT / path).read_text().splitlines()) for path in modules_of(PACKAGES)}
    assert len(lines) > 500
    assert {path for path, count in lines.items() if count > MOST_LINES} == LONGER.keys()


def test_no_folder_has_more_than_fifteen_modules():
    assert not crowded(modules_of((*PACKAGES, "tests", "baselines/tests", "benchmarks/tests")))


def test_a_sixteenth_module_is_found():
    full = [Path(f"room/m{number}.py") for number in range(15)]
    assert not crowded([*full, Path("room/__init__.py"), Path("room/part/m15.py")])
    assert crowded([*full, Path("room/m15.py")]) == {"room": 16}
