"""Work on a stranger's files ends within its limits, and says in one line which one it reached."""

import os
import signal

import numpy as np
import pytest

from pipeline.commands.within_limits import within_limits
from pipeline.errors import ArtifactError, InputError

GB = 1_000_000_000


def refuse():
    raise ArtifactError("w/world.json: no")


def crash():
    os.kill(os.getpid(), signal.SIGTRAP)


def spin():
    while True:
        pass


def test_what_work_returns_and_what_it_refuses_comes_back():
    assert within_limits(lambda: {"a": np.arange(3).sum()}, "w", 4 * GB, 100) == {"a": 3}
    with pytest.raises(ArtifactError, match=r"^w/world\.json: no$"):
        within_limits(refuse, "w", 4 * GB, 100)


@pytest.mark.parametrize(
    ("work", "message"),
    [
        (lambda: np.ones(20 * GB // 8).sum(), "w: needs more than 4 GB of memory"),
        (crash, r"w: a library crashed \(SIGTRAP\), perhaps as it needs more than 4 GB of memory"),
        (spin, "w: needs more than 1 s of processor time or 4 GB of memory"),
    ],
)
def test_work_that_reaches_a_limit_is_one_line(work, message):
    with pytest.raises(InputError, match=f"^{message}$"):
        within_limits(work, "w", 4 * GB, 1)
