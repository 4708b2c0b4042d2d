"""The comparison with Therion, on solved surveys whose differences are known."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.comparisons.therion_projects import ProjectVerdict, compare, main, table
from pipeline.survey.solved.model import SolvedSurvey


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


def test_the_table_counts_verdicts_and_a_missing_program_is_named(tmp_path: Path, capsys):
    assert "| equal | 2 |" in table({"x.th": ProjectVerdict("equal", ""), "y.th": ProjectVerdict("equal", "")})
    (tmp_path / "x.th").write_text("survey x\nendsurvey\n")
    assert main([str(tmp_path), "--therion", "no-such-program"]) == 2
    assert "no-such-program" in capsys.readouterr().err
