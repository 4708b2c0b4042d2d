"""The 3D view in the report."""

import numpy as np

from pipeline.mjcf.bundle import open_bundle
from pipeline.report import scene


def test_the_mine_is_centred_on_the_origin_where_the_lights_point(tee, monkeypatch):
    monkeypatch.setattr(scene, "scene_to_html", lambda trimesh_scene: trimesh_scene)
    page = scene.scene_page(tee.bundle, open_bundle(tee.bundle).record, tee.free_space)
    assert len(page.geometry) >= 2
    assert np.abs(page.bounds.mean(axis=0)[[0, 2]]).max() < 0.5  # browsers have y up
    assert page.extents[0] > 80
