"""Robots come to every cell that the environment counts as reachable, and no farther."""

import numpy as np
import pytest

from benchmarks.worlds.chassis_flood import flood
from benchmarks.worlds.reach import narrow_mine
from benchmarks.worlds.reach_drives import ReachDrives
from minexplore.physics.robot import RobotParams
from minexplore.world import load_world
from tests.heights import HEADER
from tests.volumes import build_volume

_CELL_M = 2.0


def last_station(table):
    """Return the place (3,) m of the last station, in the far chamber."""
    east, north, *_, height, _, _ = table.splitlines()[-1].split(",")[2:]
    return np.array([float(east), float(north), float(height)])


@pytest.mark.parametrize("seed", [1, 3, 4])  # 0.98, 0.79 and 1.17 m wide
def test_a_robot_drives_to_every_cell_of_a_narrow_mine_and_to_none_beyond(tmp_path, seed):
    table = narrow_mine(seed)
    drives = ReachDrives(load_world(build_volume(table, tmp_path)))
    places = drives.spans.roomiest_m[drives.standing]
    assert np.linalg.norm((places - last_station(table))[:, :2], axis=1).min() < 1.0  # through all of the passage
    found = drives.drive()
    assert found.arrived == found.cells == drives.grid.total > 20
    assert found.ways_on > 0
    assert found.beyond_m < _CELL_M / 2


def test_a_passage_narrower_than_a_robot_ends_its_reach_and_stops_it(tmp_path):
    table = narrow_mine(2, width_m=0.66)
    drives = ReachDrives(load_world(build_volume(table, tmp_path)))
    places = drives.spans.roomiest_m[drives.standing]
    assert np.linalg.norm((places - last_station(table))[:, :2], axis=1).min() > 20.0
    assert max(np.linalg.norm(np.diff(way, axis=0), axis=1).sum() for way in drives.ways_on()) > 5.0
    assert drives.drive().beyond_m < _CELL_M


def test_a_flood_of_contacts_and_the_spans_reach_the_same_cells(tmp_path):
    wide = HEADER + "A,1,0,0,1,1,0,3,0\nA,2,20,3,1,1,-2,3,0\nA,3,30,12,1.5,1,0,3,0\n"
    drives = ReachDrives(load_world(build_volume(wide, tmp_path)))
    cells = drives.cells_at(flood(drives.world, RobotParams()).from_place(drives.anchor_m))
    assert (cells[:, 0] >= 0).all()
    assert len(np.unique(cells[:, 0])) >= 0.9 * drives.grid.total
