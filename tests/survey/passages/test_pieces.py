"""Which piece of a survey is built: the longest, or the one of a station or place that the user names."""

import ezdxf
import pytest
import shapely
import yaml
from pydantic import TypeAdapter, ValidationError

from pipeline.commands.arguments import piece
from pipeline.errors import InputError
from pipeline.import_mine import survey_yaml
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import CentrelineSurveyParams, PassageSurveyParams, SurveyParams, VectorSurveyParams
from pipeline.survey.detect import _detect, detect_here
from pipeline.survey.vector_survey import read_vector_survey
from pipeline.types import DrawnFloors
from tests.heights import table
from tests.project import ROOT

# Two drifts, and one of 20 m 8 m under the first: a raise leads down to it. The last two lie over each other.
PIECES = {
    "A": [("a1", 0, 0, 100), ("a2", 60, 0, 102)],
    "R": [("a1", 0, 0, 100), ("b1", 0.2, 0, 92)],
    "B": [("b1", 0.2, 0, 92), ("b2", 20, 0, 92)],
    "C": [("c1", 0, 50, 100), ("c2", 40, 50, 100)],
    "D": [("d1", 20, 47, 102), ("d2", 20, 53, 102)],
    "E": [("c2", 40, 50, 100), ("d2", 20, 53, 102)],
}


def test_unnamed_lines_are_listed_by_their_places_and_chosen_by_them(tmp_path, capsys):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    for leg in ("A", "C"):
        drawing.modelspace().add_polyline3d([place for _, *place in PIECES[leg]])
    drawing.saveas(tmp_path / "a.dxf")
    params = CentrelineSurveyParams(kind="centrelines", name="a", file="data/x", half_width_m=2.0)
    values = {"file": (tmp_path / "a.dxf").as_posix()}
    read_vector_survey(params.model_copy(update=values))
    assert "builds another: 40 m about 0.0,50.0,100.0\n" in capsys.readouterr().err
    workings = read_vector_survey(params.model_copy(update={**values, "piece": (0.0, 50.0, 100.0)})).workings
    assert workings.bounds[1] > 40


def test_a_piece_of_drawn_levels_is_chosen_by_a_place(tmp_path, capsys):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    for z, side in ((400.0, 30), (390.0, 20)):
        ring = shapely.box(0, 0, side, side).exterior.coords
        drawing.modelspace().add_polyline3d([(x, y, z) for x, y in ring], close=True)
    drawing.saveas(tmp_path / "a.dxf")
    params = VectorSurveyParams(kind="vector", name="a", file="data/x")
    values = {"file": (tmp_path / "a.dxf").as_posix()}
    assert isinstance(read_vector_survey(params.model_copy(update=values)).shape, DrawnFloors)
    said = capsys.readouterr().err
    assert "all are built, and --piece (survey.piece) builds one: 900 m2 about" in said
    assert "400 m2 about 10.0,10.0,390.0" in said
    assert read_vector_survey(
        params.model_copy(update={**values, "piece": (10, 10, 390)})
    ).workings.area == pytest.approx(400)
    with pytest.raises(InputError, match=r"survey\.piece = 10,10,300: the nearest level or ramp is 90\.0 m away"):
        read_vector_survey(params.model_copy(update={**values, "piece": (10, 10, 300)}))


@pytest.mark.parametrize(
    ("text", "value"),
    [("1,2,-3.5", [1, 2, -3.5]), ("pell.1", "pell.1"), ("1,2", "1,2"), ("11", "11"), ("1,2,nan",) * 2],
)
def test_three_numbers_are_a_place_and_all_else_is_a_name(text, value):
    assert piece(text) == value


@pytest.mark.parametrize("chosen", ["b2", "11", [1.0, 2.0, 93.0], None])
def test_the_written_section_keeps_the_piece(tmp_path, chosen):
    path = tmp_path / "a.csv"
    path.write_text(table(PIECES).replace(",b2,", ",11,"))
    stated = StatedOptions(piece="11" if chosen == "b2" else chosen)
    text = survey_yaml("mine", path, _detect(path, stated), stated)
    section = yaml.safe_load(text)["survey"] | {"file": "data/a.csv"}
    kept = TypeAdapter(SurveyParams).validate_python(section).piece
    assert kept == stated.piece


@pytest.mark.parametrize("value", ["", [1, 2], [1, 2, "x"], True, {"a": 1}])
def test_what_is_no_name_and_no_place_is_refused(value):
    with pytest.raises(ValidationError):
        PassageSurveyParams(kind="passages", name="a", file="data/x", piece=value)


def test_a_whole_number_is_the_name_of_a_station():
    assert PassageSurveyParams(kind="passages", name="a", file="data/x", piece=11).piece == "11"


def test_a_shaft_piece_of_wheal_pell_is_chosen_by_its_station(capsys):
    found = detect_here(str(ROOT / "data/wheal_pell/pell.3d"), {"piece": "pell.2023-11-25.17"})
    said = capsys.readouterr().err
    assert "2 pieces share no station; built is the one of " in said
    assert "--piece (survey.piece) builds another: " in said
    assert found.values["values"]["piece"] == "pell.2023-11-25.17"
