"""What the splays of a survey know of each other."""

import numpy as np
import pytest

from benchmarks.comparisons.splays import nearest_hits
from minesurveys.solved.model import LegFlag, SolvedSurvey


def test_each_hit_of_a_wall_is_compared_with_the_nearest_on_its_side_of_the_leg():
    ends = np.array(
        [(2, 1.5, 0), (2.5, 1.1, 0), (6, 3.0, 0), (4, -2.0, 0)], float
    )  # three to the left, one to the right
    places = np.concatenate([[(0, 0, 0), (10, 0, 0)], ends])
    legs = np.array([(0, 1), *((0, 2 + k) for k in range(len(ends)))])
    flags = np.array([0] + [LegFlag.SPLAY] * len(ends), np.uint8)
    survey = SolvedSurvey(
        ("a", "b", "", "", "", ""), places, np.zeros(6, np.uint8), legs, flags, np.zeros(5, np.uint8), ()
    )
    found = nearest_hits(survey)
    assert found[:3] == pytest.approx(np.array([(0.5, 0.4), (0.5, 0.4), (3.5, 1.9)]))
    assert len(found) == 4
    assert np.isnan(found[3:]).all()
