"""The comparison with Therion and Survex, on solved surveys whose differences are known."""

import numpy as np
import pytest

from benchmarks.comparisons.survey_programs import compare, read_dump, read_positions
from minesurveys.solved.model import SolvedSurvey


def survey(places: dict[str, tuple], legs: int = 1) -> SolvedSurvey:
    return SolvedSurvey(
        names=tuple(places),
        positions_m=np.array(list(places.values()), float).reshape(-1, 3),
        station_flags=np.zeros(len(places), np.uint8),
        legs=np.array(legs * [(0, 1)]).reshape(-1, 2),
        leg_flags=np.zeros(legs, np.uint8),
        leg_styles=np.zeros(legs, np.uint8),
        passages=(),
        title="",
        crs=None,
        date="",
    )


THEIRS = survey({"a.1": (0, 0, 0), "a.2": (5, 0, 0), "a.b.1": (0, 9, 0), "a.b.1 (2)": (0, 7, 0)})


def test_a_survey_that_is_shifted_as_a_whole_is_equal():
    moved = survey({"a.1": (1, 2, 3), "a.2": (6, 2, 3), "a.b.1 (2)": (1, 11, 3), "a.b~1": (1, 9, 3)})
    assert compare(THEIRS, moved).verdict == "equal"


@pytest.mark.parametrize(
    ("ours", "why"),
    [
        (survey({"a.1": (0, 0, 0), "a.2": (5, 0.5, 0), "a.b.1": (0, 8, 0)}), "largest distance 1.000 m"),
        (survey({"a.1": (0, 0, 0), "a.b.1": (0, 9, 0)}), "1 of 3 stations are missing, a.2 first"),
        (survey({"a.1": (0, 0, 0), "a.2": (5, 0, 0), "a.b.1": (0, 9, 0), "a.b.1 (2)": (0, 7, 0)}, 2), "2 legs here"),
    ],
)
def test_a_station_elsewhere_or_missing_and_a_leg_too_many_are_different(ours, why):
    found = compare(THEIRS, ours)
    assert found.verdict == "different"
    assert why in found.why


DUMP = """TITLE "x"
--
MOVE 0.00 0.00 0.00
LINE 5.00 0.00 0.00 [] STYLE=NORMAL SURFACE
NODE 5.00 0.00 0.00 [a.2] UNDERGROUND
NODE 0.00 0.00 0.00 [a.1] UNDERGROUND ENTRANCE
"""


def test_what_survex_prints_of_a_solved_survey_is_compared_with_what_is_read_here():
    theirs = read_dump(DUMP)
    assert compare(theirs, survey({"a.1": (0, 0, 0), "a.2": (5, 0, 0)})).verdict == "equal"
    assert compare(theirs, survey({"a.1": (0, 0, 0), "a.2": (5, 0, 1)})).verdict == "different"
    newer = read_dump(DUMP.replace("MOVE", "LEG 0 0 0").replace("LINE 5", "x"))
    assert len(newer.legs) == 1
    positions = read_positions("( Easting, Northing, Altitude )\n(  0.00,  0.00, -1.50 ) a.1\n")
    assert positions.names == ("a.1",)
    assert compare(positions, survey({"a.1": (0, 0, -1.5)})).verdict == "equal"
    assert compare(read_dump("--\n"), survey({"a.1": (0, 0, 0)})).verdict == "different"
