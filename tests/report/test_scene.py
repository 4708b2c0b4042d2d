"""The view in three dimensions on the report's page."""

import numpy as np

from pipeline.mjcf.bundle import open_bundle
from pipeline.report import scene


def test_the_mine_lies_about_the_origin_that_the_browsers_lights_shine_on(tee, monkeypatch):
    monkeypatch.setattr(scene, "scene_to_html", lambda made: made)
    made = scene.scene_page(tee.bundle, open_bundle(tee.bundle).record, tee.free_space)
    assert len(made.geometry) >= 2
    assert np.abs(made.bounds.mean(axis=0)[[0, 2]]).max() < 0.5  # browsers have y up
    assert made.extents[0] > 80
