"""One name, one thing: no class name twice in the packages."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from tests.project import ROOT

PACKAGES = ("pipeline", "stages", "minexplore", "baselines", "benchmarks")


def names_used_twice(modules: Iterable[Path]) -> dict[str, list[str]]:
    """Return the names of classes that stand in several places, private ones too, with these places."""
    places: dict[str, list[str]] = defaultdict(list)
    for path in modules:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path}:{node.lineno}")
    return {name: found for name, found in places.items() if len(found) > 1}


def test_no_class_name_is_used_twice():
    modules = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    assert not names_used_twice(modules)


def test_a_class_name_in_two_modules_is_found(tmp_path):
    for name in ("one.py", "two.py"):
        (tmp_path / name).write_text("class _Row:\n    pass\n")
    assert list(names_used_twice(sorted(tmp_path.iterdir()))) == ["_Row"]
