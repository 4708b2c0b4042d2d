"""Tests of visible meshes that are compiled a few at a time, and of the choice of those in sight."""

import mujoco
import numpy as np
import pytest
import shapely

from minexplore.bundle import ENTRANCE_CAMERA, MODEL, GeomGroup, fitting_geom, surface_geom
from pipeline.errors import ArtifactError
from pipeline.mjcf import visible
from pipeline.mjcf.bundle import open_bundle
from pipeline.mjcf.loading import load_model, read_spec
from pipeline.mjcf.render import render_camera
from pipeline.mjcf.visible import VisibleMesh, compile_visible, compile_with, in_sight

ELL = shapely.union(shapely.box(0, 0, 60, 4), shapely.box(56, 0, 60, 60))


def tile(west: float, south: float) -> VisibleMesh:
    """Return a mesh over a square of 4 m."""
    corners = np.array([[west, south, 0], [west + 4, south, 0], [west, south + 4, 3]], np.float32)
    return VisibleMesh(GeomGroup.ROUGH_SURFACE, corners, np.array([[0, 1, 2]], np.int32), np.eye(3), np.zeros(3))


@pytest.mark.parametrize("at_once", [7, 1000])
def test_meshes_compiled_a_few_at_a_time_are_those_of_the_whole_model(tee, monkeypatch, at_once):
    monkeypatch.setattr(visible, "_AT_ONCE", at_once)
    found, model = compile_visible(read_spec(tee.bundle / MODEL), tee.bundle / MODEL), load_model(tee.bundle / MODEL)
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    assert list(found) == [name for name in names if name in found]
    assert {name for name in names if name.startswith((surface_geom(""), fitting_geom("")))} == set(found)
    assert len(found) > 14
    for name, mesh in found.items():
        geom, number = model.geom(name), model.geom(name).dataid[0]
        first, start = model.mesh_faceadr[number], model.mesh_vertadr[number]
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, geom.quat)
        assert (mesh.corners == model.mesh_vert[start : start + model.mesh_vertnum[number]]).all()
        assert (mesh.faces == model.mesh_face[first : first + model.mesh_facenum[number]]).all()
        assert (mesh.rotation.ravel() == rotation).all()
        assert (mesh.place_m == geom.pos).all()
        assert mesh.group == geom.group[0]


def test_an_opened_model_has_all_that_is_touched_and_small_meshes_for_what_is_seen(tee):
    opened, whole = open_bundle(tee.bundle), load_model(tee.bundle / MODEL)
    assert opened.model.ngeom == whole.ngeom
    assert opened.model.nmeshface < whole.nmeshface / 10
    touched = np.flatnonzero(whole.geom_contype | whole.geom_conaffinity)
    for field in ("geom_type", "geom_pos", "geom_quat", "geom_size", "geom_aabb", "geom_group", "geom_friction"):
        assert (getattr(opened.model, field)[touched] == getattr(whole, field)[touched]).all(), field


def test_a_picture_of_what_is_in_sight_is_the_picture_of_all(tee):
    opened, path = open_bundle(tee.bundle), tee.bundle / MODEL
    shown = in_sight(opened.visible, tee.free_space.polygon, [np.array(opened.record.spawn.anchor_m)])
    groups = (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE)
    some, whole, none = (
        render_camera(model, ENTRANCE_CAMERA, 320, 180, groups)
        for model in (compile_with(read_spec(path), path, shown), load_model(path), opened.model)
    )
    assert (some == whole).all()
    assert (none != whole).any()


def test_what_is_round_a_corner_is_not_in_sight():
    meshes = {"here": tile(0, 0), "ahead": tile(50, 0), "corner": tile(57, 8), "hidden": tile(56, 50)}
    assert in_sight(meshes, ELL, [np.array([2.0, 2.0])]) == {"here", "ahead", "corner"}
    assert in_sight(meshes, ELL, [np.array([58.0, 58.0])]) == {"ahead", "corner", "hidden"}
    assert in_sight(meshes, ELL, [np.array([2.0, 2.0]), np.array([58.0, 58.0])]) == set(meshes)


def test_a_mesh_that_mujoco_refuses_is_refused_with_the_models_file(tee, tmp_path):
    spec = read_spec(tee.bundle / MODEL)
    spec.meshes[-1].file = "meshes/nowhere.msh"
    with pytest.raises(ArtifactError, match=r"mine\.xml: MuJoCo does not compile it: .*nowhere"):
        compile_visible(spec, tee.bundle / MODEL)
