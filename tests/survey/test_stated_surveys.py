"""The table of what surveys of stations state: every row names a test that is there."""

import ast

import pytest

from pipeline.survey.stated.surveys import STATEMENTS
from tests.project import ROOT


@pytest.mark.parametrize("row", STATEMENTS, ids=lambda row: f"{row.format}: {row.states}")
def test_a_row_names_a_test_that_is_there(row):
    file, _, name = row.test.partition("::")
    tree = ast.parse((ROOT / file).read_text())
    assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_no_statement_has_two_rows():
    assert len({(row.format, row.states) for row in STATEMENTS}) == len(STATEMENTS)
