"""Clauses of a volume that a level world has too: distances by MuJoCo, discs in rock, walls across passages."""

import dataclasses

import manifold3d
import numpy as np
import pytest

from minexplore.floors.volume_arrays import FacetLabel
from minexplore.physics.robot import RobotParams
from pipeline.scans.meshes.uncrossed import arrays_of
from pipeline.types import ClosedMesh
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import _spaces
from pipeline.volume.world.proof.fronts import fronts_of
from pipeline.volume.world.proof.solid import measure_solid
from pipeline.volume.world.proof.throws import Throws, deepest_disc, throw_robots
from pipeline.volume.world.solid import volume_of_solid
from tests.volume.world.test_volume_certificate import broken, with_parts
from tests.volume_worlds import RAMP, VolumeWorld, proof, validated


@pytest.fixture(scope="module")
def ramp(tmp_path_factory):
    return VolumeWorld(RAMP, tmp_path_factory.mktemp("ramp"))


@pytest.fixture(scope="module")
def opened(ramp):
    return ramp.opened()


def aside(corners, back_m):
    """Return the corners of a wall of the ramp moved by `back_m` away from the drift; those of ends stay."""
    y = corners[:, 1]
    return corners + np.array([0.0, back_m * (int(y.min() > 1) - int(y.max() < -1)), 0.0])


@pytest.mark.parametrize("back_m", [0.02, -0.02])
def test_a_wall_beside_its_surface_is_farther_or_nearer_than_the_surface_by_mujocos_distances(ramp, opened, back_m):
    assert broken(validated(opened, ramp.shape)) == set()
    found = validated(with_parts(opened, lambda k, corners: aside(corners, back_m)), ramp.shape)
    assert "clearance.error_m" in broken(found)
    assert found.metrics["clearance"]["error_m"] == pytest.approx(abs(back_m), abs=2e-3)
    assert found.metrics["clearance"]["error_at"].endswith(" m")


@pytest.mark.parametrize("beyond_m", [0.0, 0.3])
def test_how_far_rock_reaches_into_a_disc_is_measured_along_its_plane(opened, beyond_m):
    volume, radius = closed_volume(opened.mine), RobotParams().radius_m
    wall = volume.vertices[volume.faces[opened.mine.label == FacetLabel.WALL]][:, :, 1].max()
    middle = np.array([[10.0, wall - radius - 0.01 + beyond_m, 7.0]])
    found = deepest_disc(volume, middle, np.eye(3)[None])
    assert found.deepest_m == pytest.approx(max(0.0, beyond_m - 0.01), abs=1e-3)
    assert found.deepest_at == pytest.approx(middle[0])


def test_robots_before_walls_that_stand_back_are_deeper_in_rock_than_the_clause_allows(opened):
    volume = closed_volume(opened.mine)
    parts = fronts_of(volume, opened.parts).parts
    back = [dataclasses.replace(part, corners=aside(part.corners, 0.2)) for part in parts]
    limit = proof().limits["robots.deepest_m"]
    held = [
        limit.holds(throw_robots(volume, some, 40_000, np.random.default_rng(9)).deepest_m) for some in (parts, back)
    ]
    assert held == [True, False]


def test_the_deepest_of_several_throws_counts_with_its_place():
    found = sum([Throws(1, 12, 0, 3, 0.02, (1, 2, 3)), Throws(2, 12, 1, 4, 0.05, (4, 5, 6)), Throws(3)], Throws())
    assert found == Throws(6, 24, 1, 7, 0.05, (4, 5, 6))


def mesh_of(solid):
    vertices, faces = arrays_of(solid)
    return ClosedMesh(vertices, faces.astype(np.int32), 0.0)


@pytest.mark.parametrize("across_m", [None, 10.0, 20.0])
def test_a_wall_of_8_cm_across_a_passage_breaks_the_clauses_of_its_surface_and_of_its_spaces(across_m):
    ring = manifold3d.Manifold.cube([30, 30, 3]) - manifold3d.Manifold.cube([24, 24, 9]).translate([3, 3, -3])
    hall = manifold3d.Manifold.cube([200, 200, 3]).translate([29, 0, 0])  # so large that shares do not see the wall
    way = manifold3d.Manifold.cube([40, 3, 3]).translate([-40, 0, 0])  # that leads on, and no way round
    solid = ring + hall + way
    wall = manifold3d.Manifold.cube([0.08, 9, 9]).translate([-20 if across_m == 20 else 10, -3, -3])
    built = solid if across_m is None else solid - wall.trim_by_plane([0, -1, 0], -5)
    volume = volume_of_solid(mesh_of(built), 0.364)
    found, limits = measure_solid(volume, mesh_of(solid), np.random.default_rng(0)), proof().limits
    assert all(limits[f"solid.{name}"].holds(found[name]) for name in ("iou", "within_10cm", "lump_m3"))
    assert limits["solid.surface_mm"].holds(found["surface_mm"]) == (across_m is None)
    assert limits["survey.spaces"].holds(_spaces(volume)) == (across_m != 20)  # the ring still leads round
