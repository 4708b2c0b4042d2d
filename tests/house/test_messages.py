"""Messages of readers: in our own words, and with the option that overrules what is a judgement."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import get_args

from pydantic import BaseModel

from benchmarks.files import options_of
from benchmarks.tables.reference import options_table
from pipeline.params.config import Config
from pipeline.params.survey import SurveyParams
from tests.project import ROOT, modules_below

READERS = ("minesurveys", "pipeline/survey", "pipeline/scans", "pipeline/import_mine.py")
OTHERS = ("pipeline/geometry/drawing", "pipeline/geometry/outline", "pipeline/geometry/floor", "stages/contours.py")
OURS = {"InputError", "GeometryError", "ParamsError", "MineError", "DoubtError", "ArtifactError", "DrawingError"}
# What of a caught exception a message may state: the system's reason, and places in the file.
STATED = ("strerror", "start", "lineno", "colno")
OWN_WORDS = {  # an exception of another class whose text is ours, or that no reader of a file raises
    "minesurveys/pictures/georeference.py": "ValueError of `plain_number`",
    "pipeline/survey/fetch.py": "of a download",
    "minesurveys/limits.py": "of our own file, in our words",
}
# Questions about a broken file, which no option answers, and those whose caller names the parameter.
OF_THE_FILE = re.compile(r"truncated|cut off|quote not closed|begin with the section|is \{\} right\?")


@dataclass(frozen=True)
class Message:
    """A message of a module, with `{}` for values."""

    path: str
    text: str


def modules(names: tuple[str, ...]) -> Iterator[tuple[str, ast.Module]]:
    """Yield the modules at these names with their syntax trees."""
    for name in names:
        found = [ROOT / name] if name.endswith(".py") else modules_below(name)
        for path in found:
            yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text())


def texts_of(tree: ast.Module) -> Iterator[str]:
    """Yield the texts of a module but its docstrings; a constant of the module stands in the text that uses it."""
    known = {
        node.targets[0].id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and _is_text(node.value)
    }
    parts = {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)} - {tree}
    docs = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr) and _is_text(node.value)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(_text_of(part, known) for part in node.values)
        elif _is_text(node) and node not in parts | docs:
            yield node.value


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _text_of(part: ast.expr, known: dict[str, str]) -> str:
    if isinstance(part, ast.Constant):
        return part.value
    value = part.value
    return known.get(value.id, "{}") if isinstance(value, ast.Name) else "{}"


@cache
def messages() -> list[Message]:
    """Return the texts of the readers and of stages 1 and 2."""
    return [Message(path, text) for path, tree in modules(READERS + OTHERS) for text in texts_of(tree)]


def quoted_exceptions(tree: ast.Module) -> Iterator[str]:
    """Yield what the errors of a module quote of exceptions that are not ours."""
    for handler in (node for node in ast.walk(tree) if isinstance(node, ast.ExceptHandler) and node.name):
        kinds = {n.attr if isinstance(n, ast.Attribute) else getattr(n, "id", "") for n in ast.walk(handler.type)}
        if not kinds - {""} <= OURS:
            raised = [node.exc for node in ast.walk(handler) if isinstance(node, ast.Raise) and node.exc]
            values = [n.value for exc in raised for n in ast.walk(exc) if isinstance(n, ast.FormattedValue)]
            yield from (ast.unparse(value) for value in values if _quotes(value, handler.name))


def _quotes(value: ast.expr, name: str) -> bool:
    """Return whether a value shows an exception's text; a function of ours that judges it does not."""
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id.startswith("_"):
        return False
    if isinstance(value, ast.Attribute) and value.attr in STATED:
        return False
    return any(isinstance(node, ast.Name) and node.id == name for node in ast.walk(value))


def exists(option: str) -> bool:
    """Return whether `new` has an option, or the configuration a parameter, of this name."""
    if option.startswith("--"):
        return option in re.findall(r"--[a-z0-9-]+", options_table())
    section, *keys = option.partition("=")[0].split(".")
    kinds = get_args(get_args(SurveyParams)[0]) if section == "survey" else (Config.model_fields[section].annotation,)
    return any(_has(kind, keys) for kind in kinds)


def _has(kind: type[BaseModel], keys: list[str]) -> bool:
    """Return whether a schema has a key, and the schema of that the next."""
    first, *rest = keys
    if first not in kind.model_fields:
        return False
    annotation = kind.model_fields[first].annotation
    inner = [k for k in (annotation, *get_args(annotation)) if isinstance(k, type) and issubclass(k, BaseModel)]
    return not rest or not inner or any(_has(each, rest) for each in inner)


def test_every_message_that_asks_the_user_names_an_option():
    asking = [m for m in messages() if re.search(r"\w\)?\?(?: |$)", m.text) and not OF_THE_FILE.search(m.text)]
    assert len(asking) > 5
    assert [m for m in asking if not options_of(m.text)] == []


def test_every_option_that_a_message_names_exists():
    sentences = [message for message in messages() if " " in message.text and message.path not in OWN_WORDS]
    named = {(message.path, option) for message in sentences for option in options_of(message.text)}
    assert len(named) > 50
    assert sorted((path, option) for path, option in named if not exists(option)) == []


def test_no_message_quotes_an_exception_of_a_library():
    quoting = {path: list(quoted_exceptions(tree)) for path, tree in modules(READERS)}
    found = {path: quotes for path, quotes in quoting.items() if quotes and path not in OWN_WORDS}
    assert found == {}


def test_no_message_has_the_words_of_pydantic():
    quoting = {
        path
        for path, tree in modules(("minesurveys", "pipeline", "stages"))
        for node in ast.walk(tree)
        if _is_msg(node)
    }
    assert quoting == {"minesurveys/refusals.py"}


def _is_msg(node: ast.AST) -> bool:
    """Return whether a piece of code takes the text of one of pydantic's errors."""
    return isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and node.slice.value == "msg"
