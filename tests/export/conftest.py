"""Fixtures: the small world, opened and as a scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.export.exported import ExportedWorld


@pytest.fixture(scope="session")
def world(small_world: Path) -> ExportedWorld:
    """Return the ring with visible rock; tests must not change its folder."""
    return ExportedWorld.at(small_world)
