"""How long a world takes to load, measured in a process of its own."""

import time

import pytest

from pipeline.errors import ArtifactError
from pipeline.mjcf.load_time import measure_load


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
