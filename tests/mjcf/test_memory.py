"""Memory that was freed stays for the next array, and goes back to the system where it is given back."""

import subprocess
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


@pytest.mark.skipif(sys.platform != "linux", reason="only glibc can be told")
@pytest.mark.parametrize("module", ["pipeline", "stages.survey"])
def test_a_command_keeps_the_memory_of_arrays_that_come_and_go(module):
    """Forty arrays of 40 MB have 400,000 pages; kept, the system clears those of a few arrays only."""
    program = (
        "import gc, resource, runpy, sys\n"
        f"sys.argv = [{module!r}, '--no-such-option=1']\n"
        "try:\n"
        f"    runpy.run_module({module!r}, run_name='__main__')\n"
        "except SystemExit:\n"
        "    pass\n"
        "import numpy as np\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "for _ in range(40):\n"
        "    np.ones(5_000_000)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before, gc.get_threshold()[0])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    faults, objects = map(int, done.stdout.split()[-2:])
    assert faults < 100_000
    assert objects > 10_000


def test_a_command_ends_without_a_search_of_all_objects():
    code = (
        "import atexit, gc\n"
        "atexit.register(lambda: print(gc.get_freeze_count() > 10_000, len(gc.get_objects()) < 1_000))\n"
        "from pipeline.memory import keep_memory\n"
        "keep_memory()\n"
        "import numpy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True True\n"
