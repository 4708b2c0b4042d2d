"""The project's layout at two commits: modules a folder, lines, names, and the way of three artifacts.

`python -m benchmarks layout` compares the commit before the folders were cut with the present one.
"""

from __future__ import annotations

import argparse
import ast
import io
import subprocess
import sys
import tarfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table, write_table
from benchmarks.tables.loaded import DEFAULT_BUNDLE, loaded_modules, module_of
from pipeline.store.hashing import import_closure
from stages.__main__ import STAGES

BEFORE = "9d8be4aa"  # the last commit before the folders were cut
PAGE = Path("docs/evidence/parts/layout.md")
PRODUCT = ("minesurveys", "minexplore", "pipeline", "stages", "baselines")
MOST_MODULES = 15
ARTIFACTS = {"plan": {"plan"}, "topology": {"topology", "DriftNetwork"}, "free_space": {"free_space", "FreeSpace"}}


@dataclass(frozen=True)
class Way:
    """What names an artifact on its way through the stages.

    `modules` and `folders` are their numbers; `returns` is how often a stage enters a folder that the stage before it
    did not enter and an earlier one did.
    """

    modules: int
    folders: int
    returns: int


@dataclass(frozen=True)
class ProjectFiles:
    """The text files of the project at one commit, by their paths."""

    texts: dict[str, str]
    commit: str = ""

    @classmethod
    def at(cls, commit: str) -> ProjectFiles:
        """Read the files of a commit of this repository.

        Raises
        ------
        BaselineError
            If it has no such commit, as in a clone without history.
        """
        with tarfile.open(fileobj=io.BytesIO(_archived(commit))) as archive:
            found = ((member.name, archive.extractfile(member)) for member in archive if _is_text(member.name))
            return cls({name: stream.read().decode() for name, stream in found if stream is not None}, commit)

    def modules(self, *packages: str) -> list[str]:
        """Return the paths of the modules of packages; tests that stand beside a package are of `tests`."""
        named = ((path, path.split("/")) for path in self.texts if path.endswith(".py"))
        return [path for path, parts in named if ("tests" if "tests" in parts[:2] else parts[0]) in packages]

    def lines(self, *packages: str) -> int:
        """Return how many lines the modules of packages have."""
        return sum(self.texts[path].count("\n") for path in self.modules(*packages))

    @cached_property
    def trees(self) -> dict[str, ast.Module]:
        """The parsed modules of the product."""
        return {path: ast.parse(self.texts[path]) for path in self.modules(*PRODUCT)}

    def fullest(self) -> tuple[str, int]:
        """Return the folder with the most modules, without `__init__.py`, and their number."""
        return self._modules_a_folder().most_common(1)[0]

    def crowded(self) -> int:
        """Return how many folders have more than 15 modules."""
        return sum(count > MOST_MODULES for count in self._modules_a_folder().values())

    def _modules_a_folder(self) -> Counter[str]:
        paths = (PurePosixPath(path) for path in self.modules(*PRODUCT, "benchmarks", "tests"))
        return Counter(path.parent.as_posix() for path in paths if path.name != "__init__.py")

    def classes(self) -> int:
        """Return how many classes the product has."""
        return sum(isinstance(node, ast.ClassDef) for tree in self.trees.values() for node in ast.walk(tree))

    def number_constants(self) -> int:
        """Return how many constants at the top of the product's modules are numbers."""
        return sum(_numbers_of(node) for tree in self.trees.values() for node in tree.body)

    def with_one_importer(self) -> int:
        """Return how many modules of the product one other module of it imports, also inside a function."""
        names = {module_of(path): path for path in self.trees}
        importers: Counter[str] = Counter()
        for path, tree in self.trees.items():
            importers.update({names[name] for name in _imported(tree) if name in names} - {path})
        return sum(count == 1 for count in importers.values())

    def loaded_lines(self) -> str:
        """Return how many lines an environment loads up to its first observation; "-" without a commit or world."""
        if not self.commit:
            return "-"
        with TemporaryDirectory() as folder:
            root = Path(folder)
            with tarfile.open(fileobj=io.BytesIO(_archived(self.commit, "minexplore"))) as archive:
                archive.extractall(root, filter="data")
            found = sum(loaded_modules(DEFAULT_BUNDLE.resolve(), root).values())
        return f"{found:,}" if found else "-"

    def way(self, artifact: str) -> Way:
        """Follow an artifact through the modules that the stages import, stage by stage."""
        names = ARTIFACTS[artifact]
        naming = {path for path, tree in self.trees.items() if names & set(_identifiers(tree))}
        stages = [naming & modules for modules in self._modules_by_stage()]
        seen: set[str] = set()
        last: set[str] = set()
        returns = 0
        for modules in stages:
            folders = {PurePosixPath(path).parent.as_posix() for path in modules}
            returns += len((folders & seen) - last)
            seen, last = seen | folders, folders
        return Way(len(set().union(*stages)), len(seen), returns)

    def _modules_by_stage(self) -> Iterator[set[str]]:
        with TemporaryDirectory() as folder:
            root = Path(folder)
            for path in self.modules(*PRODUCT):
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(self.texts[path])
            for stage in (f"stages/{name}.py" for name in STAGES):
                yield {path.as_posix() for path in import_closure(root / stage, root)}


def _archived(commit: str, *paths: str) -> bytes:
    """Return a tar archive of paths, or all files, of a commit."""
    packed = subprocess.run(["git", "archive", commit, *paths], capture_output=True)
    if packed.returncode:
        raise BaselineError(f"{commit}: not a commit of this clone; `git fetch --unshallow`, or --before COMMIT")
    return packed.stdout


def _imported(tree: ast.Module) -> Iterator[str]:
    """Yield the names that a module imports; a name of a package may be a module of it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


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


def _is_text(name: str) -> bool:
    return name.endswith(".py")


def _identifiers(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Attribute):
            yield node.attr


def layout_table(before: ProjectFiles, after: ProjectFiles) -> str:
    """Return the table of two states of the project, as Markdown."""

    def row(name: str, figure: Callable[[ProjectFiles], str]) -> tuple[str, str, str]:
        return name, figure(before), figure(after)

    def way(artifact: str) -> Callable[[ProjectFiles], str]:
        return lambda files: "{0.modules}, {0.folders}, {0.returns}".format(files.way(artifact))

    def lines(package: str) -> Callable[[ProjectFiles], str]:
        return lambda files: f"{files.lines(package):,}"

    rows = [
        row("most modules in a folder", lambda files: "{1} ({0})".format(*files.fullest())),
        row("folders of more than 15 modules", lambda files: str(files.crowded())),
        *(row(f"lines of `{package}/`", lines(package)) for package in (*PRODUCT, "benchmarks", "tests")),
        row("classes", lambda files: str(files.classes())),
        row("module constants that are numbers", lambda files: f"{files.number_constants():,}"),
        row("modules that one other imports", lambda files: str(files.with_one_importer())),
        row("lines loaded before the default's first observation", ProjectFiles.loaded_lines),
        *(row(f"`{artifact}`: modules, folders entered, returns", way(artifact)) for artifact in ARTIFACTS),
    ]
    return markdown_table(("", "before", "after"), rows)


def main() -> None:
    """Write the table and print it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks layout", description=__doc__)
    parser.add_argument("--before", default=BEFORE, metavar="COMMIT")
    parser.add_argument("--after", default="HEAD", metavar="COMMIT")
    stated = parser.parse_args()
    table = layout_table(ProjectFiles.at(stated.before), ProjectFiles.at(stated.after))
    write_table(PAGE, table)
    print(table)


if __name__ == "__main__":
    sys.exit(run_command("layout", main))
