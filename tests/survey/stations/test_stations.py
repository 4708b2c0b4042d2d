import numpy as np
import pytest
import shapely

from minesurveys.solved_surveys import solve_file
from pipeline.errors import InputError
from pipeline.params.survey import PassageSurveyParams
from pipeline.survey.detect import detect_here
from pipeline.survey.passages.workings import build_workings
from pipeline.survey.solved.station_table import read_station_legs, read_stations
from pipeline.survey.vector_survey import read_vector_survey
from pipeline.types import DrawnPlan
from tests.project import ROOT, TINY_STATIONS

HEADER = "leg,station,easting_m,northing_m,left_m,right_m\n"


def write(tmp_path, text):
    path = tmp_path / "s.csv"
    path.write_text(text)
    return path


def test_a_straight_leg_is_a_box_with_round_ends(tmp_path):
    legs = read_stations(write(tmp_path, HEADER + "A,a,0,0,2,3\nA,b,10,0,2,3\n"))
    workings = build_workings(legs)
    # The left wall is north of a leg that runs east. A disc's radius is the smaller wall distance.
    assert workings.area == pytest.approx(10 * 5 + np.pi * 4 / 2 * 2, rel=0.01)
    assert workings.bounds == pytest.approx((-2, -3, 12, 2))


def test_the_embedded_survey_has_the_legs_the_stations_and_the_area_of_its_data_card():
    legs = read_stations(ROOT / "data/chilean_mine/stations.csv")
    assert len(legs) == 32
    assert sum(len(leg.stations) for leg in legs) == 499
    assert build_workings(legs).area == pytest.approx(9378, abs=1)


def test_a_byte_order_mark_and_windows_line_ends_are_accepted(tmp_path):
    path = tmp_path / "s.csv"
    path.write_bytes(b"\xef\xbb\xbf" + TINY_STATIONS.replace("\n", "\r\n").encode())
    assert [leg.name for leg in read_stations(path)] == ["A", "B"]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("", "no stations"),
        ("A,a,0,0,2,2\n", "leg A has one station"),
        ("A,a,0,0,2,2\nA,b,nan,0,2,2\n", r":3: easting_m = nan"),
        ("A,a,0,0,2,2\nA,b,inf,0,2,2\n", r":3: easting_m = inf"),
        ("A,a,0,0,2,2\nA,b,ten,0,2,2\n", r":3: easting_m = 'ten' is not a number"),
        ("A,a,0,0,2,2\nA,b,9,0,2\n", r":3: right_m = None"),
        ("A,a,0,0,2,2\nA,b,9,0,-2,2\n", r":3: left_m = -2 of station b is negative"),
        ("A,a,0,0,2,2\nA,a,9,0,2,2\n", r":3: station a at \(9, 0\) is at \(0, 0\) in line 2"),
        ("A,a,0,0,2,2\nA,b,5,0,2,2\nA,c,9,0,2,2\nA,b,5,0,2,2\n", r":5: station b occurs twice in leg A"),
        ("A,a,0,0,2,2\nA,b,0,0,2,2\n", "stations a and b of leg A have one position"),
        (
            "A,a,0,0,2,2\nA,b,9,0,2,2\nB,c,0,50,2,2\nB,d,9,50,2,2\n",
            r"legs B share no station with leg A: the nearest are a at \(0\.0, 0\.0\) and c at \(0\.0, 50\.0\), 50",
        ),
        (
            "A,a,0,0,2,2\nA,b,9,0,2,2\nB,b,9,0,2,2\nB,c,9,9,2,2\nB,d,5,9,2,2\nB,e,5,-9,2,2\n",
            r"leg A \(a to b\) crosses leg B \(d to e\) at \(5\.00, 0\.00\)",
        ),
    ],
)
def test_a_faulty_survey_is_refused_with_line_and_value(tmp_path, rows, message):
    with pytest.raises(InputError, match=message):
        read_stations(write(tmp_path, HEADER + rows))


def test_a_plumb_leg_is_allowed_where_stations_have_elevations(tmp_path):
    header = HEADER.replace("\n", ",elevation_m\n")
    rows = "S,a,0,0,2,2,10\nS,b,0,0,2,2,4\nD,b,0,0,2,2,4\nD,c,9,0,2,2,4\n"
    legs = read_station_legs(write(tmp_path, header + rows))
    assert [(leg.stations, leg.is_plumb) for leg in legs] == [(["b", "c"], False), (["a", "b"], True)]
    with pytest.raises(InputError, match="stations a and b of leg S have one position"):
        read_station_legs(write(tmp_path, header + "S,a,0,0,2,2,10\nS,b,0,0,2,2,10\n"))


def test_a_column_that_stands_twice_and_a_field_too_many_are_refused(tmp_path):
    rows = "A,a,0,0,2,2\nA,b,9,0,2,2\n"
    with pytest.raises(InputError, match="the column 'left_m' stands twice"):
        read_stations(write(tmp_path, HEADER.replace("right_m", "right_m,left_m") + rows))
    with pytest.raises(InputError, match=":3: more fields than columns"):
        read_stations(write(tmp_path, HEADER + rows.replace("9,0,2,2", "9,0,2,2,7")))


@pytest.mark.parametrize("data", [b"\xff\xfe\x00leg", b'leg,station\n"', b"a,b\n1,2\n"])
def test_a_file_that_is_not_a_survey_is_refused_with_its_name(tmp_path, data):
    path = tmp_path / "s.csv"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"s\.csv"):
        read_stations(path)


def test_stations_of_zero_width_leave_a_gap_without_slivers(tmp_path):
    text = HEADER + "A,a,0,0,2,2\nA,b,5,0,0,0\nA,c,10,0,0,0\nA,d,15,0,2,2\n"
    parts = shapely.get_parts(build_workings(read_stations(write(tmp_path, text))))
    assert len(parts) == 2
    assert all(isinstance(p, shapely.Polygon) for p in parts)


HEIGHTS = HEADER.strip() + ",elevation_m,up_m,down_m\n"


def test_elevations_roofs_and_floors_are_read_and_change_no_plan(tmp_path):
    rows = "A,a,0,0,2,3,2400,2.5,0.5\nA,b,10,0,2,3,2400.5,,\n"
    legs = read_stations(write(tmp_path, HEIGHTS + rows))
    np.testing.assert_array_equal(legs[0].heights_m, [[2400, 2.5, 0.5], [2400.5, np.nan, np.nan]])
    plain = read_stations(write(tmp_path, HEADER + "A,a,0,0,2,3\nA,b,10,0,2,3\n"))
    assert plain[0].heights_m is None
    assert build_workings(legs).equals(build_workings(plain))


def test_a_table_with_elevations_is_a_survey_in_three_dimensions(tmp_path):
    rows = "A,a,0,0,2,3,15,2.5,0.5\nA,b,10,0,2,3,50,2,0\nB,b,10,0,1,1,50,2,0\nB,c,10,9,1,1,60,1,1\n"
    survey = solve_file(write(tmp_path, HEIGHTS + rows))
    assert survey.names == ("a", "b", "c")
    assert survey.legs.tolist() == [[0, 1], [1, 2]]
    np.testing.assert_array_equal(survey.positions_m[1], (10, 0, 50))
    np.testing.assert_array_equal(survey.passages[1].lrud_m, [[1, 1, 2, 0], [1, 1, 1, 1]])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("A,a,0,0,2,2,2400,2,0\nA,b,9,0,2,2,0,2,0\n", r":3: elevation_m = 0, but the others lie from 2400 to 2400 m"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,nan,2,0\n", r":3: elevation_m = nan is not a finite number"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,5,inf,0\n", r":3: up_m = inf is not a finite number"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,,2,0\n", r":3: elevation_m = '' is not a number"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,5,-1,0\n", r":3: up_m = -1 of station b is negative"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,5,nan,0\n", r":3: up_m = nan is not a finite number"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,5,400,0\n", r":3: up_m = 400 of station b, at most 300"),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,5,2,1e300\n", r":3: down_m = 1e300 is not within"),
        ("A,a,0,0,2,2,5,0,0\nA,b,9,0,2,2,5,2,0\n", r":2: station a: the roof at 5 m is not above the floor at 5 m"),
        (
            "A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,5,2,0\nB,b,9,0,2,2,6,2,0\nB,c,9,9,2,2,5,2,0\n",
            r":4: station b at \(9, 0, 6\)",
        ),
        ("A,a,0,0,2,2,5,2,0\nA,b,9,0,2,2,9,2,0\n", r"a to b at \(4\.5, 0\.0\): 4\.0 m up or down in 9\.0 m"),
    ],
)
def test_faulty_elevations_are_refused_with_their_row(tmp_path, rows, message):
    with pytest.raises(InputError, match=message):
        read_stations(write(tmp_path, HEIGHTS + rows))


def test_a_distance_to_the_roof_without_elevations_is_refused(tmp_path):
    with pytest.raises(InputError, match="column up_m needs a column elevation_m"):
        read_stations(write(tmp_path, HEADER.strip() + ",up_m\nA,a,0,0,2,2,3\nA,b,9,0,2,2,3\n"))


def test_a_wall_kilometres_from_its_station_is_refused_with_its_line(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("leg,station,easting_m,northing_m,left_m,right_m\n1,a,0,0,2,2\n1,b,50,0,2,5000\n")
    with pytest.raises(InputError, match=r"s\.csv:3: right_m = 5000 of station b, at most 300 \(farthest_wall_m"):
        read_stations(path)


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ","), (", ", ".")])
def test_separators_and_decimal_commas_of_spreadsheets_are_read(tmp_path, separator, decimal):
    rows = [
        "Leg,Station,Easting_m,Northing_m,Left_m,Right_m,Elevation_m",
        "A,a,0.5,0,2,2,5.25",
        ",,,,,,",
        "A,b,9,0,2,2,5",
    ]
    head, *values = (row.replace(",", separator) for row in rows)
    text = "\r\n".join([head, *(row.replace(".", decimal) for row in values)])
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode("utf-8-sig"))
    (leg,) = read_station_legs(path)
    np.testing.assert_array_equal(leg.positions_m, [[0.5, 0], [9, 0]])
    np.testing.assert_array_equal(leg.heights_m[:, 0], [5.25, 5])


def test_stations_of_one_leg_above_each_other_are_a_shaft(tmp_path):
    path = tmp_path / "a.csv"
    head = "leg,station,easting_m,northing_m,left_m,right_m,elevation_m\n"
    path.write_text(f"{head}A,a,0,0,2,2,5\nA,b,9,0,2,2,5\nA,c,9,0,2,2,-7\nA,d,0,0,2,2,-7\n")
    one, two, shaft = read_station_legs(path)
    assert (one.stations, two.stations, shaft.stations) == (["a", "b"], ["c", "d"], ["b", "c"])
    assert (shaft.is_plumb, one.is_plumb) == (True, False)


def test_a_shaft_between_level_drifts_makes_a_volume_and_a_step_under_a_metre_is_left_out(tmp_path, capsys):
    path = tmp_path / "a.csv"
    head = "leg,station,easting_m,northing_m,left_m,right_m,elevation_m\n"
    params = PassageSurveyParams(kind="passages", name="a", file="data/a.csv", heights=None)
    params = params.model_copy(update={"file": path.as_posix()})
    path.write_text(f"{head}A,a,0,0,2,2,5\nA,b,9,0,2,2,5\nS,b,9,0,2,2,5\nS,c,9,0,2,2,-7\n")
    assert np.ptp(read_vector_survey(params).shape.positions_m[:, 2]) == 12.0
    path.write_text(path.read_text().replace(",-7", ",4.5"))
    read = read_vector_survey(params)
    assert (type(read.shape), read.heights) == (DrawnPlan, None)
    assert "1 shafts are left out, the deepest 0.5 m, from b to c" in capsys.readouterr().err


def test_a_table_with_heights_may_use_a_national_grid(tmp_path):
    path = tmp_path / "a.csv"
    head = "leg,station,easting_m,northing_m,left_m,right_m,elevation_m\n"
    path.write_text(f"{head}A,a,450000.25,7100000,2,2,10250\nA,b,450009,7100000,2,2,10251\n")
    (leg,) = read_station_legs(path)
    np.testing.assert_array_equal(leg.positions_m[0], (450000.25, 7100000))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("A,a,0,0,2,2,0\nA,b,0,0,2,2,0.9\n", r"a\.csv: every leg is plumb; nothing to drive on"),
        ("A,a,0,0,2,2,0\nA,b,90000,0,2,2,9\n", r"a\.csv: a to b are 90000 m apart, at most 10000 m"),
    ],
)
def test_a_table_without_a_drift_and_a_shot_of_many_kilometres_are_refused(tmp_path, rows, message):
    path = tmp_path / "a.csv"
    path.write_text(f"leg,station,easting_m,northing_m,left_m,right_m,elevation_m\n{rows}")
    params = PassageSurveyParams(kind="passages", name="a", file="data/a.csv", heights=None)
    with pytest.raises(InputError, match=message):
        read_vector_survey(params.model_copy(update={"file": path.as_posix()}))


def test_pieces_of_a_table_with_heights_need_not_be_connected_and_the_longest_is_built(tmp_path, capsys):
    path = tmp_path / "a.csv"
    rows = "A,a,0,0,2,2,5\nA,b,30,0,2,2,7\nB,c,0,50,2,2,5\nB,d,20,50,2,2,5\n"
    path.write_text(f"leg,station,easting_m,northing_m,left_m,right_m,elevation_m\n{rows}")
    params = PassageSurveyParams(kind="passages", name="a", file="data/a.csv", heights=None)
    params = params.model_copy(update={"file": path.as_posix()})
    assert read_vector_survey(params).workings.bounds[3] < 3
    assert "built is the one of 30 m about a; --piece (survey.piece) builds another: 20 m about c" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize("heights", ["", "5"])
def test_pieces_of_a_level_table_are_built_and_listed_as_those_with_heights(tmp_path, capsys, heights):
    path = tmp_path / "a.csv"
    rows = [("A", "a", 0, 0), ("A", "b", 30, 0), ("B", "c", 0, 50), ("B", "d", 20, 50)]
    column = ",elevation_m" if heights else ""
    text = [",".join(map(str, (*row, 2, 2, *heights))) for row in rows]
    path.write_text("\n".join([HEADER.strip() + column, *text]))
    params = PassageSurveyParams(kind="passages", name="a", file="data/a.csv", heights=None)
    params = params.model_copy(update={"file": path.as_posix()})
    read = read_vector_survey(params)
    assert (type(read.shape), len(read.workings.geoms), read.workings.bounds[3] < 3) == (DrawnPlan, 1, True)
    assert "built is the one of 30 m about a; --piece (survey.piece) builds another: 20 m about c" in (
        capsys.readouterr().err
    )
    for piece in ("c", (0.0, 51.0, 0.0 if not heights else 5.0)):
        assert read_vector_survey(params.model_copy(update={"piece": piece})).workings.bounds[1] > 40
    assert detect_here(str(path), {"piece": "c"}).values["values"]["piece"] == "c"
    with pytest.raises(InputError, match="no station has this name; names like it are"):
        read_vector_survey(params.model_copy(update={"piece": "e"}))


def read_table(tmp_path, text, **values):
    """Return the reading of a table of stations."""
    params = PassageSurveyParams(kind="passages", name="a", file="data/a.csv", heights=None)
    return read_vector_survey(params.model_copy(update={"file": write(tmp_path, text).as_posix(), **values}))


FULL = "A,a,0,0,2,2{0}\nA,b,40,0,2,2{0}\nA,c,80,0,2,2{1}\n"


@pytest.mark.parametrize("column", ["", ",elevation_m"])
@pytest.mark.parametrize("unknown", ["", "-"])
def test_a_wall_that_was_not_measured_is_taken_as_in_other_surveys_and_listed(tmp_path, capsys, column, unknown):
    text = HEADER.strip() + column + "\n" + (FULL.format(",5", ",9") if column else FULL.format("", ""))
    whole = read_table(tmp_path, text).workings
    assert "wall" not in capsys.readouterr().err
    one = read_table(tmp_path, text.replace("40,0,2,2", f"40,0,2,{unknown}")).workings
    assert one.symmetric_difference(whole).area < 1e-6
    assert "1 of 3 stations of passages lack a wall on a side that most stations" in capsys.readouterr().err
    side = text.replace(",0,2,2", f",0,2,{unknown}")
    with pytest.raises(InputError, match=r"no station has a distance to both walls; state it \(survey\.half_width_m"):
        read_table(tmp_path, side)
    assert read_table(tmp_path, side, half_width_m=3.0).workings.bounds[1] == pytest.approx(-3.0)
    assert "3 of 3 stations of passages have no measured wall beside them; 3.00 m" in capsys.readouterr().err


def test_repeated_rows_are_left_out_and_two_names_of_one_place_are_one_station(tmp_path, capsys):
    once = HEADER + "A,a,0,0,2,2\nA,b,40,0,2,2\nB,b,40,0,2,2\nB,c,40,50,2,2\n"
    whole = read_table(tmp_path, once).workings
    assert capsys.readouterr().err == ""
    twice = once.replace("A,b,40,0,2,2\n", "A,b,40,0,2,2\n" * 2)
    assert read_table(tmp_path, twice).workings.equals(whole)
    assert "1 rows repeat the row before, the first in line 4; left out" in capsys.readouterr().err
    with pytest.raises(InputError, match=r":4: station b occurs twice in leg A"):
        read_table(tmp_path, once.replace("B,b,40", "A,b,40,0,2,3\nB,b,40"))
    read = read_table(tmp_path, once.replace("B,b,40,0", "B,b2,40.008,0")).workings
    assert read.symmetric_difference(whole).area < 1.0
    told = capsys.readouterr().err
    assert "1 stations have another name in another leg and are one with it, the first b2 and b at (40.0, 0.0)" in told
    assert "pieces" not in told
    with pytest.raises(InputError, match="stations a and b of leg A have one position"):
        read_table(tmp_path, once.replace("A,b,40,0", "A,b,0,0").replace("B,b,40,0", "B,b,0,0"))


def test_absent_columns_of_walls_are_empty_ones(tmp_path, capsys):
    narrow = "leg,station,easting_m,northing_m\nA,a,0,0\nA,b,40,0\n"
    assert read_table(tmp_path, narrow, half_width_m=2.0).workings.bounds[1::2] == pytest.approx((-2, 2), abs=0.1)
    assert "2 of 2 stations of passages have no measured wall beside them; 2.00 m is taken" in capsys.readouterr().err
    with pytest.raises(InputError, match="--half-width"):
        read_table(tmp_path, narrow)
    with pytest.raises(InputError, match=r"no column left_m, right_m in the first line"):
        read_stations(write(tmp_path, narrow))
    one = "leg,station,easting_m,northing_m,left_m\nA,a,0,0,1\nA,b,40,0,1\n"
    assert read_table(tmp_path, one, half_width_m=2.0).workings.bounds[1::2] == pytest.approx((-2, 1), abs=0.1)


def test_four_zeros_in_a_table_are_a_section_that_nobody_measured(tmp_path, capsys):
    table = HEADER.strip() + ",elevation_m,up_m,down_m\nA,a,0,0,2,2,10,3,0\nA,b,40,0,{},12,{},{}\nA,c,60,0,2,2,14,3,0\n"
    zeros = read_table(tmp_path, table.format("0,0", "0", "0.0")).shape
    told = capsys.readouterr().err
    empty = read_table(tmp_path, table.format(",", "", "")).shape
    np.testing.assert_array_equal(zeros.lrud_m, empty.lrud_m)
    assert "1 of 3 stations of passages lack a wall" in told
    with pytest.raises(InputError, match="the roof at 12 m is not above the floor at 12 m"):
        read_table(tmp_path, table.format("0,1", "0", "0"))


def test_columns_that_are_not_read_are_listed(tmp_path, capsys):
    read_table(tmp_path, HEADER.strip() + ",depth_m,note\nA,a,0,0,2,2,10,x\nA,b,40,0,2,2,20,y\n")
    assert "2 columns are not read (depth_m, note); heights are read from elevation_m" in capsys.readouterr().err


def test_measured_roofs_of_a_level_survey_are_listed_with_the_option_that_builds_them(tmp_path, capsys):
    rows = "\nA,a,0,0,2,2,10,2\nA,b,40,0,2,2,10,15\nA,c,60,0,2,2,10,\n"
    read_table(tmp_path, HEADER.strip() + ",elevation_m,up_m" + rows)
    told = capsys.readouterr().err
    assert "2 of 3 stations have a measured roof, 2.00 to 15.00 m over the floor" in told
    assert "survey.flat_step_m=0 builds the roofs" in told


def test_columns_in_feet_are_read_as_metres_and_listed(tmp_path, capsys):
    metres = read_table(tmp_path, f"{HEADER}A,a,0,0,3.048,3.048\nA,b,30.48,0,3.048,3.048\n").workings
    feet = f"{HEADER.replace('_m', '_ft')}A,a,0,0,10,10\nA,b,100,0,10,10\n"
    assert read_table(tmp_path, feet).workings.symmetric_difference(metres).area < 1e-9
    assert "4 columns are in units of 0.3048 m (easting_ft, northing_ft, left_ft, right_ft)" in capsys.readouterr().err
    with pytest.raises(InputError, match=r":2: left_m = 'ten' is not a number"):
        read_table(tmp_path, feet.replace("10,10\nA,b", "ten,10\nA,b"))


def test_heights_under_the_step_are_listed_with_the_option_that_builds_them(tmp_path, capsys):
    path = tmp_path / "a.csv"
    path.write_text(f"{HEADER.strip()},elevation_m\nA,a,0,0,2,2,10\nA,b,40,0,2,2,10.9\n")
    assert not detect_here(str(path), {}).values["has_heights"]
    told = capsys.readouterr().err
    assert "its elevations differ by 0.90 m, no more than 1 m, and it is built level; survey.flat_step_m=0" in told
    assert detect_here(str(path), {}, {"flat_step_m": 0.0}).values["has_heights"]
    assert (
        "2 of 2 stations have no measured roof; compile3d.height_m over the floor is taken" in capsys.readouterr().err
    )
    path.write_text(path.read_text().replace("10.9", "10"))
    assert not detect_here(str(path), {}).values["has_heights"]
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("A,b,4_0,0,2,2", ":3: easting_m = '4_0' is not a number"),
        ("A,b,\u0664\u0660,0,2,2", ":3: easting_m = '\u0664\u0660' is not a number"),
        ("A,b,40\u00a0,0,2,2", r":3: easting_m = '40\\xa0' is not a number"),
        ("A,b\x1b[31m,40,0,2,2", r":3: station = 'b\\x1b\[31m': want a name of printable characters"),
        ("A\u202e,b,40,0,2,2", r":3: leg = 'A\\u202e': want a name of printable characters"),
        ("A,,40,0,2,2", ":3: station = '': want a name of printable characters"),
        ("A,b,40,0,2,2\rB,c,1,1,1,1\r", ":3: a line end of CR alone; save the file with line ends of LF or CR LF"),
    ],
)
def test_what_only_python_reads_as_a_number_or_nobody_as_a_name_is_refused(tmp_path, row, message):
    path = tmp_path / "s.csv"
    path.write_bytes(f"{HEADER}A,a,0,0,2,2\n{row}\n".encode())
    with pytest.raises(InputError, match=message):
        read_stations(path)


def test_a_table_that_is_read_alone_has_the_names_and_grades_of_its_legs(tmp_path):
    rows = "A,a,0,0,2,3,0.1\nA,b,10,0,2,3,\nA,c,20,0,2,3,\nB,b,10,0,1,1,\nB,d,10,8,1,1,\n"
    survey = solve_file(write(tmp_path, HEADER.strip() + ",rise_over_run\n" + rows))
    assert [passage.name for passage in survey.passages] == ["A", "B"]
    assert survey.passages[0].grades == pytest.approx([0.1, np.nan], nan_ok=True)
    assert np.isnan(survey.passages[1].grades).all()
    assert survey.names == ("a", "b", "c", "d")
    assert survey.legs.tolist() == [[0, 1], [1, 2], [1, 3]]
    assert not survey.has_elevations
    assert not survey.positions_m[:, 2].any()
    assert survey.passages[1].lrud_m[:, :2].tolist() == [[1, 1], [1, 1]]
    high = solve_file(write(tmp_path, HEADER.strip() + ",elevation_m\nA,a,0,0,2,2,10\nA,b,40,0,2,2,20\n"))
    assert high.has_elevations
    assert high.passages[0].grades is None
