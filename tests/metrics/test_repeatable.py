from dataclasses import dataclass

import numpy as np

from pipeline.metrics.digits import repeatable


@dataclass(frozen=True)
class Inner:
    length_m: float
    count: int


@dataclass(frozen=True)
class Outer:
    parts: list[Inner]
    shares: dict[str, float]
    valid_m: tuple[float, float]
    name: str


def test_nested_figures_that_differ_in_their_last_digits_become_equal():
    one, two = (
        Outer([Inner(0.1 * k, 3)], {"a": k / 3}, (k / 7, 1e-30 * k), "x") for k in (1.0, 1.0 + 3 * np.finfo(float).eps)
    )
    assert one != two
    assert repeatable(one) == repeatable(two)
    assert repeatable(one).shares["a"] == 0.333333333
    assert repeatable(one).parts[0].count == 3


def test_figures_that_differ_in_the_eighth_digit_stay_different():
    assert repeatable(0.123456781) != repeatable(0.123456791)
    assert repeatable([0.0, -1.5, 2.0]) == [0.0, -1.5, 2.0]
