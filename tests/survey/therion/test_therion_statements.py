"""What a Therion file states beside its shots changes places as in Therion 6.1.6, which is the witness."""

import shutil
import subprocess

import numpy as np
import pyproj
import pytest

from minesurveys.solved.survex_3d import read_3d
from minesurveys.solved_surveys import entrances_of, solve_file
from tests.project import ROOT
from tests.solved import needs_cavern, position_of

pytestmark = needs_cavern
GIVEN = ROOT.parent / "shared/data/turn4"
NORMAL = "data normal from to length compass clino\n"
SHOTS = f"{NORMAL}1 2 100 0 0\n2 3 100 90 0\n"
LOOP = f"{NORMAL}1 2 40 90 0\n2 3 40 0 0\n%s3 4 60 270 0\n4 1 40 180 0\n2 5 60 90 0\n"
UTM = "cs UTM33\nfix 1 400000 5000000 300\n"
LISTED = "survey m -declination [2000.1.1 10 2010.1.1 20 deg]\ncentreline\n"

# Each text, a station, and where Therion 6.1.6 has it.
STATED = {
    "a unit without a factor keeps the one before": (
        f"units length 2 metres\nunits length feet\n{SHOTS}",
        ("3", (60.96, 60.96, 0)),
    ),
    "a factor is replaced by another one": (
        f"units length 2 metres\nunits length 1 metres\n{SHOTS}",
        ("3", (100, 100, 0)),
    ),
    "mils are grads": (f"declination 100 mils\n{SHOTS}", ("2", (100, 0, 0))),
    "units of places": (f"units position 2 feet\nfix 1 100 100 100\n{SHOTS}", ("1", (60.96, 60.96, 60.96))),
    "units of places in a system are those of the height": (
        f"units position cm\n{UTM}declination 0 deg\n{SHOTS}",
        ("1", (400000, 5000000, 3)),
    ),
    "a correction of places": (f"calibrate position 5\nfix 1 0 0 0\n{SHOTS}", ("1", (-5, -5, -5))),
    "deviations of fixes": (f"fix 1 0 0 0 10\nfix 3 112 100 50 10\n{SHOTS}", ("1", (5.98, 0, 24.81))),
    "deviations of the plan and of the height": (
        f"fix 1 0 0 0 10 1\nfix 3 112 100 50 10 1\n{SHOTS}",
        ("1", (5.98, 0, 14.19)),
    ),
    "an exact fix stays": (f"fix 1 0 0 0\nfix 3 112 100 0 10 10 10\n{SHOTS}", ("3", (100.09, 100, 0))),
    "deviations have the units of places": (
        f"units position feet\nfix 1 100 100 100\nfix 3 400 400 100 3 3 3\n{SHOTS}",
        ("2", (26.41, 130.46, 30.48)),
    ),
    "several fixes are weighted by their deviations": (
        f"{UTM} 1 1 1\nfix 1 400010 5000020 304 3 3 3\ndeclination 0 deg\n{SHOTS}".replace("300\n 1", "300 1"),
        ("1", (400001, 5000002, 300.4)),
    ),
    "a deviation of places in general changes nothing": (
        f"sd position 10 metres\nfix 1 0 0 0\nfix 3 112 100 0\n{SHOTS}",
        ("2", (11.95, 100, 0)),
    ),
    "deviations of readings weigh a loop": (
        "sd length 0.01 metres\nsd compass clino 0.1 deg\n" + LOOP % "sd length 1 metres\n",
        ("4", (-0.11, 40, 0)),
    ),
    "a grade weighs a loop": (
        "grade BCRA5\n" + LOOP % f"endcentreline\ncentreline\ngrade BCRA3\n{NORMAL}",
        ("4", (-16.02, 40, 0)),
    ),
    "no data line": ("1 2 40 90 0\n2 3 40 0 0\n", ("3", (40, 40, 0))),
    "names of stations": (f'station-names "a" "b"\n{SHOTS}fix 1 5 0 0\n', ("a3b", (105, 100, 0))),
    "vectors turn by a stated declination": (
        "declination 5 deg\ndata cartesian from to easting northing altitude\n1 2 0 100 0\n2 3 100 0 7\n",
        ("3", (108.34, 90.9, 7)),
    ),
    "vectors in feet turn by the convergence, too": (
        f"{UTM}declination 5 deg\nunits dx dy feet\ndata cartesian from to easting northing altitude\n1 2 0 100 0\n",
        ("2", (400003.13, 5000030.32, 300)),
    ),
    "two readings of a shot, the first flagged": (
        f"{NORMAL}flags duplicate\n1 2 30 90 0\nflags not duplicate\n1 2 31 90 0\n2 3 10 90 0\n",
        ("3", (40.5, 0, 0)),
    ),
    "coordinates to the west and the south": (
        f"cs EPSG:2048\nfix 1 50000 3700000 300\ndeclination 3 deg\n{SHOTS}",
        ("3", (-49895.39, -3699904.83, 300)),
    ),
}


def solved(tmp_path, text):
    whole = text if text.startswith("survey") else f"survey m\ncentreline\n{text}"
    (tmp_path / "m.th").write_text(f"{whole}endcentreline\nendsurvey\n")
    return solve_file(tmp_path / "m.th")


def lengths(survey):
    legs = survey.legs[survey.centreline()]
    return np.linalg.norm(survey.positions_m[legs[:, 0]] - survey.positions_m[legs[:, 1]], axis=1)


@pytest.mark.parametrize("case", STATED)
def test_a_statement_puts_stations_where_therion_does(tmp_path, case):
    text, (station, place) = STATED[case]
    np.testing.assert_allclose(position_of(solved(tmp_path, text))[f"m.{station}"], place, atol=0.011)


@pytest.mark.skipif(shutil.which("therion") is None, reason="Therion is not installed (Debian: therion)")
@pytest.mark.parametrize("case", STATED)
def test_therion_itself_puts_every_station_there(tmp_path, case):
    text, _ = STATED[case]
    ours = solved(tmp_path, text)
    (tmp_path / "thconfig").write_text("source m.th\nexport model -fmt survex -o m.3d\n")
    subprocess.run(["therion", "-q"], cwd=tmp_path, check=True, capture_output=True)
    theirs, at = read_3d(tmp_path / "m.3d"), position_of(ours)
    for name, place in position_of(theirs).items():
        reversed_axes = -1 if "EPSG:2048" in text else 1  # Therion keeps them; a plan has axes to the east and north
        np.testing.assert_allclose(at[name] * [reversed_axes, reversed_axes, 1], place, atol=0.011)


def test_deviations_of_two_fixes_share_a_difference_as_in_therion():
    path = GIVEN / "therion-gps-sd.th"
    if not path.is_file():
        pytest.skip("the shared inputs are not here")
    survey = solve_file(path)
    assert lengths(survey).sum() == pytest.approx(140.0, abs=0.02)
    np.testing.assert_allclose(position_of(survey)["gps.e1"], (500006, 5000000, 500), atol=0.011)
    np.testing.assert_allclose(position_of(survey)["gps.e2"], (500106, 5000000, 500), atol=0.011)


def test_two_exact_places_of_a_station_are_averaged_and_listed(tmp_path, capsys):
    at = position_of(solved(tmp_path, f"fix 1 0 0 300\nfix 1 10 20 304\n{SHOTS}"))
    np.testing.assert_allclose(at["m.1"], (5, 10, 302), atol=0.011)
    assert "2 places of station 1 are stated; their mean is taken, 11.36 m from the farthest" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("dates", "degrees"),
    [
        ("date 2005.1.1\n", 15),
        ("date 2012.1.1\n", 20),
        ("date 1995.1.1\n", 10),
        ("date 2002.1.1\ndate 2009.1.1\n", 15.5),  # the middle of the first and the last
        ("date 2002.1.1\ndate 2009.1.1\ndate 2003.1.1\n", 15.5),
        ("date 2002.1.1-2009.1.1\n", 15.5),
        ("date 2002.1.1 - 2009.1.1\n", 12),  # Therion reads one word
        ("", 15),
    ],
)
def test_a_list_of_declinations_is_read_at_the_date_of_the_centreline(tmp_path, dates, degrees):
    at = position_of(solved(tmp_path, f"{LISTED}{dates}{SHOTS}"))
    turned = np.deg2rad(degrees)
    np.testing.assert_allclose(at["m.2"], (100 * np.sin(turned), 100 * np.cos(turned), 0), atol=0.02)


def test_a_list_of_declinations_may_state_one_for_data_without_a_date(tmp_path):
    text = LISTED.replace("[", "[- 90 ")
    np.testing.assert_allclose(position_of(solved(tmp_path, f"{text}{SHOTS}"))["m.2"], (100, 0, 0), atol=0.011)


def test_the_mean_of_a_list_is_listed_for_data_without_a_date(tmp_path, capsys):
    solved(tmp_path, f"{LISTED}{SHOTS}")
    assert "a centreline without a date takes 15.00 deg, the mean of its declinations" in capsys.readouterr().err


def test_the_computed_declination_is_that_of_the_middle_of_all_dates_of_a_centreline(tmp_path):
    shot = f"{NORMAL}1 2 1000 0 0\n"
    at = [
        position_of(solved(tmp_path, f"{UTM}{dates}{shot}"))["m.2"]
        for dates in ("date 1960.1.1\ndate 2019.1.1\n", "date 2019.1.1\ndate 1960.1.1\n")
    ]
    for place in at:
        np.testing.assert_allclose(place, (400028.25, 5000999.6, 300), atol=0.03)  # as Therion 6.1.6


@pytest.mark.parametrize(
    ("system", "place"),
    [
        ("JTSK", "600000 1100000"),
        ("iJTSK", "-600000 -1100000"),
        ("EPSG:5513", "600000 1100000"),
        ("EPSG:5514", "-600000 -1100000"),
    ],
)
def test_the_axes_of_krovaks_grid_are_read_by_their_directions(tmp_path, system, place):
    at = position_of(solved(tmp_path, f"cs {system}\nfix 1 {place} 300\ndeclination 3 deg\n{SHOTS}"))
    np.testing.assert_allclose(at["m.1"], (-600000, -1100000, 300), atol=0.011)
    bearing = np.degrees(np.arctan2(*(at["m.2"] - at["m.1"])[:2]))
    assert bearing == pytest.approx(3 + 6.3, abs=0.3)  # the grid's north is 6.3 deg west of true north there
    turn = np.cross((at["m.2"] - at["m.1"])[:2], (at["m.3"] - at["m.2"])[:2])
    assert turn == pytest.approx(-10_000, rel=0.01)  # a leg to the right stays one


@pytest.mark.parametrize("system", ["iJTSK", "iJTSK03"])
def test_bearings_in_krovaks_grid_turn_by_the_convergence_that_proj_has(tmp_path, system):
    at = position_of(
        solved(tmp_path, f"cs {system}\nfix 1 -600000 -1100000 300\ndeclination 0 deg\n{NORMAL}1 2 9999 0 0\n")
    )
    turned = np.degrees(np.arctan2(*(at["m.2"] - at["m.1"])[:2]))
    grid = pyproj.CRS("EPSG:5514" if system == "iJTSK" else "EPSG:8353")
    place = pyproj.Transformer.from_crs(grid, grid.geodetic_crs, always_xy=True).transform(-600_000, -1_100_000)
    assert turned == pytest.approx(-pyproj.Proj(grid).get_factors(*place).meridian_convergence, abs=0.005)
    if system == "iJTSK03" and shutil.which("therion") is not None:  # the other one needs a grid from the network
        (tmp_path / "thconfig").write_text("source m.th\nexport model -fmt survex -o m.3d\n")
        subprocess.run(["therion", "-q"], cwd=tmp_path, check=True, capture_output=True)
        theirs = position_of(read_3d(tmp_path / "m.3d"))
        angle = np.degrees(np.arctan2(*(theirs["m.2"] - theirs["m.1"])[:2]))
        assert turned - angle == pytest.approx(0.0237, abs=0.002)  # docs/adr/0013-survex.md


def test_a_group_takes_back_what_it_stated(tmp_path):
    text = (
        f"{NORMAL}1 2 10 0 0\ngroup\nunits length 2 metres\ndata normal to from length compass clino\nflags duplicate\n"
        "3 2 10 0 0\nendgroup\n3 4 10 0 0\n"
    )
    survey = solved(tmp_path, text)
    np.testing.assert_allclose(position_of(survey)["m.4"], (0, 40, 0), atol=0.011)
    assert lengths(survey).tolist() == pytest.approx([10, 10], abs=0.011)


def test_a_grade_of_the_project_itself_weighs_and_an_unknown_one_is_listed(tmp_path, capsys):
    text = LOOP % f"endcentreline\ncentreline\ngrade rough\n{NORMAL}"
    whole = f"survey m\ngrade rough\nlength 5 metres\ncompass 5 deg\nendgrade\ncentreline\n{text}"
    moved = position_of(solved(tmp_path, whole))["m.2"] - (40, 0, 0)
    assert np.abs(moved).max() < 0.02  # the rough shots take the misclosure
    solved(tmp_path, f"grade none-such\n{SHOTS}")
    assert "grade none-such is not defined" in capsys.readouterr().err


def test_the_entrance_that_a_survey_states_is_one_as_in_therion(tmp_path):
    inner = f"survey b -entrance 2@c\nsurvey c\ncentreline\n{SHOTS}endcentreline\nendsurvey\nendsurvey\n"
    text = f'survey a -entrance 3 -title "A"\n{inner}centreline\n{SHOTS}endcentreline\nequate 1 1@c.b\nendsurvey\n'
    (tmp_path / "m.th").write_text(text)
    assert sorted(entrances_of(solve_file(tmp_path / "m.th"))) == ["a.3", "a.b.c.2"]


def test_a_drawing_is_not_opened_and_may_lie_outside_the_survey_s_folder(tmp_path):
    text = f"survey m\ninput ../drawn/plan.th2\ncentreline\n{SHOTS}endcentreline\nendsurvey\n"
    (tmp_path / "m.th").write_text(text)
    survey = solve_file(tmp_path / "m.th")
    assert len(survey.legs) == 2
    assert survey.files == (tmp_path / "m.th",)
