import shutil

import mujoco
import numpy as np
import pytest

from minexplore.bundle import (
    FITTINGS_BODY,
    GEOM_GROUPS,
    MINE_BODY,
    MODEL,
    PREVIEW,
    ROOF,
    ROOF_GEOM,
    SURFACE_BODY,
    WALLS,
    BundleError,
    GeomGroup,
    TriangleMesh,
    chunk_mesh,
    decode_msh,
    encode_msh,
    fitting_geom,
    floor_geom,
    is_fitting,
    is_floor,
    is_rock,
    mesh_file,
    rock_geom,
    smooth_mesh,
    surface_geom,
)
from minexplore.world import checked_world, load_world
from tests.mines import BuiltMine

TETRAHEDRON = TriangleMesh(
    vertices=np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32),
    faces=np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32),
    texcoords=np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=np.float32),
    normals=np.full((4, 3), 3**-0.5, dtype=np.float32),
)


def without(mesh, *names):
    """Return a mesh without texture coordinates or normals."""
    empty = {"texcoords": np.zeros((0, 2), np.float32), "normals": np.zeros((0, 3), np.float32)}
    return TriangleMesh(**{**vars(mesh), **{name: empty[name] for name in names}})


@pytest.mark.parametrize("absent", [(), ("normals",), ("texcoords",), ("normals", "texcoords")])
def test_a_mesh_is_read_back_as_it_was_written(absent):
    mesh = without(TETRAHEDRON, *absent)
    for name, array in vars(decode_msh(encode_msh(mesh))).items():
        np.testing.assert_array_equal(array, getattr(mesh, name))


def test_mujoco_reads_the_vertices_normals_and_coordinates_that_were_written():
    xml = """<mujoco><asset><mesh name="m" file="m.msh" inertia="shell"/></asset>
             <worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml, {"m.msh": encode_msh(TETRAHEDRON)})
    np.testing.assert_array_equal(model.mesh_face, TETRAHEDRON.faces)
    np.testing.assert_array_equal(model.mesh_texcoord[:, 0], TETRAHEDRON.texcoords[:, 0])
    edges = np.linalg.norm(model.mesh_vert[[1, 2, 3]] - model.mesh_vert[0], axis=1)
    assert edges == pytest.approx(1.0, abs=1e-6)
    assert model.mesh_normal @ model.mesh_normal[0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("data", [b"", b"MSH", encode_msh(TETRAHEDRON)[:-1], np.array([-1, 0, 0, 1], "<i4").tobytes()])
def test_a_mesh_whose_counts_do_not_match_its_size_is_refused(data):
    with pytest.raises(ValueError, match=r"counts .* do not match its size"):
        decode_msh(data)


def test_a_built_world_holds_the_contract_s_groups_and_names(tee: BuiltMine):
    world = load_world(tee.bundle)
    assert world.record["geom_groups"] == GEOM_GROUPS
    model = mujoco.MjModel.from_xml_path(str(tee.bundle / MODEL))
    names = {model.geom(g).name: int(model.geom_group[g]) for g in range(model.ngeom)}
    assert {n for n, group in names.items() if group == GeomGroup.FLOOR} == {
        floor_geom(zone["name"]) for zone in world.record["zones"]
    }
    assert {n for n, group in names.items() if group == GeomGroup.COLLISION} == {
        rock_geom(i) for i in range(world.record["collision_parts"])
    }
    assert [n for n, group in names.items() if group == GeomGroup.ROOF] == [ROOF_GEOM]
    assert {n for n in names if is_floor(n)} == {n for n, group in names.items() if group == GeomGroup.FLOOR}
    assert {n for n in names if is_rock(n)} == {n for n, group in names.items() if group == GeomGroup.COLLISION}
    assert names[surface_geom(smooth_mesh(WALLS))] == names[surface_geom(smooth_mesh(ROOF))] == GeomGroup.SMOOTH_SURFACE
    assert {model.body(b).name for b in range(1, model.nbody)} == {MINE_BODY, SURFACE_BODY, FITTINGS_BODY}


def test_every_visible_mesh_has_the_contract_s_file_and_geom(tee: BuiltMine):
    spec = load_world(tee.bundle).spec()
    for mesh in spec.meshes:
        if mesh.file:
            assert mesh.file == mesh_file(mesh.name)
            assert (tee.bundle / mesh.file).is_file()
            geom = fitting_geom(mesh.name) if is_fitting(mesh.name) else surface_geom(mesh.name)
            assert spec.geom(geom).meshname == mesh.name
    assert any(mesh.name == chunk_mesh(WALLS, 0, 0) for mesh in spec.meshes)


def test_a_world_that_was_checked_is_found_again_without_reading_its_files(tee, tmp_path):
    folder = tmp_path / "world"
    shutil.copytree(tee.bundle, folder)
    world = load_world(folder)
    (folder / PREVIEW).unlink()
    assert checked_world(folder, world.record["world_sha256"]) is world
    with pytest.raises(BundleError, match=PREVIEW):
        checked_world(folder, "0" * 64)
