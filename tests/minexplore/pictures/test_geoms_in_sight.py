"""A frame without what is out of sight is the frame with all of it."""

import numpy as np
import pytest

from minexplore.envs.env import MineEnv
from minexplore.pictures import render
from tests.mines import BuiltMine


@pytest.fixture(autouse=True)
def osmesa(monkeypatch):
    """Let this process draw as OSMesa does, whatever draws it."""
    monkeypatch.setenv("MUJOCO_GL", "osmesa")


@pytest.mark.parametrize("camera", ["chase", "front"])
def test_a_frame_of_what_is_in_sight_is_that_of_all_and_holds_fewer_geoms(ring: BuiltMine, monkeypatch, camera):
    env = MineEnv(ring.bundle, render_mode="rgb_array", camera=camera)
    env.reset(seed=0)
    for _ in range(3):
        for _ in range(8):
            env.step(np.array([0.7, 0.3]))
        shown, scene = env.render(), env._drawing()._renderer.scene
        few = scene.ngeom
        with monkeypatch.context() as patch:
            patch.setattr(render, "draw_seen", lambda renderer, update: update())
            whole = env.render()
        assert few < scene.ngeom
        apart = np.abs(shown.astype(int) - whole).max(axis=2)
        assert (apart > 0).mean() < 1e-4
    env.close()
