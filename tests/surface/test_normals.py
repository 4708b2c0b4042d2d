"""Normals for shading: known directions, creases, and no seam between chunks."""

import mujoco
import numpy as np
import pytest
import trimesh

from minexplore.bundle import MODEL, ROOF, WALLS
from pipeline.mjcf.loading import load_model
from pipeline.store.codecs import decode
from pipeline.surface.mesh.normals import shade_mesh
from pipeline.types import Mesh
from tests.composed import compose
from tests.mines import TEE, BuiltMine


def face_normals(corners):
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def test_normals_of_a_sphere_point_away_from_its_centre():
    ball = trimesh.creation.icosphere(subdivisions=4)
    shaded = shade_mesh(np.array(ball.vertices), np.array(ball.faces))
    assert np.einsum("ni,ni->n", shaded.normals, ball.vertices).min() > np.cos(np.radians(0.5))
    np.testing.assert_array_equal(shaded.faces, ball.faces)


def test_a_smooth_cubes_corners_look_along_its_diagonals_however_its_sides_are_cut():
    cube = trimesh.creation.box(extents=(2, 2, 2))
    shaded = shade_mesh(np.array(cube.vertices), np.array(cube.faces))
    assert np.abs(shaded.normals - cube.vertices / np.sqrt(3)).max() < 1e-12  # weighted by area it would be off


def test_a_crease_keeps_each_side_of_a_cube_flat():
    cube = trimesh.creation.box(extents=(2, 2, 2))
    vertices, faces = np.array(cube.vertices), np.array(cube.faces)
    shaded = shade_mesh(vertices, faces, crease_deg=60)
    assert len(shaded.source) == 24
    np.testing.assert_array_equal(shaded.source[shaded.faces], faces)
    apart = shaded.normals[shaded.faces] - face_normals(vertices[faces])[:, None]
    assert np.abs(apart).max() < 1e-12


def test_a_vertex_of_a_face_without_area_has_a_normal_too():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    shaded = shade_mesh(vertices, np.array([[0, 1, 2], [0, 1, 3]]))
    np.testing.assert_allclose(np.linalg.norm(shaded.normals, axis=1), 1.0)


def test_no_normal_lies_behind_a_face_even_where_none_is_in_front_of_all():
    rng = np.random.default_rng(0)
    row, col = np.divmod(np.arange(400), 20)
    vertices = np.column_stack([row, col, rng.normal(0, 3, 400)]).astype(float)  # far rougher than any rock
    vertices[210, 2] = -90.0
    vertices[210, :2] += 4.0  # faces fold over: no direction is in front of all that meet here
    first = (row * 20 + col)[(row < 19) & (col < 19)]
    faces = np.concatenate(
        [np.column_stack([first, first + 20, first + 21]), np.column_stack([first, first + 21, first + 1])]
    )
    shaded = shade_mesh(vertices, faces)
    cosine = np.einsum("mki,mi->mk", shaded.normals[shaded.faces], face_normals(vertices[faces]))
    assert cosine.min() > 0
    assert len(shaded.source) > len(vertices)
    np.testing.assert_allclose(np.linalg.norm(shaded.normals, axis=1), 1.0)
    np.testing.assert_array_equal(shaded.source[shaded.faces], faces)


@pytest.fixture(scope="module")
def shaded(tmp_path_factory):
    """Return the T-junction's world with normals."""
    coarse = [f"surface.rough.{value}" for value in ("spacing_m=0.3", "roof_spacing_m=0.4", "normals=true")]
    config = compose([*coarse, "surface.texture.size_px=64", "realism.preview_width_px=64"])
    return BuiltMine(TEE, config, tmp_path_factory.mktemp("shaded"))


def test_chunks_of_a_built_world_meet_with_equal_normals(shaded):
    meshes = shaded.bundle / "meshes"
    chunks = [decode(path, Mesh) for name in (WALLS, ROOF) for path in sorted(meshes.glob(f"{name}_*.msh"))]
    seen: dict[bytes, set[bytes]] = {}
    shared = 0
    for chunk in chunks:
        cosine = np.einsum("mki,mi->mk", chunk.normals[chunk.faces], face_normals(chunk.vertices[chunk.faces]))
        assert cosine.min() > 0  # within a right angle of every face
        own: dict[bytes, set[bytes]] = {}
        for place, normal in zip(chunk.vertices, chunk.normals, strict=True):
            own.setdefault(place.tobytes(), set()).add(normal.tobytes())
        for place, normals in own.items():
            if len(normals) == 1 and len(seen.get(place, ())) == 1:
                shared += 1
                assert normals == seen[place]
            seen.setdefault(place, set()).update(normals)
    assert len(chunks) > 4
    assert shared > 500


def test_the_compiled_model_keeps_the_normals_that_were_written(shaded):
    model = load_model(shaded.bundle / MODEL)
    for path in sorted((shaded.bundle / "meshes").glob("walls_*.msh")):
        written = decode(path, Mesh).normals
        mesh = model.mesh(path.stem)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.mesh_quat[mesh.id])
        start, count = model.mesh_normaladr[mesh.id], model.mesh_normalnum[mesh.id]
        kept = model.mesh_normal[start : start + count] @ rotation.reshape(3, 3).T
        assert kept == pytest.approx(written, abs=1e-5)
