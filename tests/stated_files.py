"""Files beside the project that state something beside their coordinates."""

import pytest

from tests.project import ROOT

_FOLDER = ROOT.parent / "shared/data/turn4"


def shared_file(name):
    """Return the path of a shared file; without it the test is skipped."""
    if not (_FOLDER / name).exists():
        pytest.skip(f"../shared/data/turn4/{name} is missing")
    return _FOLDER / name
