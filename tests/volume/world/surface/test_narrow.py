"""The balls that say how narrow a passage is, wherever its legs run, and the room of rock about the narrowest."""

import numpy as np
import pytest

from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.store.codecs import decode
from pipeline.volume.world.surface.fine import refine
from pipeline.volume.world.surface.narrow import balls_along
from pipeline.volume.world.surface.room import room_about
from pipeline.volume.world.topology import LegNetwork
from tests.volume_worlds import HEADER, VolumeWorld

# 4 m wide and 3 m high, but 2 m wide in the middle third, where the leg runs 0.4 m beside a wall.
PINCH = HEADER + (
    "A,1,0,0,0,2,2,3,0\nA,2,20,0,0,2,2,3,0\n"
    "B,2,20,0,0,1.6,0.4,3,0\nB,3,40,0,0,1.6,0.4,3,0\n"
    "C,3,40,0,0,2,2,3,0\nC,4,60,0,0,2,2,3,0\n"
)


@pytest.fixture(scope="module")
def pinch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pinch")
    world = VolumeWorld(PINCH, folder)
    return decode(world.compiled / "volume.npz", VolumeFacets), decode(world.compiled / "topology.json", LegNetwork)


def test_a_ball_is_as_wide_as_the_passage_though_the_leg_runs_beside_a_wall(pinch):
    balls = balls_along(*pinch)
    narrow = np.abs(balls.middles_m[:, 0] - 30) < 9
    assert narrow.any()
    assert balls.radii_m[narrow] == pytest.approx(1.0, abs=0.02)
    assert balls.middles_m[narrow, 1] == pytest.approx(0.6, abs=0.02)
    assert balls.radii_m[np.abs(balls.middles_m[:, 0] - 10) < 5] == pytest.approx(1.5, abs=0.02)  # half the height


def test_the_narrowest_balls_are_those_of_the_narrowest_passage(pinch):
    narrowest = balls_along(*pinch).narrowest
    assert (np.abs(narrowest.middles_m[:, 0] - 30) < 10).all()
    assert np.ptp(narrowest.radii_m) <= 0.1


def test_rock_about_the_narrowest_balls_has_their_radius_as_half_width_at_most_and_other_rock_its_own(pinch):
    volume, legs = pinch
    balls, fine = balls_along(volume, legs), refine(volume, 0.3, 0.3)
    without, with_balls = room_about(fine, volume), room_about(fine, volume, balls)
    about = (np.abs(fine.vertices[:, 0] - 30) < 4) & (np.linalg.norm(fine.vertices[:, 1:] - [0.6, 1.5], axis=1) < 1.2)
    assert about.any()
    assert with_balls.half_m[about].max() <= balls.narrowest.radii_m.max()
    assert (with_balls.half_m <= without.half_m).all()
    assert (with_balls.half_m < without.half_m).any()
    far = np.abs(fine.vertices[:, 0] - 30) > 15
    assert with_balls.half_m[far] == pytest.approx(without.half_m[far], rel=1e-12)
