"""Volumes that several modules drive in."""

from pathlib import Path

import pytest

from tests.volumes import BOX, OVER, RAMP, build_volume


@pytest.fixture(scope="session")
def box(tmp_path_factory) -> Path:
    """A drift of 20 m, 4 m wide."""
    return build_volume(BOX, tmp_path_factory.mktemp("box"))


@pytest.fixture(scope="session")
def ramp(tmp_path_factory) -> Path:
    """A drift with a ramp of 15 % in its middle third."""
    return build_volume(RAMP, tmp_path_factory.mktemp("ramp"))


@pytest.fixture(scope="session")
def over(tmp_path_factory) -> Path:
    """A drift over another, 8 m apart, and the ramp that joins them."""
    return build_volume(OVER, tmp_path_factory.mktemp("over"))
