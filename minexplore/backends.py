"""Which of the vector environments `gymnasium.make_vec` makes: the CPU's, or that on a device."""

from __future__ import annotations

from typing import Any

from gymnasium.vector import VectorEnv

from minexplore.envs.vector import MineVectorEnv


def make_vector_env(num_envs: int = 1, backend: str = "mujoco", **kwargs: Any) -> VectorEnv:
    """Return `MineVectorEnv`, which steps robots on the CPU, or with `backend="warp"` `MineWarpEnv`, on a `device`.

    Raises
    ------
    ValueError
        If there is no such backend.
    ImportError
        If what Warp needs is not installed; the message says what to install.
    """
    if backend == "mujoco":
        return MineVectorEnv(num_envs, **kwargs)
    if backend != "warp":
        raise ValueError(f"backend = {backend!r}: valid choices are mujoco, warp")
    if kwargs.pop("goal", None) is not None:
        raise ValueError("goal: backend = 'warp' has exploration alone; want backend='mujoco'")
    from minexplore.extra.warp import require_packages

    require_packages()
    from minexplore.extra.warp.env import MineWarpEnv

    return MineWarpEnv(num_envs, **kwargs)
