"""Scanned meshes with the faults that scanners' programs leave become volumes that cross themselves nowhere."""

import manifold3d
import numpy as np
import pytest
import trimesh

from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.params.survey import SolidSurveyParams
from pipeline.scans.meshes.uncrossed import arrays_of, manifold_of
from pipeline.survey.solids.decimate import distances
from pipeline.survey.solids.read import read_solid
from pipeline.volume.world.solid import volume_of_solid

EDGE_M = 0.12
STEEPEST = 0.364
PARAMS = {
    "kind": "solid",
    "name": "cave",
    "unit": "m",
    "up": None,
    "origin": None,
    "layers": None,
    "weld_m": 0.001,
    "close_m": 10.0,
    "simplify_m": 0.001,
}


@pytest.fixture(scope="module")
def cave():
    """Return vertices and triangles of a T of passages 2.4 m wide, as a scanner's program writes them."""
    tube = manifold3d.Manifold.cylinder(14, 1.2, 1.2, 48, True).rotate([0, 90, 0])
    side = manifold3d.Manifold.cylinder(7, 1.1, 1.1, 48).rotate([90, 0, 0])
    return arrays_of((tube + side).refine_to_length(EDGE_M))


def noisy(vertices, faces, rng):
    normals = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    return vertices + normals * rng.normal(0, 0.4 * EDGE_M, len(vertices))[:, None], faces


def folded(vertices, faces, rng):
    moved = vertices.copy()
    some = rng.choice(len(vertices), 60, replace=False)
    moved[some] += rng.normal(0, 2 * EDGE_M, (60, 3))
    return moved, faces


def with_flipped_patch(vertices, faces, rng):
    near = np.linalg.norm(vertices[faces].mean(axis=1) - [3, 0, 1.2], axis=1) < 0.8
    return vertices, np.concatenate([faces[~near], faces[near][:, ::-1]])


def with_sheet_twice(vertices, faces, rng):
    near = np.linalg.norm(vertices[faces].mean(axis=1) - [-3, 0, -1.2], axis=1) < 1.0
    sheet = vertices + rng.normal(0, 0.02, vertices.shape) + [0, 0, 0.02]
    return np.concatenate([vertices, sheet]), np.concatenate([faces, faces[near] + len(vertices)])


def with_open_end(vertices, faces, rng):
    return vertices, faces[vertices[faces].mean(axis=1)[:, 0] < 6.8]


def with_islands(vertices, faces, rng):
    ball = trimesh.creation.icosphere(1, 0.05)
    middles = rng.uniform([-6, -0.5, -0.5], [6, 0.5, 0.5], (30, 3))
    islands = [ball.vertices + middle for middle in middles]
    first = len(vertices) + len(ball.vertices) * np.arange(30)
    return np.concatenate([vertices, *islands]), np.concatenate([faces, *(ball.faces + k for k in first)])


def with_a_fin(vertices, faces, rng):
    a, b = faces[100, :2]
    return np.concatenate([vertices, vertices[[a]] * 0.5]), np.concatenate([faces, [[a, b, len(vertices)]]])


def with_thin_wall(vertices, faces, rng):
    beside = manifold_of(vertices, faces).translate([0.0, 2.43, 0.0])
    whole = manifold_of(vertices, faces).trim_by_plane([0, 1, 0], -1.3)
    return arrays_of(whole + (beside.trim_by_plane([0, 1, 0], 1.2)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [noisy, folded, with_flipped_patch, with_sheet_twice, with_open_end, with_islands, with_a_fin, with_thin_wall],
)
def test_a_scan_with_a_fault_of_its_program_is_a_volume_that_does_not_cross_itself(cave, fault, tmp_path):
    vertices, faces = fault(*cave, np.random.default_rng(0))
    path = tmp_path / "cave.ply"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    params = SolidSurveyParams.model_construct(**PARAMS, file=path.as_posix())
    read = read_solid(params, is_stated=False).solid
    assert len(crossing_facets(read.vertices, read.faces.astype(int), CROSSING_M)) == 0  # what stages and judges see
    found = volume_of_solid(read, STEEPEST)
    assert len(crossing_facets(found.vertices, found.faces, CROSSING_M)) == 0
    solid = manifold_of(found.vertices, found.faces)
    assert solid.status() == manifold3d.Error.NoError
    wanted = manifold_of(*with_thin_wall(*cave, None)) if fault is with_thin_wall else manifold_of(*cave)
    assert solid.volume() == pytest.approx(wanted.volume(), rel=0.03)
    if fault is not with_thin_wall:
        points = trimesh.sample.sample_surface(trimesh.Trimesh(*cave, process=False), 5000, seed=0)[0] - [
            0,
            0,
            read.datum_m,
        ]
        points = points[points[:, 0] < 6.7]  # an open end is closed before it
        assert (distances(points, found.vertices, found.faces) < 0.1).mean() > 0.97
