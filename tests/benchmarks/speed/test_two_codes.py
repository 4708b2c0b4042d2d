"""Two codes are compared turn by turn, and one code by parts."""

import json
import subprocess
import sys

from benchmarks.speed.two_codes import _PARTS, rows
from tests.project import ROOT

PRINT = "import json, sys; from benchmarks.speed.two_codes import parts; print(json.dumps(parts(sys.argv[1], 1)))"


def test_every_part_of_a_step_takes_some_time(small_world):
    done = subprocess.run(
        [sys.executable, "-c", PRINT, small_world], cwd=ROOT, capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    assert list(found) == list(_PARTS)
    assert min(found.values()) > 0


def test_a_row_has_the_medians_of_both_codes_and_the_median_of_the_ratios_of_their_turns():
    figures = ("one robot", "64 robots at the entrance", "64 robots spread", "import, make, reset")
    before = [dict.fromkeys(figures, value) for value in (1000.0, 2000.0, 500.0)]
    after = [dict.fromkeys(figures, value) for value in (1500.0, 4000.0, 400.0)]
    found = rows(before, after)
    assert found[0] == ("one robot, steps/s", "1,000", "1,500", "1.50")
    assert found[3] == ("import, make, reset, s", "1,000.00", "1,500.00", "1.50")
