"""Two codes in turns: the table's ratios, the joined caves, and that a copy of the code measures itself."""

import numpy as np
import pytest

from benchmarks.speed.two_codes import OTHER, Code, Row, cells, joined_caves
from pipeline.errors import ArtifactError
from tests.project import ROOT


def test_a_ratio_is_the_median_of_the_turns_ratios_and_is_judged_by_its_limit():
    turns = [({"a": [2.0, 8.0]}, {"a": [1.0, 2.0]}), ({"a": [4.0, 8.0]}, {"a": [3.0, 8.0]})]
    turns.append(({"a": [10.0, 8.0]}, {"a": [1.0, 4.0]}))
    row = cells(Row("t", "a", 0.5, OTHER), turns)
    assert row == ("t", "other code", "4 (8)", "1 (4)", "0.5 (0.5)", "<= 0.5", "yes")
    assert cells(Row("t", "a", 0.49, OTHER), turns)[-1] == "**no**"
    assert cells(Row("t", "a", 0.4, OTHER, by_clock=True), turns)[-1] == "**no**"


def test_a_reference_is_of_the_same_turn_and_code():
    turns = [({"a": [6.0], "bare": [2.0]}, {"a": [8.0], "bare": [2.0]})]
    row = cells(Row("t", "a", 3.5, "bare", at_least=True), turns)
    assert row == ("t", "bare robot", "3", "4", "1.33", ">= 3.5", "yes")
    assert cells(Row("t", "a", None, "absent"), turns) is None
    assert cells(Row("t", "b", None), turns) is None


@pytest.mark.parametrize("length_m", [6.0, 35.0])
def test_caves_are_joined_until_they_have_a_length(length_m):
    nodes = np.array([[0.0, 0, 0], [0, 4, 0], [0, 8, 0], [3, 4, 0]])
    found, links = joined_caves(nodes, np.array([[0, 1], [1, 2], [1, 3]]), length_m)
    step_m = np.linalg.norm(found[links[:, 0]] - found[links[:, 1]], axis=1)
    assert length_m <= step_m.sum() < length_m + step_m.max()
    assert (step_m > 0).all()
    reached = {0}
    for _ in links:
        reached |= {n for link in links.tolist() if reached & set(link) for n in link}
    assert reached == set(range(len(found)))


def test_a_copy_measures_its_own_code_and_refuses_another(ring, tmp_path):
    figures, spent = Code(ROOT).part("start", str(ring.bundle))
    assert figures == {}
    assert min(spent) > 0.1
    with pytest.raises(ArtifactError, match="another code"):
        Code(tmp_path).part("start", str(ring.bundle))
