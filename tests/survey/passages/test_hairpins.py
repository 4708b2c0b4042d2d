"""Hairpins: two arms of a station that share their first metres."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.survey.passages.sheets import lay_out_sheets
from pipeline.survey.stations.table import read_station_legs
from tests.heights import table

# A decline of 7.5 % that turns by 152 deg at its second station.
HAIRPIN = {"D": [("a", 0, 0, 100), ("b", 40, 0, 97), ("c", 2, 20, 93.8), ("d", -20, 40, 91.6)]}
# The same with arms that part only after 30 m of 38: too little remains for the fall.
NARROW = {"D": [("a", 0, 0, 100), ("b", 40, 0, 97), ("c", 2, 7, 94), ("d", -20, 20, 92)]}


def drawn(tmp_path, legs, apart_m=None):
    path = tmp_path / "stations.csv"
    path.write_text(table(legs))
    return lay_out_sheets(path, read_station_legs(path), apart_m)


def test_the_arms_of_a_hairpin_are_one_level_floor_until_they_part(tmp_path):
    polygons, heights = drawn(tmp_path, HAIRPIN)
    assert len(polygons.geoms) == 1
    line = np.array(heights.lines[0]) + np.array([0, 0, heights.datum_m])
    from_bend = np.linalg.norm(line[:, :2] - (40, 0), axis=1)
    # 5.4 m apart, the width and 1 m of rock, where both arms are 5.4 / (2 sin 13.9 deg) = 11.2 m long.
    assert line[from_bend < 11.2][:, 2] == pytest.approx(97.0)
    assert (line[from_bend > 16][:, 2] != 97.0).all()


@pytest.mark.parametrize("station", HAIRPIN["D"])
def test_stations_of_a_hairpin_keep_their_heights(station, tmp_path):
    _, x, y, z = station
    _, heights = drawn(tmp_path, HAIRPIN)
    line = np.array(heights.lines[0]) + np.array([0, 0, heights.datum_m])
    at = np.linalg.norm(line[:, :2] - (x, y), axis=1).argmin()
    assert line[at] == pytest.approx([x, y, z])


def test_a_hairpin_without_room_to_part_is_refused_with_its_stations(tmp_path):
    with pytest.raises(InputError, match=r"lie over each other at \(.*\), and no leg between them is long enough"):
        drawn(tmp_path, NARROW)


def test_of_a_hairpin_without_room_to_part_one_shot_is_left_out_and_said(tmp_path, capsys):
    polygons, _ = drawn(tmp_path, NARROW, apart_m=4.0)
    assert len(polygons.geoms) == 1
    assert polygons.area > 200
    assert "1 shots, 40 m, lie less than 4 m over or under others" in capsys.readouterr().err
