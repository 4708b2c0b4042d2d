"""Surveys that are built whole: their pieces, their frame, where robots start, and what is refused in one line."""

import shutil

import numpy as np
import pytest

from minesurveys.solved.model import LegStyle, SolvedSurvey, StationFlag
from minesurveys.solved_surveys import entrances_of
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import PassageSurveyParams
from pipeline.store.mine_survey import MineModel
from pipeline.survey.detect import detect_here, detect_survey
from pipeline.survey.whole_survey import read_whole
from pipeline.types import lines_of
from tests.volume_worlds import HEADER, RAMP, legs_of_table, survey_of_table

needs_cavern = pytest.mark.skipif(shutil.which("cavern") is None, reason="Survex is not installed (Debian: survex)")
APART = RAMP + "X,8,200,0,5,2,2,3,0\nX,9,220,0,5,2,2,3,0\n"
STEEP = RAMP + "B,2,30,0,0,1,1,3,0\nB,7,30,0,-40,1,1,2,0\nC,7,30,0,-40,0.3,0.3,0.5,0\nC,8,40,0,-40,0.3,0.3,0.5,0\n"


def places_of(legs):
    """Return the stations' places by name."""
    return dict(zip(lines_of(legs.names), legs.positions_m.tolist(), strict=True))


def test_every_leg_is_kept_also_shafts_and_crawls(tmp_path):
    legs = legs_of_table(STEEP, tmp_path)
    assert legs.surveyed_m == pytest.approx(30 + np.hypot(30, 6) + 40 + 10)
    assert set(places_of(legs)) == {"1", "2", "3", "7", "8"}
    steps = [np.ptp(legs.positions_m[a:b, 2]) for a, b in zip(legs.first[:-1], legs.first[1:], strict=True)]
    assert max(steps) == pytest.approx(40)


def test_the_frame_begins_at_the_lowest_floor_and_a_national_grid_at_its_corner(tmp_path):
    legs = legs_of_table(RAMP.replace(",-6,", ",-6.4,"), tmp_path)
    assert legs.datum_m == -7
    assert places_of(legs)["3"] == pytest.approx([60, 0, 0.6])
    grid = HEADER + "A,1,700000,4800000,900,2,2,3,0\nA,2,700060,4800000,897,2,2,3,0\n"
    far = legs_of_table(grid, tmp_path)
    assert np.abs(far.positions_m[:, :2]).max() < 100
    assert far.datum_m == 897


def test_the_longest_piece_is_built_and_the_others_are_listed_with_the_option_that_builds_them(tmp_path, capsys):
    legs = legs_of_table(APART, tmp_path)
    assert set(places_of(legs)) == {"1", "2", "3"}
    assert (lines_of(legs.pieces), legs.pieces_m.tolist()) == (["8"], [20.0])
    assert legs.surveyed_m == pytest.approx(30 + np.hypot(30, 6) + 20)
    said = capsys.readouterr().err
    assert "2 pieces share no station; built is the one of 61 m about 1; --piece (survey.piece)" in said
    assert "20 m about 8" in said


def test_of_many_pieces_the_ten_longest_are_listed_and_the_others_are_counted(tmp_path, capsys):
    rows = "".join(f"P{k},p{k},{100 * k},0,5,2,2,3,0\nP{k},q{k},{100 * k + 30 - k},0,5,2,2,3,0\n" for k in range(2, 15))
    assert len(lines_of(legs_of_table(RAMP + rows, tmp_path).pieces)) == 13
    said = " ".join(capsys.readouterr().err.split())
    assert "19 m about p11 and 3 more" in said
    assert "about p12" not in said


def test_roofs_that_nobody_measured_are_listed_with_the_option_that_states_them(tmp_path, capsys):
    bare = HEADER + "".join(f"A,{k},{10 * k},0,{k / 2},2,2,,0\n" for k in range(12))
    legs_of_table(bare, tmp_path)
    said = " ".join(capsys.readouterr().err.split())
    assert "12 of 12 stations have no measured roof; compile3d.height_m over the floor is taken" in said
    assert "compile3d.volume.roof_m=M states another" in said
    legs_of_table(bare + "".join(f"B,b{k},{20 * k},50,{k / 2},2,2,{k % 3 + 1},0\n" for k in range(10)), tmp_path)
    assert "no measured roof" not in capsys.readouterr().err  # the piece that is built has all
    legs_of_table(bare.replace("2,,0", "2,1.5,0", 10), tmp_path)
    assert "2 of 12 stations have no measured roof, but most of their passage" in capsys.readouterr().err


def test_pieces_may_lie_farther_apart_than_a_mine_may_reach(tmp_path):
    far = RAMP + "X,8,40000,0,5,2,2,3,0\nX,9,40020,0,5,2,2,3,0\n"
    assert set(places_of(legs_of_table(far, tmp_path))) == {"1", "2", "3"}
    assert places_of(legs_of_table(far, tmp_path, piece="9"))["8"] == pytest.approx([0, 0, 0], abs=15)


@pytest.mark.parametrize("piece", ["9", (220.0, 1.0, 5.0)])
def test_a_station_or_a_place_chooses_another_piece(piece, tmp_path):
    legs = legs_of_table(APART, tmp_path, piece=piece)
    assert set(places_of(legs)) == {"8", "9"}
    assert legs.pieces_m.tolist() == [pytest.approx(30 + np.hypot(30, 6))]


@pytest.mark.parametrize(
    ("piece", "message"),
    [
        ("99", "survey.piece = '99': no station has this name; names like it are 9"),
        ((250.0, 0.0, 5.0), "survey.piece = 250,0,5: the nearest station, 9, is 30.0 m away, at most 10 m"),
    ],
)
def test_a_piece_that_there_is_not_is_refused_with_what_is_near(piece, message, tmp_path):
    with pytest.raises(InputError, match="survey.csv: " + message):
        legs_of_table(APART, tmp_path, piece=piece)


def test_a_stated_start_is_kept_with_its_elevation(tmp_path):
    for stated, plan_m, z_m in (
        ((55.0, 0.0, -5.0), (55.0, 0.0), 1.0),
        ((55.0, 0.0), (55.0, 0.0), None),
        (None, None, None),
    ):
        survey = survey_of_table(RAMP, tmp_path, entrance_m=stated).survey
        assert (survey.entrance_m, survey.entrance_z_m) == (plan_m, z_m)


@pytest.mark.parametrize("rise", ["", ",5", ",5.9"])
def test_a_survey_without_elevations_or_with_like_ones_stays_a_plan(tmp_path, rise):
    head = "leg,station,easting_m,northing_m,left_m,right_m" + (",elevation_m" if rise else "")
    first = ",5" if rise else ""
    text = f"{head}\nA,1,0,0,2,2{first}\nA,2,9,0,2,2{rise}\n"
    assert survey_of_table(text, tmp_path, flat_step_m=1.0).model is MineModel.LEVEL
    assert survey_of_table(text, tmp_path, flat_step_m=0.0).model is (MineModel.VOLUME if rise else MineModel.LEVEL)


@pytest.mark.parametrize("stated", [{"grade": 0.02}, {"heights": "data/spots.csv"}])
def test_heights_stated_beside_elevations_are_refused(tmp_path, monkeypatch, stated):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data/spots.csv").write_text("easting_m,northing_m,elevation_m\n0,0,5\n")
    with pytest.raises(InputError, match=r"survey\.heights and survey\.grade are not read: it has elevations"):
        legs_of_table(RAMP, tmp_path, **stated)


def test_legs_without_a_length_in_all_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"survey\.csv: "):
        legs_of_table(HEADER + "A,1,0,0,0,2,2,3,0\nA,2,0,0,0.0001,2,2,3,0\n", tmp_path)


def test_entrances_are_the_stations_that_the_survey_flags():
    flags = np.array([StationFlag.ENTRANCE | StationFlag.UNDERGROUND, StationFlag.UNDERGROUND], np.uint8)
    style = np.array([LegStyle.NORMAL], np.uint8)
    survey = SolvedSurvey(("adit", "inner"), np.zeros((2, 3)), flags, np.array([[0, 1]]), np.zeros(1, np.uint8), style)
    assert entrances_of(survey) == ["adit"]


def test_a_survey_with_elevations_is_detected_and_the_option_for_solids_is_not_read_with_it(tmp_path):
    table = tmp_path / "a.csv"
    table.write_text(RAMP)
    found = detect_here(str(table), {}).values
    assert found["has_heights"] is True
    assert found["values"]["piece"] is None
    with pytest.raises(InputError, match=r"a\.csv: --volume is not read with a station survey"):
        detect_survey(table, StatedOptions(volume=True))
    walls = tmp_path / "a.geojson"
    walls.write_text('{"type": "Polygon", "coordinates": [[[0,0],[50,0],[50,5],[0,5],[0,0]]]}')
    with pytest.raises(InputError, match=r"a\.geojson: --volume reads the solids in a DXF file"):
        detect_here(str(walls), StatedOptions(volume=True).values())


def test_a_survey_in_three_dimensions_is_read_whole(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text(STEEP)
    params = PassageSurveyParams(kind="passages", name="a", file="data/x", heights=None).model_copy(
        update={"file": path.as_posix()}
    )
    assert len(read_whole(path, params)[1]) >= 3


WINZE = (
    "A,1,0,0,0,2,2,3,0\nA,2,40,0,0,2,2,3,0\nA,3,80,0,0,2,2,3,0\n",
    "B,2,40,0,0,1,1,1,1\nB,5,40,0.5,-20,1,1,1,1\n",
    "C,5,40,0.5,-20,2,2,3,0\nC,6,90,0.5,-21,2,2,3,0\n",
    "D,2,40,0,0,2,2,8,2\nD,7,40,40,0,2,2,8,2\n",
)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (1, 3, 0, 2)])
def test_a_drift_keeps_its_floor_where_a_shaft_or_a_side_drift_begins(order, tmp_path, capsys):
    path = tmp_path / "winze.csv"
    path.write_text(HEADER + "".join(WINZE[k] for k in order))
    _, legs = read_whole(path, PassageSurveyParams(kind="passages", name="a", file="data/winze.csv"))
    found = {(a, b): leg.heights_m[:, 1:].tolist() for leg in legs for a, b in [(leg.stations[0], leg.stations[-1])]}
    assert found["1", "3"] == [[3, 0], [3, 0], [3, 0]]
    assert found["5", "6"] == [[3, 0], [3, 0]]
    assert found["2", "7"] == [[8, 0], [8, 2]]
    said = capsys.readouterr().err
    assert "2 stations have different distances down to the floor in two passages" in said
    assert "At 2 0 m are taken, not 2" in said


def test_each_passage_keeps_its_own_roof_where_a_crawl_leads_into_a_chamber(tmp_path):
    path = tmp_path / "chamber.csv"
    crawl = "A,1,0,0,0,1,1,0.4,0.3\nA,2,20,0,0,1,1,0.4,0.3\nA,3,40,0,0,1,1,0.4,0.3\n"
    path.write_text(HEADER + crawl + "B,2,20,0,0,5,5,15,0.3\nB,4,20,20,2,5,5,15,0.3\n")
    _, legs = read_whole(path, PassageSurveyParams(kind="passages", name="a", file="data/chamber.csv"))
    found = {(leg.stations[0], leg.stations[-1]): leg.heights_m[:, 1].tolist() for leg in legs}
    assert found == {("1", "3"): [0.4, 0.4, 0.4], ("2", "4"): [15, 15]}


@needs_cavern
def test_legs_on_the_surface_are_listed_as_a_flag_that_nobody_ended_leaves_drifts_out(tmp_path, capsys):
    path = tmp_path / "a.svx"
    shots = "1 2 10 90 0\n2 3 20 90 0\n{}\n3 4 30 90 0\n4 5 40 90 0\n*flags splay\n4 6 2 0 0\n"
    for flags, length_m in (("", 100), ("*flags surface", 30)):
        path.write_text("*data normal from to tape compass clino\n" + shots.format(flags))
        _, legs = read_whole(path, PassageSurveyParams(kind="passages", name="a", file="data/a.svx", half_width_m=1.0))
        assert sum(np.ptp(leg.positions_m[:, 0]) for leg in legs) == pytest.approx(length_m, abs=0.01)
        said = capsys.readouterr().err
        assert ("a.svx: 2 legs, 70 m, are flagged as on the surface" in said) == bool(flags)
    assert "the longest is 4 to 5" in said
