"""How large the project is at two commits: lines, classes, constants and the fullest folder."""

from __future__ import annotations

import argparse
import ast
import io
import subprocess
import sys
import tarfile
from collections import Counter
from collections.abc import Mapping
from pathlib import PurePosixPath

from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table

BEFORE = "6cab59b8"
PRODUCT = ("pipeline", "stages", "minesurveys", "minexplore", "pieces", "baselines", "benchmarks")


def modules_at(commit: str) -> dict[str, str]:
    """Return the texts of the modules of a commit of this repository, by their paths.

    Raises
    ------
    BaselineError
        If it has no such commit, as in a clone without history.
    """
    packed = subprocess.run(["git", "archive", commit], capture_output=True)
    if packed.returncode:
        raise BaselineError(f"{commit}: not a commit of this clone; `git fetch --unshallow`, or --before COMMIT")
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        found = ((member.name, archive.extractfile(member)) for member in archive if member.name.endswith(".py"))
        return {name: stream.read().decode() for name, stream in found if stream is not None}


def package_of(path: str) -> str:
    """Return the package of a module; tests that stand beside a package are of `tests`."""
    parts = path.split("/")
    return "tests" if "tests" in parts[:2] else parts[0]


def figures_of(texts: Mapping[str, str]) -> dict[str, int]:
    """Return the figures of a project by their names; its modules are given by their paths."""
    lines, folders = Counter[str](), Counter[str]()
    product = {path: text for path, text in texts.items() if package_of(path) in PRODUCT}
    for path, text in texts.items():
        lines[package_of(path)] += text.count("\n")
        folders[PurePosixPath(path).parent.as_posix()] += not path.endswith("__init__.py")
    trees = [ast.parse(text) for text in product.values()]
    return {
        **{f"lines of `{package}/`": lines[package] for package in (*PRODUCT, "tests")},
        "lines of all but `tests/`": sum(lines[package] for package in PRODUCT),
        "classes": sum(isinstance(node, ast.ClassDef) for tree in trees for node in ast.walk(tree)),
        "module constants that are numbers": sum(_numbers_of(node) for tree in trees for node in tree.body),
        "most modules in a folder": max(folders.values()),
    }


def _numbers_of(node: ast.stmt) -> int:
    """Return how many constants of a statement are numbers."""
    if isinstance(node, ast.AnnAssign) and node.value is not None:
        return int(_is_number(node.value))
    if not isinstance(node, ast.Assign):
        return 0
    several = isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)
    return sum(map(_is_number, node.value.elts if several else [node.value]))  # type: ignore[attr-defined]


def _is_number(node: ast.expr) -> bool:
    """Return whether a value is a number, or arithmetic on numbers."""
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks layout", description=__doc__)
    parser.add_argument("--before", default=BEFORE, metavar="COMMIT")
    parser.add_argument("--after", default="HEAD", metavar="COMMIT")
    stated = parser.parse_args()
    before, after = figures_of(modules_at(stated.before)), figures_of(modules_at(stated.after))
    print(markdown_table(("", stated.before, stated.after), [(k, f"{before[k]:,}", f"{after[k]:,}") for k in after]))


if __name__ == "__main__":
    sys.exit(run_command("layout", main))
