"""What follows the advice of a refusal is read; each refusal that names an option is tried."""

import ast
import re
from collections.abc import Iterator

import pytest

from benchmarks.files import options_of
from pipeline.errors import InputError
from pipeline.params.stated import state
from pipeline.survey.detect import detect_survey
from tests.house.test_messages import modules, texts_of
from tests.project import ROOT
from tests.survey.advice import of_bodies, of_lines, of_pictures

CASES = {**of_lines.CASES, **of_pictures.CASES, **of_bodies.CASES}
# Refusals whose advice another test follows, by words of the message.
ELSEWHERE = {
    "nothing is left of its lines": (
        "tests/survey/vector/test_centrelines.py"
        "::test_lines_that_all_fall_on_one_place_are_refused_with_their_span_and_the_unit"
    ),
    "fill more than": "tests/survey/clouds/test_cloud_volume.py::test_more_voxels_than_the_limit_are_refused",
    "no point has another elevation": (
        "tests/survey/vector/test_missing_elevations.py"
        "::test_an_elevation_that_no_point_has_and_one_that_all_have_are_said"
    ),
    "shapes that are not visible": (
        "tests/survey/vector/test_kml_gpx.py::test_a_shape_of_kml_that_is_not_visible_is_read_if_its_layer_is_named"
    ),
    "--voxel M (now": (
        "tests/survey/clouds/test_cloud_volume.py::test_another_voxel_is_advised_only_where_nothing_is_missing"
    ),
    "survey.seeds_m is not read with levels": (
        "tests/survey/levels/test_drawn_levels.py::test_seeds_are_refused_with_levels"
    ),
    "is its scale right?": "tests/survey/test_stated.py::test_a_plan_of_more_than_twenty_kilometres_is_refused",
    "are those of a floor or a terrain": (
        "tests/survey/test_surfaces.py::test_a_landxml_surface_in_feet_gives_the_floor_of_a_plan_in_metres"
    ),
    "--heights needs the survey's coordinates": (
        "tests/survey/test_surfaces.py::test_a_surface_that_does_not_belong_to_the_plan_is_refused"
    ),
    "no column of a station table; there are": (
        "tests/survey/stations/test_table_columns.py::test_a_stated_column_that_is_none_is_refused_with_those_that_are"
    ),
    "no such column; there are": (
        "tests/survey/stations/test_table_columns.py::test_a_stated_column_that_is_none_is_refused_with_those_that_are"
    ),
    "--columns {}={}: stated twice": (
        "tests/survey/stations/test_table_columns.py::test_a_stated_column_that_is_none_is_refused_with_those_that_are"
    ),
    "the unit of the column {} is not known": (
        "tests/survey/stations/test_table_columns.py::test_a_unit_that_is_not_known_is_refused_and_the_option_reads_the_column"
    ),
    "makes a GeoTIFF for --heights": (
        "tests/scans/test_exchanged_clouds.py::test_a_terrain_is_read_as_the_geotiff_that_the_refusal_asks_for"
    ),
}
# No file is known that is refused so.
UNKNOWN = (
    "its coordinates cannot be projected",  # PROJ gives infinite coordinates, and raises nothing
    "cannot be simplified to a closed mesh",
    "its surface crosses itself at",  # what is left of it after it was mended
    "its lines are too tangled",
    "its surface, simplified to",
)


@pytest.mark.parametrize("name", CASES)
def test_what_follows_the_advice_of_a_refusal_is_read(tmp_path, name):
    case = CASES[name]
    path = case.write(tmp_path)
    with pytest.raises(InputError, match=re.escape(case.words).replace(r"\{\}", ".*")):
        detect_survey(path, state(path, case.stated))
    for way in case.ways:
        path = (way.write or case.write)(tmp_path)
        assert detect_survey(path, state(path, way.stated)).files


def refusals() -> Iterator[str]:
    """Yield the texts of the readers' errors that name an option of `new`."""
    for _, tree in modules(("minesurveys", "pipeline/survey", "pipeline/scans")):
        constants = [node for node in tree.body if isinstance(node, ast.Assign)]
        for node in ast.walk(tree):
            if isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and _name(node) == "InputError"):
                raised = node if isinstance(node, ast.Raise) else ast.Expr(node)
                texts = texts_of(ast.Module([*constants, raised], []))
                yield from (text for text in texts if " " in text and any("--" in name for name in options_of(text)))


def _name(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else ""


def test_the_advice_of_each_refusal_that_names_an_option_is_followed():
    known = [*(case.words for case in CASES.values()), *ELSEWHERE, *UNKNOWN]
    found = set(refusals())
    assert len(found) > 40
    assert sorted(text for text in found if not any(words in text for words in known)) == []


@pytest.mark.parametrize("test", sorted(ELSEWHERE.values()))
def test_the_test_that_follows_an_advice_exists(test):
    file, _, name = test.partition("::")
    assert name in {node.name for node in ast.walk(ast.parse((ROOT / file).read_text())) if hasattr(node, "name")}
