"""One word, one thing: words that the project does not use, and names that state what a function does."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from tests.project import ROOT

PRODUCT = ("minesurveys", "pieces", "pipeline", "stages", "minexplore")
# A banned word and what to write instead.
BANNED = {
    r"(?i)(?<![a-z])(said|told)(?![a-z])": "warns, lists, refuses, states",
    r"(?<![a-z.])tells?(?![a-z(])": "warns, lists, gives",
    r"\bnone of which\b": "and none of them",
    r"\bgets? the limit\b|\band gets? \{": "is clamped to",
    r"\bdo(es)? not close by\b": "misclosure",
    r"^\s*\"\"\"Say\b": "Warn",
}
# *Sheet* is no word for a drawing, and no word for a floor. Data sheets and spreadsheets are what others call so.
SHEET = r"(?i)(?<!data[ _-])(?<!spread)sheet(?! 3 of 7)"
WHOLE = (*PRODUCT, "baselines", "benchmarks", "docs/adr/0016-workings-on-drawings.md")
PICTURES = {"Image", "Figure", "str", "None", "tuple[Image, tuple[int, int, int, int]]", "tuple[int, int, int, int]"}


def files(names: Iterable[str]) -> Iterator[Path]:
    """Yield the Python, Markdown and YAML files at these names."""
    for name in names:
        path = ROOT / name
        found = [path] if path.is_file() else sorted(path.rglob("*.*"))
        plain = (file for file in found if file.suffix in (".py", ".md", ".yaml"))
        yield from (file for file in plain if file.relative_to(ROOT).parts[1:2] != ("tests",))


def lines_with(pattern: str, text: str) -> list[int]:
    return [number for number, line in enumerate(text.splitlines(), 1) if re.search(pattern, line)]


def painters_that_return_no_picture(text: str) -> list[str]:
    """Return the functions `draw_*` of a module that return something else than a picture, or what they drew into."""
    named = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef) and re.match(r"_?draw_", n.name)]
    plain = [node for node in named if not any(isinstance(d, ast.Name) for d in node.decorator_list)]
    return [node.name for node in plain if node.returns is None or ast.unparse(node.returns) not in PICTURES]


@pytest.mark.parametrize(("pattern", "instead"), BANNED.items())
def test_no_banned_word_stands_in_the_product_or_its_docs(pattern, instead):
    named = (*PRODUCT, "minesurveys/limits.yaml", "docs/how-to", "docs/reference", "docs/start.md", "docs/security.md")
    found = [
        f"{path.relative_to(ROOT)}:{line}" for path in files(named) for line in lines_with(pattern, path.read_text())
    ]
    assert not found, f"{found}: write {instead}"


def test_a_drawing_on_paper_is_no_sheet():
    found = [
        f"{path.relative_to(ROOT)}:{line}" for path in files(WHOLE) for line in lines_with(SHEET, path.read_text())
    ]
    assert not found


def test_functions_that_draw_return_pictures():
    found = {
        path.relative_to(ROOT): names
        for path in files(PRODUCT)
        if path.suffix == ".py" and (names := painters_that_return_no_picture(path.read_text()))
    }
    assert not found
