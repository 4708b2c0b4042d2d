"""No module but `minexplore/bundle.py` spells a name, a file or a geom group of a bundle."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from minexplore import bundle
from tests.project import ROOT, modules_below

CONTRACT = ROOT / "minexplore/bundle.py"
# They break bundles, so they spell what no builder writes.
BREAKERS = re.compile(r"benchmarks/(fuzz|faults/)")
PREFIXES = {value for name, value in vars(bundle).items() if isinstance(value, str) and value.endswith(("_", "/"))}
FILES = {
    value
    for value in vars(bundle).values()
    if isinstance(value, str) and re.fullmatch(r"[a-z_0-9/]+\.(json|xml|npz|geojson|bt|yaml|png)", value)
}
NAMES = {bundle.OVERVIEW_CAMERA, bundle.ROOF_GEOM + "_", bundle.FORMAT}
_BEGINS = re.compile("|".join(rf"{re.escape(prefix)}(?:$|\\|\(|\{{|\d)" for prefix in sorted(PREFIXES)))
# Of a module that spells one; it is ten times as fast as to parse all modules.
_MAY_SPELL = re.compile(rf"group=\d|[\"'](?:{'|'.join(map(re.escape, sorted(PREFIXES | FILES | NAMES)))})")


def spelled(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the line and text of each literal of the contract in a module."""
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            first = node.values[0] if node.values else None
            if isinstance(first, ast.Constant) and _BEGINS.match(str(first.value)):
                yield node.lineno, str(first.value)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts:
            if node.value in FILES | NAMES or _BEGINS.match(node.value):
                yield node.lineno, node.value
        elif isinstance(node, ast.keyword) and node.arg == "group" and is_number(node.value):
            yield node.value.lineno, "group=NUMBER"


def is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def test_no_other_module_spells_what_the_contract_of_a_bundle_names():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {spelt}"
        for package in ("minesurveys", "minexplore", "pipeline", "stages", "baselines", "benchmarks")
        for path in modules_below(package)
        if path != CONTRACT and not BREAKERS.match(path.relative_to(ROOT).as_posix())
        if _MAY_SPELL.search(text := path.read_text())
        for line, spelt in spelled(ast.parse(text))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "text",
    [
        'f"ground_{zone}"',
        'r"spot_\\d{2,5}"',
        '"rock_0001"',
        'name.startswith("cover_")',
        'render(model, "overview")',
        'folder / "world.json"',
        'f"meshes/{name}.msh"',
        "add(group=3)",
    ],
)
def test_a_literal_of_the_contract_is_found(text):
    assert _MAY_SPELL.search(text)
    assert list(spelled(ast.parse(text)))
