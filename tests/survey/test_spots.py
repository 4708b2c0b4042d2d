"""Spot heights from a stranger: one line that names the place in the file."""

import pytest

from minesurveys.frames import METRIC
from minesurveys.spots import read_spots
from pipeline.errors import InputError

HEAD = "easting_m,northing_m,elevation_m\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{HEAD}0,0,1e308\n60,10,-1e308\n", r":2: elevation_m = 1e308 is not within \+-10000"),
        (f"{HEAD}0,0,0\n1e300,0,1\n", r":3: easting_m = 1e300 is not within \+-1e\+12"),
        (f"{HEAD}0,0,nan\n", r":2: elevation_m = nan is not a finite number"),
        (f"{HEAD}0,0,\x1b[31m\n", r":2: elevation_m = '\\x1b\[31m' is not a number"),
        (f"{HEAD}0,0,{'x' * 5000}\n", r":2: elevation_m = 'x{60}' is not a number"),
        (f"{HEAD}4_0,0,1\n", r":2: easting_m = '4_0' is not a number"),
        (f"{HEAD}0,\u0664,1\n", r":2: northing_m = '\u0664' is not a number"),
        (f"{HEAD}0,0,\u00a01\n", r":2: elevation_m = '\\xa01' is not a number"),
        (HEAD + "0,0,1\r1,1,1\r", r":2: a line end of CR alone; save the file with line ends of LF or CR LF"),
        (f"{HEAD}0,0,1,7\n", r":2: more fields than columns"),
        ("easting_m,northing_m,elevation_m,elevation_m\n0,0,1,2\n", "the column 'elevation_m' stands twice"),
    ],
)
def test_spots_that_are_no_places_are_one_line(tmp_path, text, message):
    path = tmp_path / "spots.csv"
    path.write_bytes(text.encode())
    with pytest.raises(InputError, match=message) as error:
        read_spots(path, METRIC)
    assert str(error.value).isprintable()


def test_two_heights_of_one_place_are_refused(tmp_path):
    path = tmp_path / "spots.csv"
    path.write_text("easting_m,northing_m,elevation_m\n1,2,3\n1,2,3.02\n1,2,300\n")
    with pytest.raises(InputError, match=r"two spots at \(1, 2\), 3 m and 300 m high"):
        read_spots(path, METRIC)
