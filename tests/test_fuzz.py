"""A few of the broken files of `make fuzz`, and all of its hostile files."""

import numpy as np
import pytest

from benchmarks.fuzz import fuzz_reader, mutate
from benchmarks.fuzz_readers import READERS
from benchmarks.fuzz_samples import HOSTILE, SAMPLES


def test_broken_copies_differ_between_seeds_and_repeat_for_the_same_seed():
    data = b"leg,station\nA,a 1 2 3\n" * 20
    copies = [mutate(data, np.random.default_rng(seed)) for seed in range(50)]
    assert len(set(copies)) > 45
    assert copies[7] == mutate(data, np.random.default_rng(7))


@pytest.mark.slow
@pytest.mark.parametrize("reader", list(SAMPLES))
def test_a_reader_survives_broken_and_hostile_files(reader):
    assert reader in READERS
    result = fuzz_reader(reader, len(HOSTILE.get(reader, [])) + 12, lambda n: None)
    assert result["failed"] == {}
    assert result["refused"] > 0
