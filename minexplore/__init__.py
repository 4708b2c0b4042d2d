"""Gymnasium environments in worlds compiled from real mine surveys; reads a world bundle and nothing else."""

from gymnasium.envs.registration import register

__version__ = "0.2.0"

_ENV, _VECTOR = "minexplore.env:MineEnv", "minexplore.vector:MineVectorEnv"

# id -> what the task changes. A short horizon at the entrance is what two cores can train on in an hour.
WORLDS: dict[str, dict] = {
    "MineXplore/World-v0": {},
    "MineXplore/ChileanMine-v0": {"world": "chilean_mine"},
    "MineXplore/ChileanMineFlatDry-v0": {"world": "chilean_mine", "task": {"terrain": False, "tilt": False}},
    "MineXplore/ChileanMineEntrance-v0": {"world": "chilean_mine", "task": {"region_m": 60.0, "max_steps": 1500}},
}

for _id, _kwargs in WORLDS.items():
    register(_id, _ENV, vector_entry_point=_VECTOR, kwargs=_kwargs, order_enforce=True)
