"""Surveys in three dimensions: solved files, Survex projects, and what a flat world cannot show."""

import re
import subprocess

import numpy as np
import pytest
import shapely

from benchmarks.fuzzing.surveys import PROJECT, SAMPLES_3D, head, label, place, ring_3d
from minesurveys.frames import Source
from minesurveys.guard import plain_file
from minesurveys.solved.model import LegFlag, LegStyle, StationFlag
from minesurveys.solved.project_files import project_files
from minesurveys.solved.survex_3d import read_3d
from minesurveys.solved_surveys import solve_file, survey_files
from minesurveys.survex import cavern
from pipeline.errors import InputError
from pipeline.survey.passages.relief import has_relief
from pipeline.survey.passages.workings import build_workings
from pipeline.survey.solved.plan_view import plan_legs
from tests.project import ROOT
from tests.solved import needs_cavern, position_of, read_passages, write

PELL = ROOT / "data/wheal_pell/pell.3d"


def test_a_solved_file_gives_stations_legs_and_cross_sections(tmp_path):
    survey = read_3d(write(tmp_path, {"mine.3d": ring_3d()}))
    assert survey.names == ("mine.0", "mine.1", "mine.2", "mine.3")
    np.testing.assert_array_equal(survey.positions_m[2], (30.0, 20.0, 0.3))
    assert survey.legs.tolist() == [[0, 1], [1, 2], [2, 3], [3, 0]]
    assert (survey.leg_styles == LegStyle.NORMAL).all()
    assert (survey.station_flags == StationFlag.UNDERGROUND).all()
    (passage,) = survey.passages
    assert passage.stations.tolist() == [0, 1, 2, 3, 0]
    np.testing.assert_array_equal(passage.lrud_m[0], (2.0, 2.0, 2.5, 0.0))
    assert (survey.title, survey.crs, survey.date) == ("mine", "EPSG:32719", "@1700000000")


def test_a_file_of_an_earlier_version_is_refused_with_what_converts_it(tmp_path):
    with pytest.raises(InputError, match=r"\.3d version 'v7'; v8 is read, .*\.lox .*survexport"):
        read_3d(write(tmp_path, {"old.3d": head(7)}))


@pytest.mark.parametrize(("crs", "unit"), [("EPSG:2263", "US survey foot"), ("EPSG:4326", "degree")])
def test_a_survey_in_a_system_of_another_unit_is_refused_as_its_legs_are_metres(tmp_path, crs, unit):
    path = write(tmp_path, {"mine.3d": ring_3d().replace(b"EPSG:32719", crs.encode())})
    with pytest.raises(InputError, match=rf"mine\.3d: its coordinate system '{crs}' counts in {unit}, not in metres"):
        solve_file(path)


@needs_cavern
def test_a_survex_project_whose_result_is_in_feet_is_refused(tmp_path):
    text = "*cs EPSG:32618\n*cs out EPSG:2263\n*fix 1 600000 4500000 0\n"
    text += "*data normal from to tape compass clino\n1 2 9 0 0\n"
    with pytest.raises(InputError, match=r"a\.svx: its coordinate system 'EPSG:2263' counts in US survey foot"):
        solve_file(write(tmp_path, {"a.svx": text}))


@pytest.mark.parametrize("cut", [0, 5, 22, 30, 47, 60, 100, len(ring_3d()) - 1])
def test_a_file_that_is_cut_off_is_refused(tmp_path, cut):
    with pytest.raises(InputError, match=r"not a Survex .3d file|cut off"):
        read_3d(write(tmp_path, {"mine.3d": ring_3d()[:cut]}))


@needs_cavern
def test_what_survex_writes_reads_as_dump3d_prints_it(tmp_path):
    deep = "*begin a_long_survey_name\n*begin another_long_name\n1 2 5 10 2\n2 .. 2 100 0\n*flags surface\n2 3 5 9 9\n"
    text = deep + "*flags not surface duplicate\n2 4 5 9 9\n*data passage station left right up down\n1 1 2 3 400\n"
    text += "2 - 1 1 1\n*end another_long_name\n*begin b\n*data cartesian from to dx dy dz\n1 2 3 4 5\n*end b\n"
    path = write(tmp_path, {"a.svx": f"{text}*equate b.1 another_long_name.1\n*end a_long_survey_name\n"})
    target = tmp_path / "a.3d"
    subprocess.run(["cavern", "-qs", "-o", target, path], check=True, capture_output=True)
    survey = read_3d(target)
    dump = subprocess.run(["dump3d", target], check=True, capture_output=True, text=True).stdout.splitlines()
    nodes = {line.split()[4].strip("[]"): line.split()[1:4] for line in dump if line.startswith("NODE")}
    for name, at in position_of(survey).items():
        np.testing.assert_allclose(at, np.array(nodes[name], float), atol=1e-9)
    assert len(survey.legs) == sum(line.startswith("LINE") for line in dump) == 5
    assert sorted(survey.leg_flags.tolist()) == [0, 0, LegFlag.SURFACE, LegFlag.DUPLICATE, LegFlag.SPLAY]
    np.testing.assert_array_equal(survey.passages[0].lrud_m, [[1, 2, 3, 400], [np.nan, 1, 1, 1]])


def test_wheal_pell_reads_with_its_stations_and_splays(capsys):
    survey = solve_file(PELL)
    assert len(position_of(survey)) == 275
    assert len(survey.centreline()) == 266
    assert (survey.leg_flags == LegFlag.SPLAY).sum() == 581
    assert np.ptp(survey.positions_m[:, 2]) > 90
    legs = plan_legs(PELL, survey)
    said = capsys.readouterr().err
    assert "stations of passages have no measured wall beside them; 1.10 m is taken" in said
    assert sorted(round(abs(np.diff(leg.heights_m[:, 0])[0]), 1) for leg in legs if leg.is_plumb)[-1] == 37.0
    assert all(np.isfinite(leg.walls_m).all() and np.isfinite(leg.heights_m[:, 2]).all() for leg in legs)
    stated = plan_legs(PELL, survey, 0.5)
    for one, other in zip(legs, stated, strict=True):
        measured = dict(zip(one.stations, zip(one.walls_m, one.known[:, :2], strict=True), strict=True))
        for name, walls in zip(other.stations, other.walls_m, strict=True):
            if name in measured:
                known = measured[name][1] == Source.MEASURED
                np.testing.assert_array_equal(measured[name][0][known], walls[known])  # the width stated is for others


@needs_cavern
def test_a_project_in_several_files_with_a_loop_becomes_connected_legs(tmp_path):
    path = write(tmp_path, PROJECT)
    legs, _ = read_passages(path)
    assert [len(leg.stations) for leg in legs] == [4, 3]
    assert len(set(legs[0].stations) & set(legs[1].stations)) == 2
    assert build_workings(legs).geom_type == "Polygon"
    assert [file.relative_to(tmp_path).as_posix() for file in survey_files(path)] == [
        "main.svx", "north/a.svx", "south.svx"
    ]  # fmt: skip


@needs_cavern
def test_the_plan_of_a_project_is_that_of_the_same_survey_in_one_file(tmp_path):
    path = write(tmp_path, PROJECT)
    text = PROJECT["main.svx"].replace(b'*include "north/a"\n', PROJECT["north/a.svx"])
    single = tmp_path / "single.svx"
    single.write_bytes(text.replace(b"*include south.svx\n", PROJECT["south.svx"]))
    several, alone = (build_workings(read_passages(file)[0]) for file in (path, single))
    assert several.boundary.hausdorff_distance(alone.boundary) < 0.1  # the adjustments weight shots differently


ONE_FILE = "1 2 20 0 -7\n2 3 20 90 -7\n"
WALLS = "*data passage station left right up down\n1 2 2 3 1\n2 2 2 3 1\n3 2 2 3 1\n"


@needs_cavern
def test_a_survey_in_one_file_keeps_its_heights(tmp_path):
    legs, _ = read_passages(write(tmp_path, {"a.svx": ONE_FILE + WALLS}))
    drop = 20 * np.sin(np.radians(7))
    np.testing.assert_allclose(legs[0].heights_m, [[-drop * k, 3, 1] for k in range(3)], atol=0.011)


@needs_cavern
def test_a_level_survey_in_one_file_has_no_relief(tmp_path):
    path = write(tmp_path, {"a.svx": ONE_FILE.replace("-7", "0") + WALLS})
    legs, _ = read_passages(path)
    assert not has_relief(legs)
    np.testing.assert_allclose(legs[0].positions_m, [(0, 0), (0, 20), (20, 20)], atol=0.011)


@needs_cavern
def test_a_survey_in_one_file_without_cross_sections_has_walls_of_splays_or_as_stated(tmp_path):
    path = write(tmp_path, {"a.svx": ONE_FILE})
    with pytest.raises(InputError, match=r"no cross-sections and no splays; state .*--half-width"):
        read_passages(path)
    np.testing.assert_array_equal(read_passages(path, 1.5)[0][0].walls_m, np.full((3, 2), 1.5))
    path.write_text(ONE_FILE + "".join(f"{i} .. 2 {turn} 0\n" for i in (1, 2, 3) for turn in (135, 315)))
    assert len(read_passages(path)[0]) == 1


@needs_cavern
def test_a_survey_without_cross_sections_gets_its_walls_from_splays(tmp_path):
    text = "1 2 20 0 0\n2 3 20 0 0\n" + "".join(f"{i} .. 2 90 0\n{i} .. 3 270 0\n{i} .. 9 0 80\n" for i in (1, 2, 3))
    legs, _ = read_passages(write(tmp_path, {"a.svx": text}))
    assert [leg.stations for leg in legs] == [["1", "2", "3"]]
    np.testing.assert_allclose(legs[0].walls_m, [[3.0, 2.0]] * 3, atol=0.011)


@needs_cavern
def test_a_dome_that_splays_measure_from_the_last_station_is_built(tmp_path):
    dome = "".join(f"2 .. 8 {turn} {clino}\n" for turn in range(0, 360, 15) for clino in (-10, 0, 30, 60))
    path = write(tmp_path, {"a.svx": f"1 2 30 90 0\n{dome}2 .. 8 - UP\n2 .. 2 - DOWN\n1 .. 2 0 0\n1 .. 2 180 0\n"})
    legs, _ = read_passages(path)
    (leg,) = legs
    station = shapely.Point(leg.positions_m[leg.stations.index("2")])
    built, disc = build_workings(legs), station.buffer(8)
    assert built.intersection(disc).area > 0.9 * disc.area
    assert built.difference(disc.union(shapely.LineString(leg.positions_m).buffer(2.5))).area < 0.1 * disc.area


COMPASS = """MINE
SURVEY NAME: A
SURVEY DATE: 7 10 2001
SURVEY TEAM:

DECLINATION: 0.00  FORMAT: DMMDLUDRADLNF  CORRECTIONS: 0.00 0.00 0.00

FROM TO LENGTH BEARING INC LEFT UP DOWN RIGHT FLAGS COMMENTS

a b 100 0 0 5 9 1 5
b c 100 90 0 5 9 1 5
c d 100 0 0 5 9 1 5 #|L# resurveyed
a c 141.4 45 0 5 9 1 5 FLAGS
"""


@needs_cavern
@pytest.mark.parametrize(
    ("flags", "built"), [("", True), ("#|L#", True), ("#|S#", False), ("#|PL#", False), ("#|X#", 0)]
)
def test_a_compass_shot_that_is_no_passage_gets_no_walls(tmp_path, capsys, flags, built):
    path = write(tmp_path, {"a.dat": COMPASS.replace("FLAGS\n", f"{flags}\n") + "\f\n"})
    legs, _ = read_passages(path)
    joined = {frozenset(pair) for leg in legs for pair in zip(leg.stations, leg.stations[1:], strict=False)}
    assert {frozenset("ab"), frozenset("bc"), frozenset("cd")} <= joined
    assert (frozenset("ac") in joined) == built
    assert "pieces" not in capsys.readouterr().err


@needs_cavern
@pytest.mark.parametrize(("crs", "place"), [("EPSG:2193", "1600000 5400000"), ("EPSG:31467", "3500000 5400000")])
def test_bearings_that_survex_turns_by_a_right_angle_are_refused(tmp_path, crs, place):
    head = f"*cs {crs}\n*cs out {crs}\n*fix 1 {place} 9\n*declination auto {place} 9\n*date 2010.05.06\n"
    path = write(tmp_path, {"a.svx": head + ONE_FILE + WALLS})
    message, rise = "", 20.0
    try:
        ends = read_passages(path)[0][0].positions_m
        rise = float(ends[1, 1] - ends[0, 1])
    except InputError as error:
        message = str(error)
    assert rise > 17  # a newer version may be right; bearing 0 leads north by all but the declination
    assert not message or re.search(r"a\.svx:4: Declination.*state \*declination as a number", message)
    path.write_text(head.replace(f"auto {place} 9", "22 degrees") + ONE_FILE + WALLS)
    assert len(read_passages(path)[0]) == 1


@needs_cavern
def test_a_wall_kilometres_from_its_station_is_refused(tmp_path):
    text = "1 2 20 0 0\n*data passage station left right up down\n1 2 2 2 0\n2 2 4000 2 0\n"
    with pytest.raises(InputError, match=r"a wall 4000 m beside its station, at most 300 \(farthest_wall_m\)"):
        read_passages(write(tmp_path, {"a.svx": text}))


@needs_cavern
@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"a.svx": "*include b\n", "b.svx": "1 2 5 0 0\n\n1 1 5 0 0\n"}, r"b\.svx:3: .*same"),
        ({"a.svx": "*include b\n", "b.svx": "*include /etc/passwd\n"}, r"b\.svx:1: '/etc/passwd' is outside"),
        (
            {"a.svx": "*include b\n", "b.svx": "*include ../a\n"},
            "is outside the survey's folder, .*; put the main file",
        ),
        ({"a.svx": "*include b\n", "b.svx": "*set keyword #\n"}, r"\*set keyword is not supported"),
        ({"a.svx": "*include b\n", "b.svx": "*include a\n"}, "includes itself"),
        ({"a.svx": "*include b\n*include c\n", "b.svx": "1 2 3 4 5\n"}, r"a\.svx:2: \*include 'c': no such file"),
    ],
)
def test_a_project_that_cannot_be_solved_is_refused_with_file_and_line(tmp_path, files, message):
    path = write(tmp_path, files)
    with pytest.raises(InputError, match=message) as caught:
        solve_file(path)
    assert "\n" not in str(caught.value)
    assert "minexplore-" not in str(caught.value)


def test_an_included_link_that_leads_out_of_the_folder_is_refused(tmp_path):
    (tmp_path / "secret.svx").write_text("1 2 5 0 0\n")
    path = write(tmp_path / "mine", {"a.svx": "*include b\n"})
    (tmp_path / "mine/b.svx").symlink_to(tmp_path / "secret.svx")
    with pytest.raises(InputError, match="outside the survey's folder"):
        project_files(path)


@pytest.mark.parametrize("files", [SAMPLES_3D["compass data"], PROJECT, {"a.svx": (ONE_FILE + WALLS).encode()}])
def test_without_survex_the_message_says_how_to_install_it(tmp_path, monkeypatch, files):
    monkeypatch.setattr(cavern.shutil, "which", lambda _: None)
    path = write(tmp_path, files)
    with pytest.raises(InputError, match=r"`cavern` is not installed; `make setup` installs it \(Debian: survex\)"):
        read_passages(path)


@needs_cavern
def test_solving_leaves_no_file_and_takes_no_longer_than_its_limit(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    path = write(tmp_path / "mine", PROJECT)
    solve_file(path)
    assert list((tmp_path / "temporary").iterdir()) == []
    assert sorted(p.name for p in path.parent.iterdir()) == ["main.svx", "north", "south.svx"]


@needs_cavern
def test_compass_data_is_solved_with_its_cross_sections(tmp_path):
    survey = solve_file(write(tmp_path, SAMPLES_3D["compass data"]))
    np.testing.assert_allclose(position_of(survey)["A2"], (0, 30.48, 0), atol=0.006)
    (passage,) = survey.passages
    assert [survey.names[i] for i in passage.stations] == ["A1", "A2", "A3", "A4", "A1"]
    np.testing.assert_allclose(passage.lrud_m[0], np.array([6, 6, 9, 1]) * 0.3048, atol=0.0051)  # whole centimetres
    assert np.isnan(passage.lrud_m[3, :2]).all()


def test_a_name_at_two_places_is_two_stations(tmp_path, capsys):
    again = b"\x82\0\0\0" + place((1, 0, 0))
    data = head() + b"\x82\x01a" + place((0, 0, 0)) + again + again + b"\0\0"
    at = position_of(read_3d(write(tmp_path, {"mine.3d": data})))
    np.testing.assert_array_equal([at["a"], at["a (2)"]], [(0, 0, 0), (0.01, 0, 0)])
    assert "1 stations have names of others elsewhere: a is a (2)" in capsys.readouterr().err


@needs_cavern
def test_a_file_named_in_another_case_is_found_unless_two_could_be_meant(tmp_path):
    path = write(tmp_path / "a", {"a.svx": "*include Sub\\B\n", "sub/b.svx": ONE_FILE + WALLS})
    assert project_files(path) == [path, tmp_path / "a/sub/b.svx"]
    assert len(read_passages(path)[0]) == 1
    plan = write(tmp_path / "b", {"a.mak": "#A.DAT;\r\n", "a.dat": COMPASS.replace("FLAGS\n", "\n") + "\f\n"})
    assert survey_files(plan) == [plan, tmp_path / "b/a.dat"]
    assert read_passages(plan)[0]
    path = write(tmp_path / "c", {"a.svx": "*include B\n", "b.svx": ONE_FILE, "B.SVX": "*include ../x\n"})
    with pytest.raises(InputError, match=r"a\.svx:1: \*include 'B': no such file"):
        project_files(path)


def test_a_line_of_megabytes_is_refused_before_survex_reads_it(tmp_path):
    path = tmp_path / "a.svx"
    path.write_text(f"*title {'x' * 20_000}\n1 2 5 0 0\n")
    with pytest.raises(InputError, match=r"a\.svx:1: a line of 20007 bytes, at most 10000 \(survex_line_bytes"):
        solve_file(path)


SHOT = b"*data normal from to tape compass clino\n1 2 50 90 0\n"
OUTSIDE = b"*include ../outside\n"


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"a.svx": SHOT + b"; a comment \x1a" + OUTSIDE}, r"a\.svx:3: a control character, 0x1a"),
        ({"a.svx": SHOT + b"*include b\x0b/../../outside\n", "b.svx": b""}, "a control character, 0x0b"),
        ({"a.svx": b"\xef\xbb\xbf" + OUTSIDE}, r"a\.svx:1: '\.\./outside' is outside the survey's folder"),
        ({"a.svx": b"*include b\\c\n", "b/c.svx": b"", "b\\c.svx": OUTSIDE}, "name holds a backslash"),
        ({"a.svx": b"*include b.mak\n", "b.mak": b"#../outside.dat;\n"}, "only .svx files are included"),
        ({"a.svx": b"*include b.dat\n", "b.dat": b""}, "only .svx files are included"),
        ({"a.svx": SHOT + b"*cs ;\n"}, r"a\.svx:3: \*cs names no coordinate system"),
        ({"a.mak": b"#\n../outside.dat;\n"}, r"a\.mak:1: '\.\./outside\.dat' is outside"),
        ({"a.mak": b"/#../\n#outside.dat;\n"}, r"a\.mak:2: #outside\.dat: no such file"),
        ({"a.mak": b"/#b\n#../outside.dat;\n"}, r"a\.mak:2: '\.\./outside\.dat' is outside"),
        ({"a.mak": b"[..;\n#outside.dat;\n"}, r"a\.mak:1: '\.\.' is outside"),
        ({"a.mak": b"#b.mak;\n", "b.mak": b"#../outside.dat;\n"}, "a project is made of .dat and .clp files"),
        ({"a.mak": b"/ x /#b.mak;\n", "b.mak": b"#../outside.dat;\n"}, "a project is made of .dat and .clp files"),
    ],
)
def test_what_survex_reads_in_another_way_than_the_scan_leads_out_of_no_folder(tmp_path, files, message):
    write(tmp_path, {"outside.svx": SHOT, "outside.dat": SHOT})
    with pytest.raises(InputError, match=message):
        survey_files(write(tmp_path / "mine", files))


def test_marks_of_utf_8_and_of_dos_are_no_part_of_a_survey(tmp_path):
    path = write(tmp_path, {"a.svx": b"\xef\xbb\xbf*include b\r\n\x1a", "b.svx": SHOT})
    assert project_files(path) == [path, tmp_path / "b.svx"]


def test_links_of_nodes_that_lead_out_of_the_folder_are_refused(tmp_path):
    path = write(tmp_path / "mine", {"c_nodes.dat": "0 0 0\n9 0 0\n"})
    write(tmp_path, {"outside.dat": "a secret\n"})
    (tmp_path / "mine" / "c_links.dat").symlink_to(tmp_path / "outside.dat")
    with pytest.raises(InputError, match=r"'c_links\.dat' is outside the survey's folder"):
        solve_file(path)


def test_ends_of_splays_do_not_count_as_stations_of_passages(tmp_path, monkeypatch):
    few = plain_file.reader_limits().model_copy(update={"stations": 4})
    monkeypatch.setattr(plain_file, "reader_limits", lambda: few)
    splays = b"".join(
        b"\x44" + label(b"", 0, 0) + place((10 * k, 500, 9)) + b"\x0f" + place((0, 0, 0)) for k in range(9)
    )
    path = write(tmp_path, {"a.3d": ring_3d()[:-1] + b"\x0f" + place((0, 0, 0)) + splays + b"\0"})
    survey = read_3d(path)
    assert (survey.leg_flags == LegFlag.SPLAY).sum() == 9
    assert len(plan_legs(path, survey)) == 1
    fewer = few.model_copy(update={"stations": 3})
    monkeypatch.setattr(plain_file, "reader_limits", lambda: fewer)
    with pytest.raises(InputError, match=r"a\.3d: 4 stations of passages or more, the limit is 3 \(stations in"):
        plan_legs(path, survey)
