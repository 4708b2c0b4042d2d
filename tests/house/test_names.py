"""One name, one thing: no class name twice in the packages, and no name of a test file twice."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path

from tests.project import ROOT, modules_below

PACKAGES = ("minesurveys", "pieces", "pipeline", "stages", "minexplore", "baselines", "benchmarks")
_CLASS = re.compile(r"^[ \t]*class[ \t]+(\w+)", re.MULTILINE)


def names_used_twice(modules: Iterable[Path]) -> dict[str, list[str]]:
    """Return the names of classes that stand in several places, private ones too, with these places."""
    texts = {path: path.read_text() for path in modules}
    lines = Counter(name for text in texts.values() for name in _CLASS.findall(text))
    places: dict[str, list[str]] = defaultdict(list)
    for path, text in texts.items():
        if any(lines[name] > 1 for name in _CLASS.findall(text)):  # the line may be one of a text
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.ClassDef):
                    places[node.name].append(f"{path}:{node.lineno}")
    return {name: found for name, found in places.items() if len(found) > 1}


def test_no_class_name_is_used_twice():
    modules = [path for package in PACKAGES for path in modules_below(package)]
    assert not names_used_twice(modules)


def test_no_two_test_files_have_one_name():
    files = [path for folder in (*PACKAGES, "tests") for path in (ROOT / folder).rglob("test_*.py")]
    twice = [name for name, count in Counter(path.name for path in files).items() if count > 1]
    assert not twice, "pytest imports one of them alone"


def test_a_class_name_in_two_modules_is_found(tmp_path):
    for name in ("one.py", "two.py"):
        (tmp_path / name).write_text("class _Row:\n    pass\n")
    assert list(names_used_twice(sorted(tmp_path.iterdir()))) == ["_Row"]
