"""Mines written as solids and read again: what counts as the same."""

import numpy as np
import pytest

from benchmarks.scans import round_trips
from benchmarks.scans.round_trips import ROUND_TRIPS, VARIANTS, holds, judge
from pipeline.types import ClosedMesh
from tests.survey.solids.test_solid_files import crossing_tunnels


@pytest.fixture
def mine(monkeypatch):
    vertices, faces, _ = crossing_tunnels()
    mesh = ClosedMesh(vertices, faces.astype(np.int32), 0.0)
    monkeypatch.setattr(round_trips, "_mine", lambda seed: ("crossing", mesh))
    return mesh


@pytest.mark.parametrize("name", ["a.stl", "a.dtm"])
@pytest.mark.parametrize("variant", [one.name for one in VARIANTS])
def test_a_mine_is_the_same_in_every_unit_and_axis(mine, name, variant):
    assert holds(judge((0, name, variant)))


@pytest.mark.parametrize("name", ["a.obj", "a.stl"])
def test_a_spiral_decline_of_nearly_flat_facets_keeps_its_place(name):
    row = judge((3, name, "ft, in a national grid"))
    assert row["kind"] == "spiral decline"
    assert row["off_mm"] < 0.01


def test_a_mine_that_is_two_millimetres_off_is_not_the_same(mine, monkeypatch):
    def moved(path, vertices, faces, entity):
        shifted = vertices.copy()
        shifted[0] += 0.002
        write(path, shifted, faces, entity)

    write = round_trips.write
    monkeypatch.setattr(round_trips, "write", moved)
    row = judge((0, "a.obj", "m"))
    assert row["off_mm"] == pytest.approx(2 * np.sqrt(3), abs=0.1)
    assert not holds(row)
    assert "| all | 1 | 0 |" in ROUND_TRIPS.table([row])
