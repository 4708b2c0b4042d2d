import pytest

import minexplore
from tests.conftest import BuiltMine

TEE_ID = "MineXplore/Tee-v0"


@pytest.fixture
def tee_id(tee: BuiltMine, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the id of a short task in the T-junction's world."""
    monkeypatch.setitem(
        minexplore.WORLDS, TEE_ID, {"world": str(tee.bundle), "task": {"max_steps": 1000, "terrain": False}}
    )
    return TEE_ID
