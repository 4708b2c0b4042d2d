"""Worlds of drawn areas with heights: floors as drawn, one certificate, and figures that notice other floors."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.types import DrawnFloors, FloorMesh
from pipeline.volume.areas import solid_of_floors
from pipeline.volume.world.proof.drawn import measure_drawn
from pipeline.volume.world.solid import volume_of_solid
from tests.survey.levels.test_drawn_levels import closed, write
from tests.volume_worlds import VolumeWorld, validated

DRIFT = [(0, 0), (30, 0), (30, 5), (0, 5)]
PLAN = [(0, 0), (40, 0), (40, 5), (25, 5), (25, 20), (20, 20), (20, 5), (0, 5)]


def broken(found):
    return {name for name, clause in found.certificate.clauses.items() if not clause.holds}


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    slope = [(x, y, 0.05 * x) for x, y in DRIFT]
    return VolumeWorld.from_areas(write(tmp_path_factory.mktemp("areas") / "a.dxf", {"a": [closed(slope)]}))


def test_the_world_of_a_sloping_room_is_certified_against_the_drawn_floor(world):
    found = validated(world.opened(), world.shape, robot_contacts=200, ball_contacts=200)
    assert broken(found) == set()
    assert found.metrics["drawn"] == {"floor_mm": 0, "median_mm": 0, "step_mm": 0}
    assert (found.metrics["solid"]["iou"], found.metrics["reach"]["share"]) == (1, 1)


def test_a_floor_that_is_drawn_lower_breaks_the_figure_of_the_floor(world):
    lower = replace(world.shape.mesh, vertices=world.shape.mesh.vertices - [0, 0, 0.02])
    found = validated(world.opened(), replace(world.shape, mesh=lower))
    assert broken(found) == {"drawn.floor_mm"}
    assert found.metrics["drawn"]["floor_mm"] == pytest.approx(20, abs=1)


def test_a_step_across_a_seam_is_measured():
    corners = [[0, 0, 0], [10, 0, 0], [10, 5, 0], [0, 5, 0], [20, 0, 0], [20, 5, 0]]
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]], np.int32)
    drawn = FloorMesh(np.array(corners, float), faces, 0.0)
    lower = np.concatenate([drawn.vertices, drawn.vertices[[1, 4, 5, 2]] - [0, 0, 0.02]])
    stepped = FloorMesh(lower, np.array([[0, 1, 2], [0, 2, 3], [6, 7, 8], [6, 8, 9]], np.int32), 0.0)
    off = {}
    for name, floors in (("drawn", drawn), ("stepped", stepped)):
        volume = volume_of_solid(solid_of_floors(DrawnFloors(floors), 3.5, 1.0), 0.364)
        off[name] = measure_drawn(volume, DrawnFloors(drawn), 1.0)
    assert (off["drawn"].error_m, off["drawn"].step_m) == (0, 0)
    assert (off["stepped"].error_m, off["stepped"].step_m) == pytest.approx((0.02, 0.02))


@pytest.mark.parametrize("stated", ["heights", "grade"])
def test_a_plan_with_heights_of_its_own_file_is_one_volume(tmp_path, stated):
    path = write(tmp_path / "a.dxf", {"a": [closed([(x, y, 0) for x, y in PLAN])]}, lift_m=0, flat=("a",))
    table = tmp_path / "h.csv"
    table.write_text("easting_m,northing_m,elevation_m\n0,2.5,100\n20,2.5,101\n40,2.5,103\n22.5,20,102\n")
    world = VolumeWorld.from_areas(path, **({"heights": table} if stated == "heights" else {"grade": 0.05}))
    found = validated(world.opened(), world.shape)
    assert broken(found) == set()
    assert found.metrics["drawn"]["floor_mm"] < 5
    datum, rise = (100, 3) if stated == "heights" else (0, 0.05 * 35)
    assert world.shape.datum_m == datum
    assert np.ptp(world.shape.mesh.vertices[:, 2]) == pytest.approx(rise, abs=0.2)
