"""The 3D view in the report."""

import base64
import gzip
import io
import json
import re

import numpy as np
import pytest
import shapely
import trimesh

from minexplore.bundle import ROOF, WALLS
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import open_bundle
from pipeline.report.figures import scene


@pytest.fixture(scope="module")
def drawn(tee):
    return scene.mine_scene(tee.bundle, open_bundle(tee.bundle).record, tee.free_space)


def test_the_mine_is_centred_on_the_origin_where_the_lights_point(drawn):
    assert {WALLS, ROOF} < set(drawn.geometry)
    assert np.abs(drawn.bounds.mean(axis=0)[[0, 2]]).max() < 0.5  # browsers have y up
    assert drawn.extents[0] > 80


def test_the_camera_sees_the_whole_mine_in_a_frame_twice_as_wide_as_high(drawn):
    corners = trimesh.bounds.corners(drawn.bounds)
    seen = trimesh.transform_points(corners, np.linalg.inv(drawn.camera_transform))
    assert (seen[:, 2] < 0).all()  # a camera looks along -z
    up = np.tan(np.radians(drawn.camera.fov[1] / 2))
    assert (np.abs(seen[:, 1] / seen[:, 2]) < up).all()
    assert (np.abs(seen[:, 0] / seen[:, 2]) < 2 * up).all()
    middle = trimesh.transform_points([[0, 0, 0]], np.linalg.inv(drawn.camera_transform))[0]
    assert middle[:2] == pytest.approx([0, 0], abs=1e-6)  # the browser's controls turn about it


def test_rock_has_no_more_faces_than_the_page_may_hold_even_where_its_borders_alone_have_more(drawn, tee, monkeypatch):
    assert len(drawn.geometry[WALLS].faces) > 2000
    monkeypatch.setattr(scene, "MOST_FACES", {WALLS: 400, ROOF: 400})
    small = scene.mine_scene(tee.bundle, open_bundle(tee.bundle).record, tee.free_space)
    assert max(len(small.geometry[piece].faces) for piece in (WALLS, ROOF)) <= 400
    assert np.abs(small.extents - drawn.extents).max() < 1.0


def test_the_meshes_are_compressed_in_the_page_and_4_mm_from_their_places_at_most(drawn):
    before = np.concatenate([mesh.triangles_center for mesh in drawn.geometry.values()])
    page = scene.walked_page(drawn.copy(), np.zeros((2, 3)))
    packed = base64.b64decode(re.search(r'base64_data="([^"]*)"', page)[1])
    back = trimesh.load(io.BytesIO(gzip.decompress(packed)), file_type="glb")
    after = np.concatenate([back.geometry[name].triangles_center for name in drawn.geometry])
    assert np.abs(before - after).max() <= 0.004
    assert 2 * len(packed) < sum(mesh.faces.nbytes / 2 + mesh.vertices.nbytes / 2 for mesh in drawn.geometry.values())


def test_the_headlamp_walks_along_the_main_drift_inside_the_workings(tee):
    page = scene.scene_page(tee.bundle, open_bundle(tee.bundle).record, tee.free_space, tee.network)
    assert page.index("base64_data=") < page.index('id="headlamp"') < page.index("</body>")
    places = np.array(json.loads(re.search(r"DRIFT = (\[\[.*\]\]);", page).group(1)))
    free = tee.free_space.polygon
    west, south, east, north = free.bounds
    back = np.column_stack([places[:, 0] + (west + east) / 2, (south + north) / 2 - places[:, 2]])
    assert shapely.contains_xy(free, *back.T).all()
    assert np.linalg.norm(np.diff(back, axis=0), axis=1) == pytest.approx(1.0, abs=0.2)
    assert len(back) == pytest.approx(tee.network.main_drift_length_m, abs=3)


def test_a_viewer_whose_template_has_changed_is_named(tee, monkeypatch):
    monkeypatch.setattr(scene, "scene_to_html", lambda _: "<html></html>")
    with pytest.raises(ArtifactError, match="its template has changed"):
        scene.scene_page(tee.bundle, open_bundle(tee.bundle).record, tee.free_space, tee.network)
