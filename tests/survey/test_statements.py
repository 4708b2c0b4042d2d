"""The table of what files state: each row has a test that reads the statement back, and each format has rows."""

import ast

import pytest

from pipeline.survey.formats import FORMATS
from pipeline.survey.stated.table import STATEMENTS, suffixes_stated
from tests.project import ROOT

# Formats whose rows are written with their readers; each leaves this list when it has some.
WITHOUT_ROWS = {
    ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".gif", ".pdf", ".yaml", ".yml", ".dxf", ".str", ".geojson",
    ".json", ".gpkg", ".shp", ".obj", ".stl", ".ply", ".glb", ".dtm", ".las", ".laz", ".pcd", ".xyz", ".txt", ".pts",
    ".asc", ".e57", ".zip", ".csv", ".plt", ".svx", ".3d", ".th", ".dat", ".mak", ".clp", ".wpj", ".srv",
}  # fmt: skip


def test_every_format_has_rows():
    assert set(FORMATS) - suffixes_stated() - WITHOUT_ROWS == set()


def test_every_row_is_of_a_format_that_is_read():
    assert suffixes_stated() - set(FORMATS) == set()


@pytest.mark.parametrize("test", sorted({row.test for row in STATEMENTS}))
def test_the_test_of_each_row_exists(test):
    file, _, name = test.partition("::")
    tree = ast.parse((ROOT / file).read_text())
    assert name in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_no_row_stands_twice_and_each_is_a_sentence():
    assert len({(row.format, row.states) for row in STATEMENTS}) == len(STATEMENTS)
    assert [
        row for row in STATEMENTS if not row.how.endswith(".") or row.outcome not in ("used", "listed", "refused")
    ] == []
