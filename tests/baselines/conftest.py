from collections.abc import Iterator

import gymnasium
import pytest

from tests.mines import BuiltMine

TEE_ID = "MineXplore/Tee-v0"


@pytest.fixture(scope="module")
def tee_id(tee: BuiltMine) -> Iterator[str]:
    """Return the id of a short task in the T-junction's world."""
    gymnasium.register(
        TEE_ID,
        "minexplore.env:MineEnv",
        vector_entry_point="minexplore.vector:MineVectorEnv",
        kwargs={"world": str(tee.bundle), "task": {"max_steps": 1000, "terrain": False}},
    )
    yield TEE_ID
    del gymnasium.registry[TEE_ID]
