"""The table of what files state: each row has a test that reads the statement back."""

import ast
import csv
import re

import pytest

from benchmarks.tables.reference import STATEMENTS
from minesurveys.formats import FORMATS
from tests.project import ROOT

# Other suffixes of formats that have rows, and two that state nothing about coordinates.
WITHOUT_ROWS = {".jpeg", ".tiff", ".gif", ".bmp", ".str", ".dtm", ".txt", ".dat", ".clp", ".yml"}

ROWS = list(csv.DictReader(STATEMENTS.open(newline="")))


def test_every_row_is_of_a_format_that_is_read_and_each_format_has_rows():
    stated = {suffix for row in ROWS for suffix in re.findall(r"\.[a-z0-9]+", row["format"])}
    assert stated == set(FORMATS) - WITHOUT_ROWS


@pytest.mark.parametrize("file", sorted({row["test"].partition("::")[0] for row in ROWS}))
def test_the_test_of_each_row_exists(file):
    found = {node.name for node in ast.walk(ast.parse((ROOT / file).read_text())) if isinstance(node, ast.FunctionDef)}
    assert {row["test"].partition("::")[2] for row in ROWS if row["test"].startswith(f"{file}::")} <= found


def test_no_row_stands_twice_and_each_is_a_sentence():
    assert len({(row["format"], row["states"]) for row in ROWS}) == len(ROWS)
    outcomes = ("used", "listed", "refused")
    assert [row for row in ROWS if not row["how"].endswith(".") or row["outcome"] not in outcomes] == []
