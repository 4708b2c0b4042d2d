"""Which side of a wall is free: the flood of a scan ends at a hole though other workings lie all about the rock."""

import manifold3d
import numpy as np
import pytest
import trimesh

from minesurveys.clouds.point_blocks import PointBlock
from pipeline.survey.clouds.facing import turned_alike
from pipeline.survey.clouds.flood import Walls
from pipeline.survey.clouds.normals import planes_of
from pipeline.survey.clouds.thinned import thin
from pipeline.survey.clouds.volume import volume_of_cloud
from pipeline.survey.clouds.voxels import cells_at, grown, keys_of

VOXEL_M, PER_M2 = 0.2, 150
LONG_M, WIDE_M, HIGH_M, APART_M = 10.0, 4.0, 3.0, 8.0


def sampled(solid, seed=0):
    mesh = solid.to_mesh()
    found = trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), process=False)
    points = np.asarray(trimesh.sample.sample_surface(found, int(found.area * PER_M2), seed=seed)[0])
    return points + np.random.default_rng(seed).normal(0, 0.02, points.shape)


@pytest.fixture(scope="module")
def middle():
    return manifold3d.Manifold.cube([LONG_M + 2, WIDE_M, HIGH_M]).translate([-1, 0, 0])


@pytest.fixture(scope="module")
def cloud(middle):
    """Return nine drifts beside and over each other; the middle one, a bit longer, has a hole in its floor."""
    points = [sampled(middle)]
    points[0] = points[0][~((np.abs(points[0] - [LONG_M / 2, 2, 0]) < [1.0, 0.7, 0.1]).all(axis=1))]
    for k, (y, z) in enumerate((y, z) for y in (-1, 0, 1) for z in (-1, 0, 1) if (y, z) != (0, 0)):
        other = manifold3d.Manifold.cube([LONG_M, WIDE_M, HIGH_M])
        points.append(sampled(other.translate([0, APART_M * y, APART_M * z]), k + 1))
    return thin(iter([PointBlock(np.concatenate(points))]), VOXEL_M / 2, 10**6)


@pytest.fixture(scope="module")
def oriented(cloud):
    thick = grown(np.unique(keys_of(cells_at(cloud.points_m, VOXEL_M))))
    return turned_alike(cloud.points_m, planes_of(cloud).normals, thick, VOXEL_M)


@pytest.mark.slow
def test_the_flood_ends_at_a_hole_though_rock_is_enclosed_by_other_drifts(cloud, middle):
    found = volume_of_cloud(cloud, VOXEL_M, 0.03, 20_000)
    solid = manifold3d.Manifold(manifold3d.Mesh64(found.vertices, found.faces.astype(np.uint64)))
    assert (solid ^ middle).volume() / (solid + middle).volume() >= 0.97


def test_normals_show_into_the_drifts(cloud, oriented):
    drift = np.round((cloud.points_m[:, 1:] - [WIDE_M / 2, HIGH_M / 2]) / APART_M) * APART_M
    axis = np.column_stack([np.clip(cloud.points_m[:, 0], 1, LONG_M - 1), drift + np.array([WIDE_M / 2, HIGH_M / 2])])
    inwards = np.einsum("ij,ij->i", axis - cloud.points_m, oriented.normals) > 0
    assert inwards.mean() > 0.999


def test_rock_between_drifts_is_not_enclosed_and_a_drift_is(cloud, oriented):
    walls = Walls(np.unique(keys_of(cells_at(cloud.points_m, VOXEL_M))), VOXEL_M, oriented)
    drift, rock = cells_at(np.array([[LONG_M / 2, 2, 1.5], [LONG_M / 2, 2, -2.0]]), VOXEL_M)
    count, fronts = walls.hits(np.array([drift, rock]))
    assert (count >= 14).all()
    assert fronts[0] > 10
    assert fronts[1] < -5
    assert walls.enclose(np.array([drift, rock]), 14).tolist() == [True, False]
