from collections.abc import Iterator

import pytest

import minexplore
from tests.mines import BuiltMine

TEE_ID = "MineXplore/Tee-v0"


@pytest.fixture(scope="module")
def tee_id(tee: BuiltMine) -> Iterator[str]:
    """Return the id of a short task in the T-junction's world."""
    minexplore.WORLDS[TEE_ID] = {"world": str(tee.bundle), "task": {"max_steps": 1000, "terrain": False}}
    yield TEE_ID
    del minexplore.WORLDS[TEE_ID]
