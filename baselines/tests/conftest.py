from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest

import minexplore
from baselines import split
from baselines.base import result_file
from baselines.running import parallel
from baselines.scoring import split_file
from baselines.scoring.split_file import mine_id
from tests.mines import BuiltMine

TEE_ID, SHORT_ID = "MineXplore/Tee-v0", "MineXplore/ShortTee-v0"


def register(env_id: str, tee: BuiltMine, task: dict[str, Any]) -> None:
    gymnasium.register(
        env_id,
        "minexplore.envs.env:MineEnv",
        vector_entry_point="minexplore.envs.vector:MineVectorEnv",
        kwargs={"world": str(tee.bundle), "task": {"terrain": False, **task}},
    )


@pytest.fixture(scope="module")
def tee_id(tee: BuiltMine) -> Iterator[str]:
    """Return the id of a short task in the T-junction's world."""
    register(TEE_ID, tee, {"max_steps": 1000})
    yield TEE_ID
    del gymnasium.registry[TEE_ID]


@pytest.fixture(scope="module")
def short_id(tee: BuiltMine) -> Iterator[str]:
    """Return the id of a task that is short enough to drive all seeds of the protocol."""
    register(SHORT_ID, tee, {"max_steps": 240, "stall_steps": 50})
    yield SHORT_ID
    del gymnasium.registry[SHORT_ID]


@pytest.fixture(autouse=True)
def pieces_of_this_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the results of pieces in a folder of the test."""
    for module in (split, parallel):
        monkeypatch.setattr(module, "KEPT", str(tmp_path / "pieces"))


@pytest.fixture
def mines(tee: BuiltMine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Register a test split of two mines, whose results are kept in a folder of the test."""
    ids = [mine_id("test", number) for number in range(2)]
    kwargs = {"world": str(tee.bundle), "task": {"terrain": False, "max_steps": 200, "stall_steps": 50}}
    monkeypatch.setattr(minexplore, "FAMILY_MINES", dict.fromkeys(ids, kwargs))
    built = {env_id: gymnasium.registry.pop(env_id) for env_id in ids if env_id in gymnasium.registry}
    for env_id in ids:
        gymnasium.register(
            env_id,
            "minexplore.envs.env:MineEnv",
            vector_entry_point="minexplore.envs.vector:MineVectorEnv",
            kwargs=kwargs,
        )
    for module in (split, split_file):
        monkeypatch.setattr(module, "SIZES", {"test": 2})
    for module in (split, split_file, result_file):
        monkeypatch.setattr(module, "RESULTS", tmp_path)
    monkeypatch.setattr("baselines.scoring.bounds.BOUNDS", tmp_path / "bounds.json")
    # The two mines are of two styles, so that all samples of a bootstrap are the same; 2000 of them take seconds.
    monkeypatch.setattr("baselines.scoring.split_statistics._RESAMPLES", 100)
    yield ids
    for env_id in ids:
        del gymnasium.registry[env_id]
    gymnasium.registry.update(built)
