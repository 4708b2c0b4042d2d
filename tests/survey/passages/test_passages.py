"""Survex and Compass surveys: what Survex solves and our readers must agree with their sources."""

import shutil
import subprocess

import numpy as np
import pytest

from minesurveys.solved_surveys import survey_files
from minesurveys.stations.compass import read_plt
from pipeline.errors import InputError
from pipeline.survey.detect import detect_survey
from pipeline.survey.passages.workings import build_workings
from pipeline.survey.solved.plan_view import plan_legs
from tests.solved import needs_cavern, read_passages

SVX = """*begin cave ; a comment
*cs EPSG:32719
*cs out EPSG:32719
*fix 0 380000 6290000 2400
*calibrate tape 0.1
*data normal from to tape compass clino
0 1 10.1 90 0
1 2 12.1 80 +1
*data passage station left right up down
0 2 2.5 2 .5
1 2 2 2 .5
2 2 2 2 .5
{include}
*equate 2 sub.a
*end cave
"""
SUB = """*begin sub
*units tape feet
*units compass grads
*calibrate compass 2
*declination 3 degrees
*data normal station newline tape compass clino
a
 20 100 0
b
 10 200 10
c
*data cartesian from to easting northing altitude
c d 10 5 1
*data normal from to tape backcompass backclino
d e 5 20 -4
*data passage station left right up down
a 2 2 2 2
b 2 2 2 2
c 2 2.1 2 2
d 2 2 2 2
e 2 2 2 2
*end sub
"""


def write_svx(folder):
    (folder / "sub.svx").write_text(SUB)
    (folder / "cave.svx").write_text(SVX.format(include='*include "sub"'))
    return folder / "cave.svx"


@needs_cavern
def test_stations_are_where_units_calibrations_and_declinations_put_them(tmp_path):
    legs, crs = read_passages(write_svx(tmp_path))
    assert crs == "EPSG:32719"
    positions = {s: p for leg in legs for s, p in zip(leg.stations, leg.positions_m, strict=True)}
    assert len(positions) == 7  # stations a and 2 are the same
    start = np.array([380_000.0, 6_290_000.0])
    np.testing.assert_allclose(positions["cave.0"], start, atol=0.011)
    np.testing.assert_allclose(positions["cave.1"], start + np.array([10, 0]), atol=0.011)  # the tape is 0.1 m too long
    bearing = np.radians(200 * 0.9 - 2 * 0.9 + 3)  # grads, less the zero error, and the declination
    length = (10 * 0.3048 - 0.1) * np.cos(np.radians(10))
    step = positions["cave.sub.c"] - positions["cave.sub.b"]
    np.testing.assert_allclose(step, length * np.array([np.sin(bearing), np.cos(bearing)]), atol=0.011)
    np.testing.assert_allclose(positions["cave.sub.d"] - positions["cave.sub.c"], (10, 5), atol=0.011)


@needs_cavern
def test_passage_blocks_become_legs_that_share_their_stations(tmp_path):
    path = write_svx(tmp_path)
    legs, _ = read_passages(path)
    assert sorted(len(leg.stations) for leg in legs) == [3, 5]
    assert len(set(legs[0].stations) & set(legs[1].stations)) == 1
    walls = {s: w.tolist() for leg in legs for s, w in zip(leg.stations, leg.walls_m, strict=True)}
    assert walls["cave.0"] == [2.0, 2.5]
    assert build_workings(legs).geom_type == "Polygon"
    assert [p.name for p in survey_files(path)] == ["cave.svx", "sub.svx"]


@needs_cavern
def test_the_closing_error_of_a_loop_is_distributed_over_all_shots(tmp_path):
    path = tmp_path / "loop.svx"
    path.write_text(
        "a b 10 0 0\nb c 10 90 0\nc d 10 180 0\nd a 10.4 270 0\n*data passage station left right up down\n"
        "a 1 1 1 1\nb 1 1 1 1\nc 1 1 1 1\nd 1 1 1 1\na 1 1 1 1\n"
    )
    (leg,), _ = read_passages(path)
    steps = np.diff(leg.positions_m, axis=0)
    np.testing.assert_allclose(steps.sum(axis=0), 0, atol=1e-6)
    shown = np.array([10, 10, 10, 10.4])
    corrected = np.linalg.norm(steps, axis=1) - shown
    assert (np.abs(corrected[[0, 2]]) < 0.011).all()  # the misclosure lies in the other direction
    assert 0.04 < corrected[1] < 0.36
    assert -0.36 < corrected[3] < -0.04


@needs_cavern
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*include ../../etc/passwd\n", "no such file|is outside"),
        ("*begin a\n1 2 5 0 0\n", r"bad\.svx:1: BEGIN with no matching END"),
        ("1 2 x 0 0\n", r"bad\.svx:1: Expecting numeric field, found “x”"),
        ("*frobnicate\n", "Unknown command “frobnicate”"),
        ("1 2 5 0 0\n", "no cross-sections and no splays; state the distance to the walls"),
        ("1 2 5 0 0\n*data passage station left right up down\n9 1 1 1 1\n", r"bad\.svx:3: .*non-existent station “9”"),
        (
            "1 2 5 0 0\n*data passage station left right up down\n1 - 1 1 1\n2 - 1 1 1\n",
            "no station has a distance to both",
        ),
        ("", "No survey data"),
        ("*fix 1 0 0 0\n*fix 1 500 0 0\n", r"bad\.svx:2: Station already fixed"),
        ("*units tape -1 metres\n1 2 5 0 0\n", r"bad\.svx:2: Negative adjusted tape reading .*correct it"),
        ("*calibrate tape 9\n1 2 5 0 0\n", r"bad\.svx:2: Negative adjusted tape reading .*correct it"),
        ("*set comment #\n", r"\*set comment is not supported"),
        ("1 2 5 0 0 77\n", r"bad\.svx:1: End of line not blank"),
        ("; a note\x0c1 2 5 0 0\n", "a control character, 0x0c"),
    ],
)
def test_a_survex_file_that_cannot_be_used_is_refused_with_its_line(tmp_path, text, message):
    path = tmp_path / "bad.svx"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_passages(path)


THERION = """survey adit
  centreline
    fix 0 120 340 0
    data normal from to length compass clino left right up down
    0 1 10.0 90 0  2 2.5 2 0.5
    1 2 12.0 80 1  2 2 2 0.5
    1 3 8.0 180 0  1.5 1.5 2 .5
  endcentreline
endsurvey
"""
PLT = """Z -1 1 -1 1 -1 1
SADIT
M 1115.49 393.70 0 Sa P 6.56 6.56 1.64 8.20
D 1115.49 426.51 0 Sb P -9.99 6.56 1.64 999.9
D 1122.00 465.00 0 Sc P 6.56 6.56 1.64 6.56
M 1115.49 426.51 0 Sb P 4.92 6.56 1.64 4.92
D 1089.00 426.51 0 Sd P 4.92 6.56 1.64 4.92
X 1 1 1 1 1 1
"""


def plt_legs(path):
    return plan_legs(path, read_plt(path))


def test_a_file_exported_by_therion_is_read_with_its_passages(tmp_path):
    therion = shutil.which("therion")
    if therion is None:
        pytest.skip("Therion is not installed (Debian: therion)")
    (tmp_path / "cave.th").write_text(THERION)
    (tmp_path / "thconfig").write_text("source cave.th\nexport model -fmt compass -o cave.plt\n")
    subprocess.run([therion, "-q"], cwd=tmp_path, check=True, capture_output=True)
    legs = plt_legs(tmp_path / "cave.plt")
    positions = {s: p for leg in legs for s, p in zip(leg.stations, leg.positions_m, strict=True)}
    np.testing.assert_allclose(positions["1"] - positions["0"], (10, 0), atol=0.01)
    np.testing.assert_allclose(positions["3"] - positions["1"], (0, -8), atol=0.01)
    walls = {s: w for leg in legs for s, w in zip(leg.stations, leg.walls_m, strict=True)}
    np.testing.assert_allclose(walls["0"], (2, 2.5), atol=0.01)


def test_plot_files_are_in_feet_and_missing_wall_distances_are_interpolated(tmp_path):
    path = tmp_path / "a.plt"
    path.write_text(PLT)
    one, two = plt_legs(path)
    np.testing.assert_allclose(one.positions_m[0], (120.0, 340.0), atol=0.01)
    assert one.stations == ["a", "b", "c"]
    np.testing.assert_allclose(one.walls_m, [[2.0, 2.5], [2.0, 2.25], [2.0, 2.0]], atol=0.01)
    assert two.stations == ["b", "d"]


def test_a_plot_file_whose_stations_differ_in_height_keeps_their_heights(tmp_path):
    path = tmp_path / "a.plt"
    path.write_text(PLT.replace("1089.00 426.51 0 Sd P 4.92 6.56 1.64", "1089.00 426.51 -9.84 Sd P 4.92 6.56 3.28"))
    heights = {s: h for leg in plt_legs(path) for s, h in zip(leg.stations, leg.heights_m, strict=True)}
    np.testing.assert_allclose(heights["a"], (0, 2.0, 0.5), atol=0.01)
    np.testing.assert_allclose(heights["d"], (-3.0, 2.0, 1.0), atol=0.01)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("M 1 2\n", "expected M north east up Sname"),
        ("M 1 x 0 Sa\n", ":1: 'x' is not a number"),
        ("", "no legs"),
        ("M 1 2 0 Sa P 1 1\n", "expected P left up down right"),
        ("M 1 inf 0 Sa\n", "not a finite number"),
        ("M 1 1e300 0 Sa\n", "not a finite number of feet below"),
    ],
)
def test_a_plot_file_that_cannot_be_used_is_refused(tmp_path, text, message):
    path = tmp_path / "bad.plt"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_plt(path)


@needs_cavern
def test_names_of_other_letters_than_survex_allows_are_refused_with_their_line(tmp_path):
    path = tmp_path / "cave.svx"
    path.write_text("1 2 5 90 0\n2 \xe91 5 90 0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"cave\.svx:2: .*use \*SET NAMES to set allowed characters"):
        read_passages(path)


# As Therion 6.1.6 writes a level drift of 40 m with splays of 3 and 4 m to the left, and of 2 and 2.5 m to the right.
SPLAYS = """M\t0\t0\t0\tS1\tP\t-9999\t-9999\t-9999\t-9999
D\t-6.5617\t0\t0\tS-\tP\t-9999\t-9999\t-9999\t-9999
M\t0\t0\t0\tS1\tP\t-9999\t-9999\t-9999\t-9999
D\t9.8425\t0\t0\tS.\tP\t-9999\t-9999\t-9999\t-9999
M\t0\t0\t0\tS1\tP\t-9999\t-9999\t-9999\t-9999
D\t0\t65.617\t0\tS2\tP\t-9999\t-9999\t-9999\t-9999
D\t-8.2021\t65.617\t0\tS-\tP\t-9999\t-9999\t-9999\t-9999
M\t0\t65.617\t0\tS2\tP\t-9999\t-9999\t-9999\t-9999
D\t13.1234\t65.617\t0\tS%s\tP\t-9999\t-9999\t-9999\t-9999
M\t0\t65.617\t0\tS2\tP\t-9999\t-9999\t-9999\t-9999
D\t0\t131.234\t%s\tS3\tP\t-9999\t-9999\t-9999\t-9999
"""


@pytest.mark.parametrize("name", [".", "-", ""])
@pytest.mark.parametrize("rise", ["0", "-13"])
def test_ends_of_splays_in_a_plot_file_are_walls_and_no_drifts(tmp_path, name, rise):
    (tmp_path / "a.plt").write_text(SPLAYS % (name, rise))
    (leg,) = plt_legs(tmp_path / "a.plt")
    assert leg.stations == ["1", "2", "3"]
    np.testing.assert_allclose(leg.walls_m[:2], [(3, 2), (4, 2.5)], atol=0.001)


@pytest.mark.parametrize(
    "text",
    [
        "leg,station,easting_m,northing_m,left_m,right_m\nA,p,0,0,0,0\nA,q,30,0,0,0\n",
        "leg,station,easting_m,northing_m,left_m,right_m,up_m,elevation_m\nA,p,0,0,0,0,2,0\nA,q,30,0,0,0,2,-9\n",
    ],
)
def test_stations_without_width_are_refused_by_their_names(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"a\.csv: .* enclose no area: left and right are 0 at p, q; "):
        detect_survey(path)
