"""Surpac strings: Y before X, pieces between null records, numbers as layers; binary files by their name."""

import pytest
from shapely import LineString

from minesurveys.vector.surpac import read_surpac
from pipeline.errors import InputError
from pipeline.survey.detect import detect_here

DRIFT = """850 level,21-Nov-26,,ssi_styles:styles.ssi
0, 0.000, 0.000, 0.000, 0.000, 0.000, 0.000
1, 100.000, 500.000, 850.000, toe
1, 100.000, 560.000, 850.000,
1, 105.000, 560.000, 850.000,
1, 105.000, 500.000, 850.000,
1, 100.000, 500.000, 850.000,
0, 0.000, 0.000, 0.000,
1, 200.000, 500.000, 851.500,
1, 200.000, 540.000, 851.500,
2, 210.000, 540.000, 852.000,
2, 210.000, 500.000, 852.000,
0, 0.000, 0.000, 0.000,
7, 150.000, 510.000, 850.000, peg 7
0, 0.000, 0.000, 0.000,
0, 0.000, 0.000, 0.000, END
"""


def write(tmp_path, text=DRIFT):
    (tmp_path / "drift.str").write_text(text)
    return tmp_path / "drift.str"


def test_strings_are_lines_with_easting_northing_and_elevation(tmp_path):
    read = read_surpac(write(tmp_path), None)
    assert read.layer_of == ["1", "1", "2"]
    assert read.shapes[0].is_closed
    assert list(read.shapes[0].coords)[:2] == [(500.0, 100.0, 850.0), (560.0, 100.0, 850.0)]
    assert read.shapes[1:] == [
        LineString([(500, 200, 851.5), (540, 200, 851.5)]),
        LineString([(540, 210, 852), (500, 210, 852)]),
    ]
    assert read.others == {"points": 1}
    assert read.unit is None


def test_strings_are_chosen_by_their_numbers_and_an_unknown_one_is_refused_with_those_that_there_are(tmp_path):
    path = write(tmp_path)
    assert read_surpac(path, ["2"]).layer_of == ["2"]
    with pytest.raises(InputError, match="no string 9; there are 1, 2, 7"):
        read_surpac(path, ["9"])


def test_a_closed_string_becomes_the_workings_of_a_mine(tmp_path):
    closed = DRIFT[: DRIFT.index("1, 200.000")] + "0, 0.000, 0.000, 0.000, END\n"
    found = detect_here(str(write(tmp_path, closed)), {}).values
    assert found["values"]["kind"] == "vector"
    assert found["width_m"] == pytest.approx(2 * 60 * 5 / 130)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"pit,12-Nov-26,,\n\x00\x00\x80?\x00\x01", "a binary Surpac string file; save it .* as a text string file"),
        (
            b"a,b,,\n0,0,0,0,0,0,0\n1, 5.0, east, 2\n",
            r":3: not a record of a Surpac string file: expected .* Y, X and Z",
        ),
        (b"a,b,,\n0,0,0,0,0,0,0\n1.5, 5, 6, 7\n", ":3: not a record"),
        (b"a,b,,\n0,0,0,0,0,0,0\n1, 5, nan, 7\n", ":3: not a record"),
        (b"a,b\n", "its header alone has two"),
        (b"a,b\n0,0,0,0\n\n", "neither strings nor a record with END"),
    ],
)
def test_a_file_of_another_kind_is_refused_with_the_line(tmp_path, data, message):
    (tmp_path / "a.str").write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_surpac(tmp_path / "a.str", None)
