"""Elevations that stand for none: filled along the line, from the nearest line, or kept if the user says so."""

import pytest
import shapely
from shapely import LineString, Polygon

from minesurveys.vector.missing_elevations import fill_elevations
from minesurveys.vector.shapes import Shapes
from pipeline.errors import InputError
from pipeline.params.survey import CentrelineSurveyParams
from pipeline.survey.vector_survey import read_vector_survey


def heights(path, *shapes, none_at=0.0):
    filled = fill_elevations(path / "a.gpkg", Shapes(list(shapes)), none_at).shapes
    return [shapely.get_coordinates(shape, include_z=True)[:, 2].tolist() for shape in filled]


def test_a_missing_elevation_is_linear_in_the_way_between_its_neighbours(tmp_path, capsys):
    line = LineString([(0, 0, 100), (10, 0, 0), (40, 0, 104), (50, 0, 0)])
    assert heights(tmp_path, line) == [[100, 101, 104, 104]]
    assert "a.gpkg: 2 of 4 points have no elevation, and take theirs from their own lines" in capsys.readouterr().err


def test_a_ring_that_begins_with_a_missing_elevation_stays_closed(tmp_path):
    square = Polygon([(0, 0, 0), (10, 0, 100), (10, 10, 0), (0, 10, 104)])
    assert heights(tmp_path, square) == [[102, 100, 102, 104, 102]]


def test_a_line_without_elevations_takes_those_of_the_nearest_line(tmp_path, capsys):
    lines = [
        LineString([(0, 0, 100), (10, 0, 101)]),
        LineString([(10, 1), (20, 1)]),
        LineString([(0, 9, 0), (0, 2, 0)]),
    ]
    assert heights(tmp_path, *lines) == [[100, 101], [101, 101], [100, 100]]
    assert "2 lines without any take those of the nearest lines" in capsys.readouterr().err


def test_an_elevation_that_no_point_has_and_one_that_all_have_are_said(tmp_path, capsys):
    line = LineString([(0, 0, 100), (10, 0, 0)])
    assert heights(tmp_path, line, none_at=-9999.0) == [[100, 0]]
    assert "--no-elevation -9999: no point has this elevation" in capsys.readouterr().err
    with pytest.raises(InputError, match="--no-elevation 5: no point has another elevation"):
        heights(tmp_path, LineString([(0, 0, 5), (10, 0, 5)]), none_at=5.0)


def test_a_stray_0_is_refused_with_both_options_and_each_of_them_reads_the_file(tmp_path):
    path = tmp_path / "ramp.geojson"
    line = LineString([(x, 0.0, 700.0 - x / 10 if x != 50 else 0.0) for x in range(0, 101, 10)])
    path.write_text(shapely.to_geojson(line))
    params = CentrelineSurveyParams(kind="centrelines", name="a", file="data/x", half_width_m=2.0, unit="m")
    params = params.model_copy(update={"file": path.as_posix()})
    with pytest.raises(
        InputError, match=r"\(50\.0, 0\.0\).*--no-elevation 0 takes .*, and --no-elevation -9999 keeps 0"
    ):
        read_vector_survey(params)
    legs = read_vector_survey(params.model_copy(update={"no_elevation": 0.0})).shape
    heights = legs.positions_m[:, 2] + legs.datum_m
    assert (heights.min(), heights.max()) == pytest.approx((690.0, 700.0))
    kept = read_vector_survey(params.model_copy(update={"no_elevation": -9999.0})).shape
    assert (kept.positions_m[:, 2] + kept.datum_m).min() == pytest.approx(0.0)
