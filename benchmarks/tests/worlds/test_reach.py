"""Robots come to every cell that the environment counts as reachable, and no farther."""

import manifold3d
import numpy as np
import pytest
import trimesh

from benchmarks.worlds.chassis_flood import flood
from benchmarks.worlds.reach import narrow_mine
from benchmarks.worlds.reach_drives import ReachDrives
from minexplore.physics.robot import RobotParams
from minexplore.world import load_world
from tests.heights import HEADER
from tests.volume_worlds import VolumeWorld
from tests.volumes import build_volume

_CELL_M = 2.0
_ROOM_M, _PIT_M = 6.0, 3.0


def ledge(width_m, path):
    """Write two rooms joined by a ledge so wide, with a wall on one side and a pit on the other."""
    box = manifold3d.Manifold.cube
    rooms = box([_ROOM_M, 4, 3]) + box([_ROOM_M, 4, 3]).translate([2 * _ROOM_M, 0, 0])
    over = box([_ROOM_M + 0.2, 4, 3]).translate([_ROOM_M - 0.1, 0, 0])
    pit = box([_ROOM_M, 4 - width_m, _PIT_M + 0.1]).translate([_ROOM_M, width_m, -_PIT_M])
    mesh = (rooms + over + pit).to_mesh64()
    trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)).export(path)
    return path


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


@pytest.mark.parametrize(("width_m", "is_passed"), [(0.62, False), (0.8, True)])
def test_a_ledge_beside_a_pit_is_passed_where_castors_have_floor_whichever_way_a_robot_turns(
    tmp_path, width_m, is_passed
):
    world = VolumeWorld.from_solid(ledge(width_m, tmp_path / "ledge.ply"))
    drives = ReachDrives(load_world(world.bundle))
    east = drives.spans.roomiest_m[drives.standing, 0]
    assert (np.ptp(east) > 2 * _ROOM_M) == is_passed
    flooded = flood(drives.world, RobotParams()).from_place(drives.anchor_m)
    assert (np.ptp(flooded[:, 0]) > 2 * _ROOM_M) == is_passed
    assert (drives.cells_at(flooded)[:, 0] >= 0).mean() > 0.98
    found = drives.drive()
    assert found.arrived == found.cells > 5
    assert found.beyond_m < _CELL_M
