"""Therion centrelines in Survex's form, and Wheal Pell's project beside the file that Therion made of it."""

import itertools
import subprocess
from datetime import date
from pathlib import Path

import numpy as np
import pyproj
import pytest

from benchmarks.fuzzing.surveys import THERION, ring_3d
from minesurveys.solved.model import LegFlag
from minesurveys.solved.survex_3d import read_3d
from minesurveys.solved_surveys import entrances_of, solve_file, survey_files
from minesurveys.therion.convert import to_survex
from minesurveys.therion.place import _convergence_deg, _square
from pipeline.errors import InputError
from tests.project import ROOT
from tests.solved import needs_cavern, position_of, read_passages, write

PELL = ROOT.parent / "shared/data/wheal_pell"


def centreline(text: str) -> str:
    return f"survey m\ncentreline\n{text}\nendcentreline\nendsurvey\n"


def solved(tmp_path: Path, text: str) -> dict:
    return position_of(solve_file(write(tmp_path, {"m.th": centreline(text)})))


NORMAL = "data normal from to length compass clino\n"


@needs_cavern
def test_a_project_in_two_files_is_solved_with_equates_splays_and_flags(tmp_path):
    path = write(tmp_path, THERION)
    survey = solve_file(path)
    at = position_of(survey)
    np.testing.assert_allclose(at["mine.north.3"], at["mine.south.1"])
    np.testing.assert_allclose(at["mine.north.1"], (380000, 6290000, 2400))
    assert sorted(survey.leg_flags.tolist()).count(LegFlag.SPLAY) == 2
    assert (survey.leg_flags == LegFlag.SURFACE).sum() == 1
    assert (survey.title, survey.crs) == ("mine", "EPSG:32719")
    assert [file.name for file in survey_files(path)] == ["mine.th", "north.th"]
    legs, _ = read_passages(path)
    assert [len(leg.stations) for leg in legs] == [4, 3]


@needs_cavern
def test_names_with_points_as_instruments_write_them_are_stations_of_one_survey(tmp_path):
    text = centreline(f"{NORMAL}1.0 1.1 10 0 0\n1.1 - 2 90 0\n1.1 2.10 10 90 0\n2.10 2.1 5 90 0\n")
    other = "survey 2\ncentreline\ndata normal from to length compass clino\n1 3 7 0 0\nendcentreline\nendsurvey\n"
    whole = f"survey a\n{text}{other}equate 2.1@m 1@2\nendsurvey\n"
    at = position_of(solve_file(write(tmp_path, {"m.th": whole})))
    np.testing.assert_allclose(at["a.m.2.10"] - at["a.m.1.0"], (10, 10, 0), atol=0.011)
    np.testing.assert_allclose(at["a.2.3"] - at["a.m.2.1"], (0, 7, 0), atol=0.011)
    assert set(solved(tmp_path, NORMAL + "1. 2 10 0 0\n")) == {"m.1.", "m.2"}
    with pytest.raises(InputError, match=r"m\.th:4: station '\.1': a name does not begin with a point"):
        solved(tmp_path, NORMAL + ".1 2 10 0 0\n")


@needs_cavern
def test_names_of_any_characters_are_read_and_a_station_may_have_its_surveys_name(tmp_path):
    names = ["P1'", "a~b", "1*", "x,y", "/3", "2+7", "sub", "Š", "a;b", "*include"]
    shots = "".join(f"{start} {end} 10 90 0\n" for start, end in itertools.pairwise(names))
    inner = f"survey sub'\ncentreline\n{NORMAL}0 sub' 5 0 0\nendcentreline\nendsurvey\n"
    sub = inner.replace("sub'", "sub")
    text = f"survey m\ncentreline\n{NORMAL}{shots}endcentreline\n{inner}{sub}"
    at = position_of(solve_file(write(tmp_path, {"m.th": f"{text}equate 0@sub' sub 0@sub\nendsurvey\n"})))
    np.testing.assert_allclose([at[f"m.{name}"] for name in names], [(10 * k, 0, 0) for k in range(10)], atol=0.011)
    np.testing.assert_allclose(at["m.sub'.sub'"], (60, 5, 0), atol=0.011)
    np.testing.assert_allclose(at["m.sub.sub"], (60, 5, 0), atol=0.011)


@needs_cavern
def test_an_error_of_survex_shows_names_as_the_file_has_them(tmp_path):
    with pytest.raises(InputError, match=r"m\.th:4: .*“m\.P1'”"):
        solved(tmp_path, NORMAL + "P1' P1' 10 90 0\n")


@needs_cavern
def test_options_of_surveys_take_as_many_words_as_therion_gives_them(tmp_path):
    options = (
        '-attr depth 12 -author 2001.2 "A Person" -title "A mine" -person-rename "A B" "C D" -declination [90 deg]'
    )
    text = centreline(f"{NORMAL}1 2 10 0 0\n").replace("survey m", f"survey m {options}", 1)
    at = position_of(solve_file(write(tmp_path, {"m.th": text})))
    np.testing.assert_allclose(at["m.2"] - at["m.1"], (10, 0, 0), atol=0.011)


@needs_cavern
def test_a_project_of_more_than_two_hundred_files_is_read(tmp_path):
    part = f"survey s{{0}}\ncentreline\n{NORMAL}{{0}} {{1}} 10 0 0\nendcentreline\nendsurvey\n"
    files = {f"{k}.th": part.format(k, k + 1) for k in range(250)}
    equates = "".join(f"equate {k + 1}@s{k} {k + 1}@s{k + 1}\n" for k in range(249))
    inputs = "".join(f"input {k}\n" for k in range(250))
    survey = solve_file(write(tmp_path, {"m.th": f"survey m\n{inputs}{equates}endsurvey\n", **files}))
    assert np.ptp(survey.positions_m[:, 1]) == pytest.approx(2500, abs=0.1)
    assert len(survey.legs) == 250


IMPORTED = "import solved.3d -surveys create"


@needs_cavern
@pytest.mark.parametrize(
    ("line", "names"),
    [
        (IMPORTED, {"m.mine.0", "m.mine.1", "m.mine.2", "m.mine.3"}),
        ("import solved.3d -surveys ignore", {f"m.mine.{k}" for k in range(4)}),
        ("import solved -format 3d -filter mine.", {f"m.{k}" for k in range(4)}),
    ],
)
def test_an_imported_survey_keeps_its_places_legs_and_cross_sections(tmp_path, line, names):
    line = line.replace("solved ", "solved.3d ")
    path = write(tmp_path, {"m.th": f"survey m\n{line}\nendsurvey\n", "solved.3d": ring_3d()})
    survey, alone = solve_file(path), read_3d(tmp_path / "solved.3d")
    at, before = position_of(survey), position_of(alone)
    assert set(at) == names
    for name, (_, place) in zip(sorted(at), sorted(before.items()), strict=True):
        np.testing.assert_array_equal(at[name], place)
    assert len(survey.legs) == len(alone.legs) == 4
    np.testing.assert_array_equal(survey.passages[0].lrud_m, alone.passages[0].lrud_m)
    assert [file.name for file in survey_files(path)] == ["m.th", "solved.3d"]


@needs_cavern
def test_shots_join_stations_of_an_imported_survey_which_may_be_moved(tmp_path):
    shots = f"centreline\n{NORMAL}1 new 10 0 0\nendcentreline\nequate 1 2@mine\n"
    moved = f"{IMPORTED} -calibrate [0 0 0 1000 2000 5]"
    path = write(tmp_path, {"m.th": f"survey m\n{moved}\n{shots}endsurvey\n", "solved.3d": ring_3d()})
    np.testing.assert_allclose(position_of(solve_file(path))["m.new"], (1030, 2030, 5.3), atol=0.011)


@needs_cavern
def test_a_station_of_two_imported_files_stays_where_the_first_has_it(tmp_path):
    other = ring_3d([(500, 0, 0), (500, 2000, 10), (3500, 2000, 30), (3500, 0, 10)])
    text = f"survey m\n{IMPORTED}\nimport other.3d\nendsurvey\n"
    path = write(tmp_path, {"m.th": text, "solved.3d": ring_3d(), "other.3d": other})
    np.testing.assert_array_equal(position_of(solve_file(path))["m.mine.0"], (0, 0, 0))


@needs_cavern
def test_an_imported_station_is_in_the_survey_that_the_project_has_and_else_keeps_the_prefix_in_its_name(tmp_path):
    """As in Therion's sample of large projects, whose survey `create` is made by an import after the first one."""
    files = {
        "m.th": "import whole.3d -surveys use\nsurvey cave\nsurvey west\nendsurvey\n"
        "import whole.3d -filter cave. -surveys create -calibrate [0 0 0 7 0 0]\nendsurvey\n",
        "whole.3d": b"",
    }
    shots = "*data cartesian from to dx dy dz\n1 2 3 0 0\n"
    wings = "".join(f"*begin {wing}\n{shots}*end {wing}\n" for wing in ("west", "east"))
    source = f"*begin cave\n*fix west.1 0 0 0\n*fix east.1 0 50 0\n{wings}*end cave\n"
    path = write(tmp_path, {**files, "whole.svx": source})
    subprocess.run(["cavern", "-q", "-s", "-o", "whole.3d", "whole.svx"], cwd=tmp_path, check=True)
    at = position_of(solve_file(path))
    assert {name for name in at if "west" in name} == {"cave.west.1", "cave.west.2"}
    np.testing.assert_allclose(at["cave.west.2"], (3, 0, 0))  # the first file has it, not the moved one
    east = sorted(at[name][0] for name in at if name.startswith("cave.east.2"))
    assert east == [3.0, 10.0]  # the station east.2 of `cave`, and the station 2 of `cave.east`


@needs_cavern
def test_splays_of_every_style_end_at_stations_without_a_name(tmp_path):
    text = "data cartesian from to dx dy dz\na b 3 4 5\na - 1 0 0\nb . 2 0 0\n"
    text += "data cylpolar from to length compass fromdepth todepth\nb - 2 90 0 0\n"
    survey = solve_file(write(tmp_path, {"m.th": centreline(f"{text}flags splay\nb c 1 90 0 0\n")}))
    assert sorted(survey.leg_flags.tolist()) == [0, *4 * [LegFlag.SPLAY]]
    assert sorted(survey.names) == ["", "", "", "m.a", "m.b", "m.c"]


@needs_cavern
def test_fixed_stations_in_degrees_are_brought_to_their_zone(tmp_path):
    for cs, place in (("lat-long", "50:18:00 -5.2115"), ("long-lat", "-5:12.69 50.3"), ("EPSG:4326", "50.3 -5.2115")):
        text = f"cs {cs}\nfix 1 {place} 100\n{NORMAL}1 2 10 0 90\n"
        survey = solve_file(write(tmp_path, {"m.th": centreline(text)}))
        east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32630", always_xy=True).transform(-5.2115, 50.3)
        np.testing.assert_allclose(position_of(survey)["m.1"], (east, north, 100), atol=0.1)
        assert "32630" in survey.crs


@needs_cavern
def test_a_declination_of_a_dash_takes_back_the_stated_one(tmp_path):
    at = solved(tmp_path, f"declination 100 mils\n{NORMAL}1 2 10 0 0\ndeclination -\n2 3 10 0 0\n")
    np.testing.assert_allclose(at["m.2"] - at["m.1"], (10, 0, 0), atol=0.011)
    np.testing.assert_allclose(at["m.3"] - at["m.2"], (0, 10, 0), atol=0.011)


@needs_cavern
def test_a_grid_angle_is_a_declination_from_grid_north(tmp_path):
    text = f"cs UTM30N\nfix 1 200000 5575000 0\ngrid-angle 90 degrees\n{NORMAL}1 2 100 0 0\n"
    at = solved(tmp_path, text)
    np.testing.assert_allclose(at["m.2"] - at["m.1"], (100, 0, 0), atol=0.1)


@needs_cavern
def test_consecutive_shots_between_two_stations_are_averaged(tmp_path):
    at = solved(tmp_path, NORMAL + "1 2 10 359 0\n1 2 11 1 0\n1 2 12 0 0\n2 3 5 90 0\n")
    np.testing.assert_allclose(at["m.2"] - at["m.1"], (0, 11, 0), atol=0.011)


@needs_cavern
def test_units_calibration_and_declination_change_the_readings(tmp_path):
    text = "units length feet\nunits compass grads\ncalibrate length 1\ndeclination 10 degrees\n" + NORMAL
    at = solved(tmp_path, text + "1 2 101 100 0\n")  # 100 feet at 90 + 10 degrees
    turned = np.radians(100)
    np.testing.assert_allclose(at["m.2"] - at["m.1"], 30.48 * np.array([np.sin(turned), np.cos(turned), 0]), atol=0.011)


@needs_cavern
def test_other_styles_of_data_are_solved(tmp_path):
    text = "data cartesian from to dx dy dz\na b 3 4 5\ndata diving from to length compass fromdepth todepth\n"
    text += f"b c 10 90 0 0\n{NORMAL}c d 7 - up\ndata nosurvey from to\nd e\n{NORMAL}e f 1 0 0\n"
    at = solved(tmp_path, text + "fix a 0 0 0\nfix e 50 50 50\n")
    np.testing.assert_allclose(at["m.c"] - at["m.a"], (13, 4, 5), atol=0.011)
    np.testing.assert_allclose(at["m.d"] - at["m.c"], (0, 0, 7), atol=0.011)


@needs_cavern
def test_cross_sections_in_shot_lines_follow_the_shots(tmp_path):
    text = "data normal from to length compass clino left right up down\n1 2 10 0 0 1 2 3 4\n2 3 10 0 0 2 2 2 2\n"
    text += "1 4 10 90 0 [5 6] 5 - [7 -]\n"
    survey = solve_file(write(tmp_path, {"m.th": centreline(text)}))
    other, first = survey.passages  # Survex writes the last passage first
    assert [survey.names[i] for i in first.stations] == ["m.1", "m.2", "m.3"]
    assert [survey.names[i] for i in other.stations] == ["m.1", "m.4"]
    # Therion writes these to a plot file: a value belongs to the second station, and the first one gets it, too.
    np.testing.assert_array_equal(first.lrud_m, [[1, 2, 3, 4], [1, 2, 3, 4], [2, 2, 2, 2]])
    np.testing.assert_array_equal(other.lrud_m, [[5, 5, np.nan, 7], [6, 5, np.nan, np.nan]])


def test_grid_north_of_the_british_grid_lies_where_the_ordnance_survey_puts_it():
    assert _square("OSGB:SW") == (100_000, 0)
    assert _square("OSGB:TQ") == (500_000, 100_000)
    assert _square("OSGB:HP") == (400_000, 1_200_000)
    # From the true origin's meridian, 2 deg W, the convergence is the difference in longitude times sin(latitude).
    angle = _convergence_deg(None, "OSGB:SW", "EPSG:27700", 71_400.0, 51_200.0)
    assert angle == pytest.approx((-5.2115 + 2) * np.sin(np.radians(50.318)), abs=0.01)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("survey a\n", "a is not closed"),
        ("survey a\nendsurvey b\n", r":2: 'endsurvey b' closes no survey"),
        ("input ../x.th\n", r":1: '\.\./x\.th' is outside the survey's folder"),
        ("input /etc/passwd\n", "is outside the survey's folder"),
        ("input x\n", r":1: input 'x': no such file"),
        ("input m.th\n", "m.th inputs itself"),
        ("import x.3d\n", r":1: import 'x\.3d': no such file"),
        ("import ../x.3d\n", r":1: '\.\./x\.3d' is outside the survey's folder"),
        ("import m.th\n", r":1: import 'm\.th': only \.3d files are imported"),
        ("import m.th -surveys some\n", r":1: import -surveys 'some': want create, use, ignore"),
        ("import m.th -calibrate [1 2 3]\n", r":1: import -calibrate: want six numbers"),
        ("import m.th -colour red\n", r":1: import option '-colour' is not supported"),
        ("survey m -colour red\nendsurvey\n", r":1: survey option '-colour' is not supported"),
        (centreline("1 2 3 4\n"), r":3: '1' is no command, and no `data` line precedes it"),
        (centreline(NORMAL + "1 2 3 4\n"), r":4: 4 readings, `data` names 5"),
        (centreline(NORMAL + "1 2 x 4 5\n"), r":4: 'x' is not a number"),
        (centreline(NORMAL + "1 2 1e999 4 5\n"), r":4: '1e999' is not a number"),
        (centreline(NORMAL + "1 a\x07b 3 4 5\n"), r":4: name 'a\\x07b': want 1 to 200 printable characters"),
        (centreline("data tape from to\n"), r":3: data 'tape from to' is not supported"),
        (centreline("data normal from to length compass clino colour\n"), r":3: reading 'colour' is not supported"),
        (centreline("units length furlongs\n"), r":3: units 'length furlongs' are not supported"),
        (centreline("declination [2000 1 2001 degrees]\n"), r":3: declination .* expected one angle"),
        (centreline("declination [2000 1 soon 2 degrees]\n"), r":3: declination 'soon' is no date"),
        (centreline("station-names a\n"), r":3: expected station-names before after"),
        (centreline("cs EPSG:2225\nfix 1 2 3 4\n"), r":3: cs EPSG:2225 counts in US survey foot, not in metres"),
        (centreline("cs EPSG:999\nfix 1 2 3 4\n"), r":3: cs EPSG:999: it is unknown"),
        (centreline("calibrate declination 2\n"), r":3: calibrate 'declination 2' is not supported"),
        (centreline("units position degrees\n"), r":3: units 'position degrees': no unit of a length"),
        (centreline("cs OSGB:HI\nfix 1 2 3 4\n"), ":3: cs 'OSGB:HI' is not supported"),
        (centreline("data normal ignoreall\n1 2 3\n"), ":4: a shot, but `data normal` names no from and to"),
        (centreline(NORMAL + "1 2 3 4 5\n") + "comment\nsurvey b\n", "ends within a comment without endcomment"),
        (centreline(NORMAL + "1 2 3 4 5\n") + "equate 1@m 2@m \\", "ends within a continued line"),
        (centreline("cs eov\nfix 1 2 3 4\n"), r":3: cs 'eov' is not supported"),
        (centreline("flags approx strange\n"), r":3: flag 'strange' is not supported"),
    ],
)
def test_a_centreline_that_cannot_be_converted_is_refused_with_file_and_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        to_survex(write(tmp_path, {"m.th": text}))


@needs_cavern
def test_an_error_of_survex_names_the_line_of_the_therion_file(tmp_path):
    path = write(tmp_path, {"m.th": centreline(NORMAL + "1 2 3 4 5\n\n2 3 3 4 99\n3 3 5 5 5\n")})
    with pytest.raises(InputError, match=r"m\.th:[67]: .* \(Survex\)"):
        solve_file(path)


def pell_project(folder: Path, change=lambda name, text: text) -> Path:
    """Lay Wheal Pell's files out as its main file names them."""
    if not PELL.is_dir():
        pytest.skip("../shared/data/wheal_pell is missing")
    files = {"pell.th": (PELL / "therion/pell.th").read_text()}
    for path in sorted((PELL / "therion").glob("20*.th")):
        files[f"{path.stem}/{path.name}"] = change(path.stem, path.read_text())
    return write(folder, files)


def differences_m(path: Path) -> dict[str, float]:
    """Return the distance of every named station from its place in pell.3d, m."""
    ours, theirs = position_of(solve_file(path)), position_of(read_3d(PELL / "pell.3d"))
    assert ours.keys() == theirs.keys()
    return {name: float(np.linalg.norm(ours[name] - theirs[name])) for name in ours}


@needs_cavern
def test_wheal_pell_solves_as_therion_solves_it_with_the_declinations_that_therion_used(tmp_path):
    """Therion 2025 has a newer model of the earth's field than Survex 1.4.4, so its grid bearings are stated.

    They are measured in pell.3d on the two open traverses, whose shots no loop bends: 1.547 deg on the one without a
    date, which takes the first date of the project, and 1.805 deg on that of 2025-04-27; linear in time between.
    """

    def stated(name: str, text: str) -> str:
        day = date.fromisoformat("2023-11-25" if name == "2025-05-14" else name)
        share = (day - date(2023, 11, 25)) / (date(2025, 4, 27) - date(2023, 11, 25))
        grid_deg = 1.5467 + share * (1.8053 - 1.5467)
        # A stated declination is counted from true north; the convergence there is -2.4718 deg.
        return text.replace("centreline\n", f"centreline\ndeclination {grid_deg - 2.4718:.4f} degrees\n", 1)

    found = differences_m(pell_project(tmp_path, stated))
    assert np.median(list(found.values())) <= 0.01
    assert max(found.values()) <= 0.05


@needs_cavern
def test_wheal_pell_differs_from_pell_3d_by_the_age_of_the_magnetic_model_only(tmp_path):
    found = differences_m(pell_project(tmp_path))
    by_survey = {name: [d for s, d in found.items() if name in s] for name in {s.split(".")[1] for s in found}}
    for name, distances in sorted(by_survey.items()):
        print(f"{name}: median {np.median(distances):.3f} m, largest {max(distances):.3f} m, {len(distances)} stations")
    # 0.08 to 0.10 deg of declination; the open traverse of 2025-04-27 and 2025-05-14 is 0.7 km long.
    open_end = by_survey.pop("2025-05-14") + by_survey.pop("2025-04-27")
    assert max(open_end) < 700 * np.radians(0.10)
    assert np.median([d for distances in by_survey.values() for d in distances]) < 0.07
    assert max(d for distances in by_survey.values() for d in distances) < 0.2


@needs_cavern
@pytest.mark.parametrize(
    ("reading", "message"),
    [
        ("-10 90 0", r"mine\.th:\d+: Negative tape reading"),
        ("10 90 100", r"mine\.th:\d+: Clino reading over 90"),
    ],
)
def test_readings_that_no_instrument_shows_are_refused_with_their_line(tmp_path, reading, message):
    shots = "centreline\nfix a 0 0 0\ndata normal from to tape compass clino\na b 10 360 -90\nb c {}\nendcentreline\n"
    path = tmp_path / "mine.th"
    path.write_text(shots.format("10 0 90"))
    assert len(solve_file(path).names) == 3
    path.write_text(shots.format(reading))
    with pytest.raises(InputError, match=message):
        solve_file(path)
    path = tmp_path / "cave.svx"
    path.write_text(f"*fix a 0 0 0\n*data normal from to tape compass clino\na b {reading}\n")
    with pytest.raises(InputError, match=r"cave\.svx:3: "):
        solve_file(path)


@needs_cavern
def test_compass_readings_beyond_the_circle_go_on_round_it_and_are_listed(tmp_path, capsys):
    path, head = tmp_path / "cave.svx", "*fix a 0 0 0\n*data normal from to tape compass clino\n"
    path.write_text(head + "a b 10 400 0\nb c 10 364 0\n")
    found = solve_file(path).positions_m
    said = " ".join(capsys.readouterr().err.split())
    assert "cave.svx: 2 compass readings are beyond 360 deg and go on round the circle, 364 as 4" in said
    assert "cave.svx:3: Suspicious compass reading" in said
    path.write_text(head + "a b 10 40 0\nb c 10 4 0\n")
    np.testing.assert_allclose(found, solve_file(path).positions_m)
    assert "compass" not in capsys.readouterr().err


@needs_cavern
@pytest.mark.parametrize(
    ("stated", "readings", "shot", "place"),
    [  # places as Therion 6.1.6 writes them into its .3d
        ("units compass grads", "length backcompass clino", "20 250 0", (14.14, 14.14, 0)),
        ("units clino grads", "length compass backclino", "20 0 25", (0, 18.48, -7.65)),
        ("units length feet", "backlength compass clino", "20 0 0", (0, 6.1, 0)),
        ("calibrate compass 10", "length compass clino backcompass", "20 0 0 180", (-3.47, 19.7, 0)),
        ("calibrate clino 10", "length compass backclino", "20 0 0", (0, 19.7, 3.47)),
        ("calibrate length 0 0.5", "backlength compass clino", "20 0 0", (0, 10, 0)),
        ("calibrate length 1\nunits length feet", "length compass clino", "20 0 0", (0, 5.79, 0)),
        ("calibrate length 1\ngroup\nunits length feet", "length compass clino", "20 0 0\nendgroup", (0, 5.79, 0)),
    ],
)
def test_backsights_have_units_and_corrections_of_their_instrument_and_these_the_units_of_readings(
    tmp_path, stated, readings, shot, place
):
    at = solved(tmp_path, f"{stated}\ndata normal from to {readings}\n1 2 {shot}")
    np.testing.assert_allclose(at["m.2"] - at["m.1"], place, atol=0.011)


@needs_cavern
def test_units_of_all_dimensions_are_read_and_units_of_backsights_refused(tmp_path):
    section = (
        f"units dimensions feet\n{NORMAL}1 2 10 0 0\ndata dimensions station left right up down\n1 1 2 3 4\n2 1 2 3 4"
    )
    survey = solve_file(write(tmp_path, {"m.th": centreline(section)}))
    np.testing.assert_allclose(survey.passages[0].lrud_m[0], (0.3, 0.61, 0.91, 1.22), atol=0.01)
    for line in ("units backcompass grads", "calibrate backcompass 10"):
        with pytest.raises(InputError, match=r"m\.th:3: 'backcompass': Therion has none of backsights; .* 'compass'"):
            solved(tmp_path, f"{line}\n{NORMAL}1 2 10 0 0")


@needs_cavern
def test_flagged_entrances_are_entrances(tmp_path):
    flagged = 'station 2 "" continuation\nstation 3 "" air-draught not entrance\nstation 4 x\nstation 9 "" entrance\n'
    shots = "data normal from to length compass clino left right\n1 2 10 0 0 1 1\n{}2 3 10 0 0 2 2\n3 4 10 0 0 3 3\n"
    text = flagged + shots.format('station 1 "the mouth" entrance\n')
    survey = solve_file(write(tmp_path, {"m.th": centreline(text)}))
    assert entrances_of(survey) == ["m.1"]
    assert [passage.lrud_m[:, 0].tolist() for passage in survey.passages] == [[1, 1, 2, 3]]
