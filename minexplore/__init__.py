"""Gymnasium environments in worlds compiled from real mine surveys; reads a world bundle and nothing else."""

import re
from pathlib import Path

from gymnasium.envs.registration import register

from minexplore.bundle import RECORD

__version__ = "0.2.0"

_ENV, _VECTOR = "minexplore.env:MineEnv", "minexplore.vector:MineVectorEnv"

# id -> what the task changes. A short horizon at the entrance is what two cores can train on in an hour.
WORLDS: dict[str, dict] = {
    "MineXplore/World-v0": {},
    "MineXplore/ChileanMine-v0": {"world": "chilean_mine"},
    "MineXplore/ChileanMineFlatDry-v0": {"world": "chilean_mine", "task": {"terrain": False, "tilt": False}},
    "MineXplore/ChileanMineEntrance-v0": {"world": "chilean_mine", "task": {"region_m": 60.0, "max_steps": 1500}},
}

# A source checkout's own worlds, made by `python -m pipeline new NAME`, are MineXplore/NAME-v0.
BUILT: dict[str, dict] = {
    f"MineXplore/{_record.parents[2].name}-v0": {"world": _record.parent}
    for _record in sorted(Path(__file__).parents[1].glob(f"artifacts/worlds/*/realism/world/{RECORD}"))
    if re.fullmatch(r"[A-Za-z0-9_-]+", _record.parents[2].name)
}

for _id, _kwargs in {**BUILT, **WORLDS}.items():
    register(_id, _ENV, vector_entry_point=_VECTOR, kwargs=_kwargs, order_enforce=True)
