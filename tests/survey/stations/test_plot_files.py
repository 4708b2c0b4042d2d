"""Flags of shots in Compass's plot files, as Survex 1.4.22 writes and reads them."""

import numpy as np

from minesurveys.solved.model import LegFlag
from minesurveys.stations.compass import read_plt

NONE = "P -9 -9 -9 -9"
PLOT = f"""\
NA D 1 1 2020 Cmine
M 0 0 0 S1 P 2 3 1 4
D 0 10 0 S2 P 2 3 1 4
d 0 20 0 S3 {NONE}
D 0 30 0 S4 P 1 3 1 1
D 0 40 0 S5 P 1 3 1 1 I 40.0
D 0 50 0 S6 {NONE} I 50.0 FP
M 0 30 0 S4 P 1 3 1 1
D 5 30 0 S^1 {NONE} FS
M 0 30 0 S4 P 1 3 1 1
D 0 40 0 S5 {NONE} FLC
"""


def test_flags_of_shots_are_those_of_legs_and_a_shot_that_is_not_plotted_is_no_passage(tmp_path):
    path = tmp_path / "a.plt"
    path.write_text(PLOT)
    survey = read_plt(path)
    legs = {
        (survey.names[a], survey.names[b], LegFlag(int(flag)))
        for (a, b), flag in zip(survey.legs.tolist(), survey.leg_flags, strict=True)
    }
    assert legs == {
        ("1", "2", LegFlag(0)),
        ("2", "3", LegFlag.SURFACE),
        ("3", "4", LegFlag(0)),
        ("4", "5", LegFlag(0)),
        ("5", "6", LegFlag.SURFACE),
        ("4", "^1", LegFlag.SPLAY),
        ("4", "5", LegFlag.DUPLICATE),
    }
    assert [[survey.names[k] for k in one.stations] for one in survey.passages] == [["1", "2"], ["3", "4", "5"]]


def test_splays_stand_in_for_distances_that_nobody_stated(tmp_path):
    path = tmp_path / "a.plt"
    rows = f"M 0 0 0 S1 {NONE}\nD 0 10 0 S2 {NONE}\nM 0 0 0 S1 {NONE}\nD 5 0 0 S^1 {NONE}"
    path.write_text(f"{rows} FS\n")
    assert read_plt(path).passages == ()
    path.write_text(f"{rows}\n")
    assert np.isnan(read_plt(path).passages[0].lrud_m).all()
