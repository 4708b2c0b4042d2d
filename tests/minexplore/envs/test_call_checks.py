"""What callers hand over is checked without loading what they do not use."""

import subprocess
import sys


def test_actions_and_seeds_are_checked_without_loading_masked_arrays():
    code = (
        "import sys; from minexplore.envs.call_checks import numbers_of, spread_seeds; "
        "numbers_of([0.5, 0.1]); spread_seeds([1, 2], 2); print('numpy.ma' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
