"""What Gymnasium's own checker and wrappers of vectors make of the environments."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers.vector import FlattenObservation, NormalizeObservation

from tests.mines import BuiltMine

ID = "MineXplore/World-v0"


def test_gymnasiums_checker_draws_in_all_modes_that_there_are_without_a_display(tee: BuiltMine, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    made = gymnasium.make(ID, world=str(tee.bundle), render_mode="rgb_array")
    assert made.unwrapped.metadata["render_modes"] == ["rgb_array"]
    assert (made.observation_space.shape, made.action_space.shape) == ((19,), (2,))
    check_env(made.unwrapped)
    made.close()


@pytest.mark.parametrize("wrapper", [NormalizeObservation, FlattenObservation])
def test_wrappers_of_observations_take_the_default_mode_and_refuse_the_same_step(tee: BuiltMine, wrapper):
    given = {"world": str(tee.bundle), "max_episode_steps": 3}
    wrapped = wrapper(gymnasium.make_vec(ID, 2, **given))
    wrapped.reset(seed=0)
    for _ in range(5):
        assert np.isfinite(wrapped.step(np.zeros((2, 2), np.float32))[0]).all()
    wrapped.close()
    with pytest.raises((AssertionError, ValueError)):
        wrapper(gymnasium.make_vec(ID, 2, autoreset_mode="SAME_STEP", **given))
