"""What loading a world costs, measured in a process of its own."""

import time

import mujoco
import numpy as np
import pytest

from pipeline.errors import ArtifactError
from pipeline.mjcf.load_time import measure_load
from pipeline.mjcf.loading import load_model

TEXELS = 4096**2  # of the model below: three bytes each, in the specification and in the model
TEXTURED = '<mujoco><asset><texture type="2d" name="a" builtin="flat" width="4096" height="4096"/></asset></mujoco>'


def test_the_first_load_and_the_best_later_one_are_timed(tee):
    start = time.perf_counter()
    found = measure_load(tee.bundle / "mine.xml")
    took = time.perf_counter() - start
    assert found.first_load_s > 0
    assert found.load_s > 0
    assert found.first_load_s + found.load_s < took


def test_a_model_that_mujoco_refuses_is_named(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text("<mujoco><nothing/></mujoco>")
    with pytest.raises(ArtifactError, match=r"mine\.xml: a process of its own does not load it: [^/]*nothing"):
        measure_load(path)


def test_load_memory_is_that_of_the_load_whatever_the_caller_holds(tmp_path):
    path = tmp_path / "textured.xml"
    path.write_text(TEXTURED)
    held = np.ones(400_000_000, np.uint8)  # a child's ru_maxrss would begin here
    found = measure_load(path)
    assert held[-1] == 1
    assert 2 * 3 * TEXELS / 1e6 <= found.load_memory_mb <= 4 * 3 * TEXELS / 1e6


def test_the_pipeline_keeps_nothing_of_a_load_but_the_model(tee):
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
    with pytest.raises(ValueError, match="nothing"):
        load_model(path)
    assert mujoco.mj_getCacheCapacity(mujoco.mj_getCache()) == capacity
