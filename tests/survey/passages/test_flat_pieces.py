"""A city's tunnels as lines at one height that do not all meet: the largest piece is built, the others are listed."""

import pytest
import shapely
from shapely import LineString

from pipeline.errors import InputError
from pipeline.params.survey import CentrelineSurveyParams
from pipeline.survey.vector_survey import read_vector_survey

TUNNELS = {
    "trunk": [(0, 0), (200, 0)],
    "branch": [(100, 0), (100, 90)],
    "short": [(201, 0.8), (260, 0.8)],  # 1.3 m short of the trunk; within its walls
    "metro": [(0, 300), (120, 300)],
    "stub": [(300, 300), (340, 300)],
}


def read(tmp_path, **values):
    path = tmp_path / "city.geojson"
    lines = [LineString(line) for line in TUNNELS.values()]
    path.write_text(shapely.to_geojson(shapely.MultiLineString(lines)))
    params = {"kind": "centrelines", "name": "a", "file": "data/x", "unit": "m", "half_width_m": 2.0, "px_per_m": 1.0}
    params = CentrelineSurveyParams.model_validate({**params, **values})
    return read_vector_survey(params.model_copy(update={"file": path.as_posix()})).workings


def test_the_largest_piece_is_built_and_the_warning_lists_places_of_the_others_and_the_option_that_joins(
    tmp_path, capsys
):
    workings = read(tmp_path)
    lines = [LineString(TUNNELS[name]) for name in ("trunk", "branch", "short")]
    assert workings.symmetric_difference(shapely.union_all(lines).buffer(2.0)).area < 5.0
    told = capsys.readouterr().err
    assert "its lines make 3 pieces that do not meet; built is the one of" in told
    assert "--snap M joins ends of lines nearer than M" in told
    assert "--piece (survey.piece) builds another piece: 493 m2 about 60.0,300.1,0.0, 173 m2 about 320.0,300.1" in told


def test_a_place_builds_another_piece_and_one_far_from_all_is_refused(tmp_path):
    assert read(tmp_path, piece=(320.0, 303.0, 0.0)).covers(LineString(TUNNELS["stub"]))
    with pytest.raises(InputError, match=r"the nearest drift is \d+\.\d m away, at most 10 m"):
        read(tmp_path, piece=(320.0, 100.0, 0.0))
    with pytest.raises(InputError, match="lines have no names; state a place by --piece E,N,0"):
        read(tmp_path, piece="1.2")
