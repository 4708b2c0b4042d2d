"""Compass projects and survey data. The places are those that Survex 1.4.22 gives."""

import numpy as np
import pytest

from minesurveys.compass.data import read_surveys
from minesurveys.compass.project import utm_system
from minesurveys.solved.model import LegFlag, StationFlag
from minesurveys.solved_surveys import solve_file, survey_files
from pipeline.errors import InputError
from tests.solved import needs_cavern, position_of, write

HEAD = "FROM TO LENGTH BEARING INC LEFT UP DOWN RIGHT FLAGS COMMENTS"
FOOT_M = 0.3048


def data(shots, declination="DECLINATION: 0 FORMAT: DDDDLRUDLADN CORRECTIONS: 0 0 0", date="7 10 1979"):
    head = f"Cave\r\nSURVEY NAME: A\r\nSURVEY DATE: {date}  COMMENT:x\r\nSURVEY TEAM:\r\nme\r\n{declination}\r\n\r\n"
    return f"{head}{HEAD}\r\n\r\n" + "".join(f"{shot}\r\n" for shot in shots) + "\f\r\n"


@pytest.fixture
def solved(tmp_path):
    return lambda text: position_of(solve_file(write(tmp_path, {"a.dat": text})))


@needs_cavern
def test_corrections_are_in_degrees_and_feet(solved):
    declination = "DECLINATION: 40 FORMAT: DDDDLRUDLAD CORRECTIONS: 5.00 3.00 1.00"
    at = solved(data(["C1 C2 2.281 045 -3 1 1 1 1"], declination))
    np.testing.assert_allclose(at["C2"] - at["C1"], (1, 0, 0), atol=0.006)


@needs_cavern
@pytest.mark.parametrize(
    ("declination", "shots", "end"),
    [
        ("FORMAT: DDDDLRUDLADB CORRECTIONS: 1 2 0.2", ["a b 3.081 -999 -2 1 1 1 1 179 -999"], (0, 1, 0)),
        ("FORMAT: DDDDLRUDLADB CORRECTIONS: 1 2 0.2", ["a b 3.081 359 999 1 1 1 1 999 -2"], (0, 1, 0)),
        ("FORMAT: DDDDLRUDLADBF", ["a b 3.281 90 1 1 1 1 1 270 -3"], (1, 0, 0.035)),
        (
            "FORMAT: DDDDLRUDLADadCF CORRECTIONS: 0 0 0 CORRECTIONS2: 1.0 -1.0",
            ["a b 4.567 027 -999 1 1 1 1 206 -21"],
            (0.59, 1.15, 0.52),
        ),
        ("FORMAT: DDDDLRUDLADadCF", ["a b 10 000 -90 1 1 1 1 180 90"], (0, 0, -3.048)),
        ("FORMAT: DDDDLRUDLAD", ["a b 3.281 90 -999 1 1 1 1"], (1, 0, 0)),
        ("", ["a b 3.281 90 0 1 1 1 1"], (1, 0, 0)),
    ],
)
def test_backsights_are_read_in_every_format(solved, declination, shots, end):
    at = solved(data(shots, f"DECLINATION: 0 {declination}"))
    np.testing.assert_allclose(at["b"] - at["a"], end, atol=0.006)


@needs_cavern
def test_folders_of_a_project_hold_its_files(tmp_path):
    project = (
        "/ a comment; #none.dat;\r\n[Sub;\r\n#one.dat;\r\n[deep;\r\n#two.dat, b[F,10.0,20.0,30.0];\r\n];\r\n];\r\n"
    )
    files = {
        "a.mak": project + "#ol/ a comment in a name /d\r\n.dat;\r\n!oT;\r\n*30;\r\n",
        "Sub/one.dat": data(["b c 10 0 0 1 1 1 1"]),
        "Sub/deep/two.dat": data(["c d 10 90 0 1 1 1 1"]),
        "old.dat": data(["d e 10 180 0 1 1 1 1"]),
    }
    path = write(tmp_path, files)
    survey = solve_file(path)
    at = position_of(survey)
    np.testing.assert_allclose(at["b"], np.array([10, 20, 30]) * FOOT_M, atol=0.006)
    np.testing.assert_allclose(at["e"], np.array([20, 20, 30]) * FOOT_M, atol=0.02)
    assert [file.relative_to(tmp_path).as_posix() for file in survey_files(path)] == [
        "a.mak", "Sub/one.dat", "Sub/deep/two.dat", "old.dat"
    ]  # fmt: skip
    assert survey.station_flags[survey.names.index("b")] & StationFlag.ENTRANCE


@needs_cavern
def test_a_base_location_gives_the_declination_and_the_coordinate_system(tmp_path):
    # Survex 1.4.22: declination 22.1 deg in 1986, convergence -6.4 deg; the survey's own declination is not used.
    project = (
        "@1314000.0,5428000.0,50.0,-60,0.0;\r\n$-60;\r\n&WGS 1984;\r\n#a.dat,\r\n C1 [m,1313799.91,5427953.18,30];\r\n"
    )
    shots = data(["C1 C2 328.084 0 0 1 1 1 1"], "DECLINATION: 77 FORMAT: DDDDLRUDLAD", "10 13 1986")
    survey = solve_file(write(tmp_path, {"a.mak": project, "a.dat": shots}))
    at = position_of(survey)
    np.testing.assert_allclose(at["C1"], (1313799.91, 5427953.18, 30), atol=0.006)
    angle = np.degrees(np.arctan2(*(at["C2"] - at["C1"])[:2]))
    assert angle == pytest.approx(22.1 + 6.4, abs=0.3)
    assert "32760" in survey.crs


@needs_cavern
def test_flags_of_shots_are_kept_and_excluded_shots_are_not(tmp_path):
    shots = ["a b 10 0 0 1 1 1 1", "b x 10 0 0 1 1 1 1 #|X# no", "b c 10 0 0 1 1 1 1 #|P#", "b d 5 0 0 1 1 1 1 #|SL#"]
    shots += ["b e 10 90 0 1 1 1 1 #|L#", "e f 10 90 0 1 1 1 1 a comment #|"]
    survey = solve_file(write(tmp_path, {"a.dat": data(shots)}))
    flags = {
        tuple(survey.names[k] for k in leg): flag
        for leg, flag in zip(survey.legs.tolist(), survey.leg_flags.tolist(), strict=True)
    }
    assert flags == {
        ("a", "b"): 0,
        ("b", "c"): LegFlag.SURFACE,
        ("b", "d"): LegFlag.SPLAY | LegFlag.DUPLICATE,
        ("b", "e"): LegFlag.DUPLICATE,
        ("e", "f"): 0,
    }
    walled = [[survey.names[k] for k in passage.stations] for passage in survey.passages]
    assert walled == [["a", "b", "e", "f"]]


@needs_cavern
def test_a_shot_that_is_not_adjusted_stays_as_measured_in_a_loop(solved):
    shots = ["a b 100 0 0 1 1 1 1 FLAGS", "b c 100 90 0 1 1 1 1", "c d 100 180 0 1 1 1 1", "d a 110 270 0 1 1 1 1"]
    kept, adjusted = (solved(data(shots).replace("1 1 FLAGS\r\n", f"1 1 {flags}\r\n")) for flags in ("#|C#", ""))
    np.testing.assert_allclose(kept["b"] - kept["a"], (0, 30.48, 0), atol=0.011)
    assert np.abs(adjusted["b"] - adjusted["a"])[0] > 1


@needs_cavern
def test_a_shot_to_its_own_station_states_the_walls_at_an_end(tmp_path):
    shots = ["a b 10 0 0 1 2 3 4", "b c 10 0 0 5 6 7 8", "c c 0 0 0 9 10 11 12"]
    survey = solve_file(write(tmp_path, {"a.dat": data(shots)}))
    (passage,) = survey.passages
    lrud_ft = [[1, 4, 2, 3], [5, 8, 6, 7], [9, 12, 10, 11]]
    np.testing.assert_allclose(passage.lrud_m, np.array(lrud_ft) * FOOT_M, atol=0.006)


@needs_cavern
def test_a_closed_file_is_corrected_already(tmp_path):
    text = data(["a b 3.281 45 0 1 1 1 1"], "DECLINATION: 0 FORMAT: DDDDLRUDLAD CORRECTIONS: 45 3 100")
    at = position_of(solve_file(write(tmp_path, {"a.clp": text})))
    np.testing.assert_allclose(at["b"] - at["a"], (0.7071, 0.7071, 0), atol=0.006)


@needs_cavern
def test_a_heading_of_other_words_hides_no_shots(solved):
    assert set(solved(data(["a b 10 0 0 1 1 1 1", "b c 0 0 0 1 1 1 1"]).replace(HEAD, "Von Nach Laenge"))) == {
        "a",
        "b",
        "c",
    }


@needs_cavern
def test_names_of_stations_may_hold_any_character(solved):
    at = solved(data(["A.1 B;2* 10 0 0 1 1 1 1", "B;2* a'b 10 0 0 1 1 1 1", "a'b A,1 10 0 0 1 1 1 1"]))
    assert set(at) == {"A.1", "B;2*", "a'b", "A,1"}


@pytest.mark.parametrize(
    ("stated", "found"), [("10 13 86", "1986.10.13"), ("1 1 1901", ""), ("13 1 1986", ""), ("", "")]
)
def test_dates_are_month_day_and_year(tmp_path, stated, found):
    ((survey, _),) = read_surveys(write(tmp_path, {"a.dat": data(["a b 1 2 3 4 5 6 7"], date=stated)}))
    assert survey.date == found


def test_utm_zones_have_the_codes_of_their_datum():
    assert utm_system("North American 1927", 12) == "EPSG:26712"
    assert utm_system("North  American 1983", 59) == "EPSG:3372"
    assert utm_system("WGS 1984", -60) == "EPSG:32760"
    assert utm_system("Hu Tzu Shan", 51) == "EPSG:3829"
    assert utm_system("North American 1927", 40) == utm_system("", 12) == utm_system("WGS 1984", 0) == ""


@needs_cavern
def test_equal_names_that_are_no_links_and_datums_without_a_code_are_warned_of(tmp_path, capsys):
    files = {
        "a.mak": "&Ordnance 1936;\r\n$30;\r\n#a.dat;\r\n#b.dat,c;\r\n",
        "a.dat": data(["a b 1 2 3 4 5 6 7", "b c 1 2 3 4 5 6 7"]),
        "b.dat": data(["c b 1 2 3 4 5 6 7"]),
    }
    solve_file(write(tmp_path, files))
    warned = capsys.readouterr().err
    assert "1 names of several files are no link stations, such as b: each is one station" in warned
    assert warned.count("Ordnance 1936, zone 30: no EPSG code; coordinates are of a local grid") == 1
    solve_file(write(tmp_path, {**files, "a.mak": "#a.dat;\r\n#b.dat,c,b;\r\n"}))
    assert "link stations" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"a.mak": "#a.dat,C1 [inch,1,2,3];"}, r"a\.mak:1: 'inch,1,2,3': a place is in F \(feet\) or M \(metres\)"),
        ({"a.mak": "\r\n#a.dat,C1 [m,1,2];"}, r"a\.mak:2: 'm,1,2': want a unit and three numbers"),
        ({"a.mak": "#a.dat,C1 [m,1,\r\n2];"}, r"a\.mak:1: 'm,1,\\n2': want a unit"),
        ({"a.mak": "$61;"}, r"a\.mak:1: '61' is no UTM zone"),
        ({"a.mak": "#b.dat;"}, r"a\.mak:1: #b\.dat: no such file"),
        ({"a.mak": "#a.dat;", "a.dat": data(["a b 1 2"])}, r"a\.dat:10: 'a b 1 2': want two stations and 7 readings"),
        ({"a.dat": data(["a b x 2 3 4 5 6 7"])}, r"a\.dat:10: 'x' is not a number"),
        ({"a.dat": data(["a b -5 2 3 4 5 6 7"])}, r"a\.dat:10: a shot of -5 feet"),
        ({"a.dat": data(["a b 1 2 3 4 5 6 7"], "DECLINATION: 0 FORMAT: DDDDLRUDLADB")}, "want two stations and 9"),
    ],
)
@needs_cavern
def test_what_cannot_be_read_is_refused_with_file_and_line(tmp_path, files, message):
    with pytest.raises(InputError, match=message):
        solve_file(write(tmp_path, {**files, "a.dat": files.get("a.dat", data([]))}))


@needs_cavern
@pytest.mark.parametrize(
    ("head", "place", "remark"),
    [
        ("&North American 1983;\r\n$13;\r\n#a.dat;\r\n", (0, 0, 0), "its UTM zone is not used; the first station"),
        (
            "&North American 1983;\r\n$13;\r\n#a.dat,a;\r\n",
            (0, 0, 0),
            "its UTM zone is not used; the first station",
        ),
        (
            "@500000.0,4000000.0,1000.0,13,0.0;\r\n&North American 1983;\r\n#a.dat;\r\n",
            (500000, 4000000, 1000),
            "the first one, a, is put at the project's base location",
        ),
    ],
)
def test_a_project_without_a_fixed_station_is_read(tmp_path, capsys, head, place, remark):
    path = write(tmp_path, {"a.mak": head, "a.dat": data(["a b 100 0 0 5 9 1 5", "b c 100 90 0 5 9 1 5"])})
    at = position_of(solve_file(path))
    np.testing.assert_allclose(at["a"], place, atol=0.011)
    assert np.linalg.norm(at["c"] - at["a"]) == pytest.approx(np.hypot(30.48, 30.48), abs=0.02)
    assert remark in capsys.readouterr().err


@needs_cavern
@pytest.mark.parametrize("text", ["1 2\n2 3\n", "set plan 1\n", "Cave\r\nSURVEY NAME: A\r\n\f\r\n"])
def test_a_file_without_a_shot_is_refused_as_none_of_compass(tmp_path, text):
    with pytest.raises(InputError, match=r"a_links\.dat: holds no shots of Compass; .* NAME_nodes\.dat"):
        solve_file(write(tmp_path, {"a_links.dat": text}))
