"""The table of statements names tests that there are."""

import ast

import pytest

from pipeline.survey.stated.geodata import STATEMENTS
from tests.project import ROOT


@pytest.mark.parametrize("file", sorted({row.test.partition("::")[0] for row in STATEMENTS}))
def test_each_statement_of_geodata_names_a_test_that_there_is(file):
    found = {node.name for node in ast.parse((ROOT / file).read_text()).body if isinstance(node, ast.FunctionDef)}
    wanted = {name for of, _, name in (row.test.partition("::") for row in STATEMENTS) if of == file}
    assert wanted <= found


def test_no_statement_of_geodata_stands_twice():
    keys = [(row.format, row.states) for row in STATEMENTS]
    assert len(set(keys)) == len(keys)
