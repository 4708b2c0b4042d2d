"""Robots come to every cell that the environment counts as reachable, and no farther."""

import manifold3d
import numpy as np
import pytest
import trimesh

from minexplore.world import load_world
from tests.heights import HEADER
from tests.minexplore.volume.reach_drives import ReachDrives
from tests.volume_worlds import VolumeWorld
from tests.volumes import build_volume

_CELL_M = 2.0
_ROOM_M, _PIT_M = 6.0, 3.0


def narrow_mine(seed, width_m=None):
    """Return the station table of a passage as wide as stated, else 0.75 to 1.2 m, that winds between two chambers."""
    rng = np.random.default_rng(seed)
    wide = rng.uniform(0.75, 1.2) if width_m is None else width_m  # 0.98 m of seed 1, 0.79 m of 3, 1.17 m of 4
    widths = [3.0] * 2 + [wide] * 8 + [3.0] * 2
    place, heading, rows = np.zeros(3), rng.uniform(0, 2 * np.pi), []
    for k, width in enumerate(widths):
        x, y, z = place.tolist()
        rows.append(f"A,p{k},{x:.3f},{y:.3f},{width / 2:.4f},{width / 2:.4f},{z:.3f},2,0\n")
        heading += rng.uniform(-0.25, 0.25)
        run = 4.0 if k in (0, len(widths) - 2) else rng.uniform(3, 8)
        place = place + run * np.array([np.cos(heading), np.sin(heading), rng.uniform(-0.1, 0.1)])
    return HEADER + "".join(rows)


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


@pytest.mark.parametrize("seed", [3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 4))])
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


@pytest.mark.parametrize(("width_m", "is_passed"), [(0.62, False), (0.8, True)])
def test_a_ledge_beside_a_pit_is_passed_where_castors_have_floor_whichever_way_a_robot_turns(
    tmp_path, width_m, is_passed
):
    world = VolumeWorld.from_solid(ledge(width_m, tmp_path / "ledge.ply"))
    drives = ReachDrives(load_world(world.bundle))
    east = drives.spans.roomiest_m[drives.standing, 0]
    assert (np.ptp(east) > 2 * _ROOM_M) == is_passed
    found = drives.drive()
    assert found.arrived == found.cells > 5
    assert found.beyond_m < _CELL_M
