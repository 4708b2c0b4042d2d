import numpy as np
import pytest

from minexplore.extra.warp.limits import overflow_message

LIMITS = {"naconmax": 768, "naccdmax": 256, "njmax": 54}


@pytest.mark.parametrize(
    ("bits", "message"),
    [
        ([0, 0, 0], None),
        ([8, 8, 8], r"naconmax = 768 (contacts of all robots together)"),
        ([4, 4, 4], r"naconmax = 768 (contacts of all robots together)"),
        ([16, 16, 16], r"naccdmax = 256 (pairs of convex geoms of all robots together)"),
        ([0, 1, 0], r"robot 1: MuJoCo Warp: njmax = 54 (rows of constraints of one robot)"),
        ([0, 0, 32], r"robot 2: MuJoCo Warp: a limit of the overflow bits 32"),
    ],
)
def test_a_limit_that_was_too_small_is_named_with_its_size_and_whose_it_is(bits, message):
    found = overflow_message(np.array(bits), LIMITS)
    if message is None:
        assert found is None
        return
    assert message in found
    assert ("no single robot is at fault" in found) == (bits[0] != 0)
