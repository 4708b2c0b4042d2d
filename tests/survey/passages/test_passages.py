"""Survex and Compass surveys: our readers must agree with cavern and Therion."""

import shutil
import subprocess

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.survey.passages.legs import build_workings
from pipeline.survey.stations.compass import read_plt
from pipeline.survey.stations.survex import read_svx, svx_files

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


def test_station_positions_agree_with_cavern(tmp_path):
    cavern, dump = shutil.which("cavern"), shutil.which("dump3d")
    if cavern is None or dump is None:
        pytest.skip("Survex is not installed (Debian: survex)")
    path = write_svx(tmp_path)
    subprocess.run([cavern, "-q", str(path)], cwd=tmp_path, check=True, capture_output=True)
    text = subprocess.run([dump, str(tmp_path / "cave.3d")], capture_output=True, text=True, check=True).stdout
    nodes = [line.split() for line in text.splitlines() if line.startswith("NODE")]
    expected = {words[4].strip("[]"): (float(words[1]), float(words[2])) for words in nodes}
    legs, crs = read_svx(path)
    assert crs == "EPSG:32719"
    positions = {s: p for leg in legs for s, p in zip(leg.stations, leg.positions_m, strict=True)}
    assert len(positions) == 7  # stations a and 2 are the same
    for name, position in positions.items():
        np.testing.assert_allclose(position, expected[name], atol=0.011)  # cavern rounds to centimetres


def test_passage_blocks_become_legs_that_share_their_stations(tmp_path):
    path = write_svx(tmp_path)
    legs, _ = read_svx(path)
    assert [len(leg.stations) for leg in legs] == [3, 5]
    assert legs[1].stations[0] == legs[0].stations[-1]
    assert legs[0].walls_m[0].tolist() == [2.0, 2.5]
    assert build_workings(legs).geom_type == "Polygon"
    assert [p.name for p in svx_files(path)] == ["cave.svx", "sub.svx"]


def test_the_closing_error_of_a_loop_is_distributed_over_all_shots(tmp_path):
    path = tmp_path / "loop.svx"
    path.write_text(
        "a b 10 0 0\nb c 10 90 0\nc d 10 180 0\nd a 10.4 270 0\n*data passage station left right up down\n"
        "a 1 1 1 1\nb 1 1 1 1\nc 1 1 1 1\nd 1 1 1 1\na 1 1 1 1\n"
    )
    (leg,), _ = read_svx(path)
    steps = np.diff(leg.positions_m, axis=0)
    np.testing.assert_allclose(steps.sum(axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), [10, 10 + 4 / 40.4, 10, 10.4 - 4.16 / 40.4], atol=0.001)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*include ../../etc/passwd\n", "no such file|is outside"),
        ("*begin a\n1 2 5 0 0\n", r"\*begin a is not closed"),
        ("*end a\n", "closes no"),
        ("1 2 x 0 0\n", r":1: 'x' is not a number"),
        ("1 2 nan 0 0\n", "not a finite number"),
        ("*data diving from to tape depth\n", "not supported; use normal"),
        ("*frobnicate\n", "is not supported"),
        ("1 2 5 0 0\n", "no legs with passages"),
        ("1 2 5 0 0\n3 4 5 0 0\n", "no shot joins station 3"),
        ("1 2 5 0 0\n*data passage station left right up down\n1 1 1 1 1\n9 1 1 1 1\n", "station 9 has passage data"),
        ("1 2 5 0 0\n*data passage station left right up down\n1 - 1 1 1\n2 - 1 1 1\n", "no distance to the left wall"),
        ("", "no shots"),
        ("*cs long-lat\n*fix 1 -70 -33 0\n", "degrees are not supported"),
        ("*fix 1 0 0 0\n*fix 1 500 0 0\n", ":2: station 1 is fixed twice"),
        ("*units tape -1 metres\n", r":1: \*units -1: want a factor above 0"),
        ("*calibrate tape 9\n1 2 5 0 0\n", ":2: tape = 5: -4 m with its"),
        ("*default calibrate\n", r"\*default is not supported"),
        ("*set comment #\n", r"\*set is not supported"),
        ("*data normal from to tape tape compass clino\n", "reading 'tape' stands twice"),
        ("1 2 5 0 0 77\n", "'77' follows the 5 readings"),
        ("1 2 5_0 0 0\n", "'5_0' is not a number"),
        ("; a note\x0c1 2 5 0 0\n", "a control character, 0x0c"),
        ("1 2 5 0 0\n*data passage station left right\n1 400 1\n2 1 1\n", "a wall 400 m beside station 1, at most 300"),
        ("*cs UTM19S\n*fix 1 1 2 0\n*cs UTM20S\n*fix 2 1 2 0\n", "only one coordinate system is supported"),
    ],
)
def test_a_survex_file_that_cannot_be_used_is_refused_with_its_line(tmp_path, text, message):
    path = tmp_path / "bad.svx"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_svx(path)


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


def test_a_file_exported_by_therion_is_read_with_its_passages(tmp_path):
    therion = shutil.which("therion")
    if therion is None:
        pytest.skip("Therion is not installed (Debian: therion)")
    (tmp_path / "cave.th").write_text(THERION)
    (tmp_path / "thconfig").write_text("source cave.th\nexport model -fmt compass -o cave.plt\n")
    subprocess.run([therion, "-q"], cwd=tmp_path, check=True, capture_output=True)
    legs = read_plt(tmp_path / "cave.plt")
    positions = {s: p for leg in legs for s, p in zip(leg.stations, leg.positions_m, strict=True)}
    np.testing.assert_allclose(positions["1"] - positions["0"], (10, 0), atol=0.01)
    np.testing.assert_allclose(positions["3"] - positions["1"], (0, -8), atol=0.01)
    walls = {s: w for leg in legs for s, w in zip(leg.stations, leg.walls_m, strict=True)}
    np.testing.assert_allclose(walls["0"], (2, 2.5), atol=0.01)


def test_plot_files_are_in_feet_and_missing_wall_distances_are_interpolated(tmp_path):
    path = tmp_path / "a.plt"
    path.write_text(PLT)
    one, two = read_plt(path)
    np.testing.assert_allclose(one.positions_m[0], (120.0, 340.0), atol=0.01)
    assert one.stations == ["a", "b", "c"]
    np.testing.assert_allclose(one.walls_m, [[2.0, 2.5], [2.0, 2.25], [2.0, 2.0]], atol=0.01)
    assert two.stations == ["b", "d"]


def test_a_plot_file_whose_stations_differ_in_height_keeps_their_heights(tmp_path):
    path = tmp_path / "a.plt"
    path.write_text(PLT.replace("1089.00 426.51 0 Sd P 4.92 6.56 1.64", "1089.00 426.51 -9.84 Sd P 4.92 6.56 3.28"))
    heights = {s: h for leg in read_plt(path) for s, h in zip(leg.stations, leg.heights_m, strict=True)}
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


def test_names_of_other_letters_than_ascii_are_not_merged(tmp_path):
    path = tmp_path / "cave.svx"
    shots = "1 2 5 90 0\n2 \xe91 5 90 0\n2 \xe81 5 0 0\n*data passage station left right\n1 1 1\n2 1 1\n\xe91 1 1\n"
    found = []
    for encoding in ("latin-1", "utf-8"):
        path.write_bytes(f"{shots}*data passage station left right\n2 1 1\n\xe81 1 1\n".encode(encoding))
        found.append([leg.stations for leg in read_svx(path)[0]])
    assert found == [[["1", "2", "\xe91"], ["2", "\xe81"]]] * 2
