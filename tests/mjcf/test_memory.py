"""Memory that was freed goes back to the system."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.memory import give_back


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


@pytest.mark.skipif(sys.platform != "linux", reason="only glibc keeps what was freed")
def test_what_was_freed_below_a_later_array_goes_back():
    arrays = [np.ones(8_000) for _ in range(2_000)]  # 128 MB in pieces that the C library keeps in its heap
    last = np.ones(8_000)
    del arrays
    before = resident_mb()
    give_back()
    assert resident_mb() < before - 50
    assert last[-1] == 1
