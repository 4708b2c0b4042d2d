"""A few of the broken and hostile files of `make fuzz`; what is hostile is thrown at its reader in full."""

import numpy as np
import pytest

from benchmarks.fuzz import fuzz_reader, mutate
from benchmarks.fuzz_samples import HOSTILE, READERS, SAMPLES


def test_a_broken_copy_is_another_each_time_and_the_same_for_the_same_seed():
    data = b"leg,station\nA,a 1 2 3\n" * 20
    copies = [mutate(data, np.random.default_rng(seed)) for seed in range(50)]
    assert len(set(copies)) > 45
    assert copies[7] == mutate(data, np.random.default_rng(7))


@pytest.mark.slow
@pytest.mark.parametrize("reader", list(SAMPLES))
def test_a_reader_survives_what_is_thrown_at_it(reader):
    assert reader in READERS
    found = fuzz_reader(reader, len(HOSTILE.get(reader, [])) + 12, lambda n: None)
    assert found["failed"] == {}
    assert found["refused"] > 0
