from collections.abc import Iterator
from typing import Any

import gymnasium
import pytest

from tests.mines import BuiltMine

TEE_ID, SHORT_ID = "MineXplore/Tee-v0", "MineXplore/ShortTee-v0"


def register(env_id: str, tee: BuiltMine, task: dict[str, Any]) -> None:
    gymnasium.register(
        env_id,
        "minexplore.env:MineEnv",
        vector_entry_point="minexplore.vector:MineVectorEnv",
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
