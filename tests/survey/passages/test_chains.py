"""Which way the sections of steep shots face."""

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from tests.heights import HEADER

GALLERY = "A,1,0,0,0,2,0,3,0.5\nA,2,20,0,0,2,0,3,0.5\n"  # to the east, stations on its left wall
PITCH = "B,2,20,0,0,2,0,3,0.5\nB,3,{x},{y},0,2,-12,3,0.5\n"
ACROSS = "C,4,20,9,1,1,0,3,0.5\nC,2,20,0,1,1,0,3,0.5\n"  # one that meets both, so that none goes on in another


def left_of(rows: str, leg: str, folder) -> np.ndarray:
    network = GateCase("test", HEADER + rows).network(folder)
    names = [network.leg_name(k) for k in range(len(network.shots))]
    return network.across[names.index(leg)]


@pytest.mark.parametrize("foot", [(20, 0), (19.7, 0.2), (20.1, -0.6)])
@pytest.mark.parametrize("others", ["", ACROSS])
def test_a_pitch_near_plumb_faces_as_the_gallery_that_it_begins_in(others, foot, tmp_path):
    rows = GALLERY + PITCH.format(x=foot[0], y=foot[1]) + others
    assert left_of(rows, "2 to 3", tmp_path) == pytest.approx(np.array([[0, 1], [0, 1]]))


def test_a_pitch_whose_sides_are_stated_the_other_way_round_is_turned(tmp_path):
    pitch = "B,2,20,0,2,0,0,3,0.5\nB,3,20.1,0.3,2,0,-12,3,0.5\n"
    assert left_of(GALLERY + pitch + ACROSS, "2 to 3", tmp_path) == pytest.approx(np.array([[0, -1], [0, -1]]))


def test_a_pitch_that_leans_by_more_faces_as_it_leans(tmp_path):
    rows = GALLERY + PITCH.format(x=20, y=-3) + ACROSS
    assert left_of(rows, "2 to 3", tmp_path) == pytest.approx(np.array([[1, 0], [1, 0]]))


def test_a_pitch_at_the_head_of_a_chain_faces_as_what_follows(tmp_path):
    rows = "A,1,0,0,0,2,12,3,0.5\nA,2,0.2,0,0,2,0,3,0.5\nA,3,0.2,20,0,2,0,3,0.5\n"
    assert left_of(rows, "1 to 2", tmp_path) == pytest.approx(np.array([[-1, 0], [-1, 0]]))


def test_a_pitch_alone_faces_north(tmp_path):
    assert left_of("A,1,0,0,1,2,0,3,0.5\nA,2,0,0.1,1,2,-9,3,0.5\n", "1 to 2", tmp_path)[0] == pytest.approx([0, 1])
