"""Fixtures: the small world, opened and as a scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.params.config import Config
from tests.export.exported import ExportedWorld
from tests.fixtures import share_mine
from tests.mines import TEE, BuiltMine


@pytest.fixture(scope="session")
def world(small_world: Path) -> ExportedWorld:
    """Return the ring with visible rock; tests must not change its folder."""
    return ExportedWorld.at(small_world)


@pytest.fixture(scope="session")
def bare(light: Config, tmp_path_factory: pytest.TempPathFactory) -> ExportedWorld:
    """Return the T-junction without visible rock; tests must not change its folder."""
    mine = share_mine(tmp_path_factory, "bare", lambda folder: BuiltMine(TEE, light, folder / "world"))
    return ExportedWorld.at(mine.bundle, "validation.tolerance_m=0.25")
