"""Time and memory to load a world, measured in a separate process."""

import mujoco
import numpy as np
import pytest

from pipeline.errors import ArtifactError
from pipeline.mjcf.load_time import measure_load
from pipeline.mjcf.loading import load_model

TEXELS = 4096**2  # of the model below: three bytes each, once in the specification and once in the model
TEXTURED = '<mujoco><asset><texture type="2d" name="a" builtin="flat" width="4096" height="4096"/></asset></mujoco>'


def test_the_first_load_and_the_best_later_one_are_timed(tee):
    cost = measure_load(tee.bundle / "mine.xml")
    assert cost.first_load_s > 0
    assert cost.load_s > 0


def test_an_error_names_the_model_that_mujoco_refuses(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text("<mujoco><nothing/></mujoco>")
    with pytest.raises(ArtifactError, match=r"mine\.xml: a separate process cannot load it: [^/]*nothing"):
        measure_load(path)


def test_load_memory_does_not_depend_on_the_callers_memory(tmp_path):
    path = tmp_path / "textured.xml"
    path.write_text(TEXTURED)
    held = np.ones(400_000_000, np.uint8)  # a child's ru_maxrss would start at this size
    cost = measure_load(path)
    assert held[-1] == 1
    assert 2 * 3 * TEXELS / 1e6 <= cost.load_memory_mb <= 4 * 3 * TEXELS / 1e6


def test_after_a_load_only_the_model_stays_in_memory(tee):
    cache = mujoco.mj_getCache()
    mujoco.mj_clearCache(cache)
    capacity = mujoco.mj_getCacheCapacity(cache)
    model = load_model(tee.bundle / "mine.xml")
    assert model.nmesh > 0
    assert mujoco.mj_getCacheSize(cache) == 0
    assert mujoco.mj_getCacheCapacity(cache) == capacity > 0


def test_a_refused_model_leaves_the_cache_as_it_was(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text("<mujoco><nothing/></mujoco>")
    capacity = mujoco.mj_getCacheCapacity(mujoco.mj_getCache())
    with pytest.raises(ArtifactError, match="nothing"):
        load_model(path)
    assert mujoco.mj_getCacheCapacity(mujoco.mj_getCache()) == capacity
