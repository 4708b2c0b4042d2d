"""What tests of drawings share."""

import pytest


@pytest.fixture
def data(tmp_path, monkeypatch):
    """Return the folder data/ of an empty project."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data/registry.txt").write_text("")
    return tmp_path / "data"
