"""One name, one thing: no class name twice in the packages, no test file twice; a skip names what is missing."""

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


def skips_without_reason(path: Path) -> list[str]:
    """Return the places of a module where tests are skipped and the report would not name what is missing."""
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    named = [(call, call.func.attr) for call in calls if isinstance(call.func, ast.Attribute)]
    skips = [(call, name == "skip" and call.args) for call, name in named if name in ("importorskip", "skipif", "skip")]
    bare = [call for call, text in skips if not (text or any(word.arg == "reason" for word in call.keywords))]
    return [f"{path}:{call.lineno}" for call in bare]


def test_every_skip_names_what_is_missing():
    places = [ROOT / "tests", *ROOT.glob("*/tests")]
    assert not [skip for place in places for path in place.rglob("*.py") for skip in skips_without_reason(path)]


def test_a_skip_without_a_reason_is_found(tmp_path):
    path = tmp_path / "test_a.py"
    path.write_text('pytest.importorskip("a")\npytest.skip("b")\npytest.mark.skipif(c, reason="d")\npytest.skip()\n')
    assert skips_without_reason(path) == [f"{path}:1", f"{path}:4"]


def test_no_two_test_files_have_one_name():
    files = [path for folder in (*PACKAGES, "tests") for path in (ROOT / folder).rglob("test_*.py")]
    twice = [name for name, count in Counter(path.name for path in files).items() if count > 1]
    assert not twice, "pytest imports one of them alone"


def test_a_class_name_in_two_modules_is_found(tmp_path):
    for name in ("one.py", "two.py"):
        (tmp_path / name).write_text("class _Row:\n    pass\n")
    assert list(names_used_twice(sorted(tmp_path.iterdir()))) == ["_Row"]
