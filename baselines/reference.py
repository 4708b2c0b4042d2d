"""What an environment itself gives, to check results against: starts of its seeds, rock, and what is in sight."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import gymnasium
import numpy as np

from baselines.environments import known_ids, make_env
from baselines.errors import BaselineError
from baselines.protocol import seeds_of
from baselines.rock import Rock
from baselines.sight import Sight
from minexplore.vector import MineVectorEnv


@dataclass(frozen=True)
class Reference:
    """An environment, where each of the protocol's seeds starts (n, 2) cm, and the cells that it sees there (n,)."""

    env: MineVectorEnv
    starts_cm: np.ndarray
    first_seen: np.ndarray
    rock: Rock
    sight: Sight


def reference_of(env_id: str) -> Reference:
    """Return what an environment gives; it is computed once a process.

    Raises
    ------
    BaselineError
        If there is no environment of exactly this id, or its world is missing or damaged.
    """
    if env_id not in known_ids():  # a short name would miss the bound, and have a table of its own
        raise BaselineError(f"env = {env_id!r}: valid choices are {', '.join(known_ids())}")
    return _compute(env_id, repr(sorted(gymnasium.spec(env_id).kwargs.items())))


@functools.lru_cache(maxsize=4)
def _compute(env_id: str, arguments: str) -> Reference:
    """Compute what an environment gives; `arguments` tells apart what was registered again by the same id."""
    seeds = list(seeds_of(env_id))
    env = make_env(env_id, len(seeds))
    if not env.world.floor.is_flat:
        raise BaselineError(f"{env_id}: its mine has heights; results are checked in the plan of level mines only")
    _, info = env.reset(seed=seeds)
    starts = np.rint(100 * info["pose_m_rad"][:, :2]).astype(int)
    rock = Rock(env.robots.local_models, env.robot.radius_m)
    sight = Sight(env.world, env.robots.grid, env.task.range_m[1])
    return Reference(env, starts, info["cells_seen"].copy(), rock, sight)
