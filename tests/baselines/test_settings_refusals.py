"""What a refused setting of a training run says."""

import pytest

from baselines.base.errors import BaselineError
from baselines.base.settings import compose_checked
from baselines.graph.training.settings import GraphSettings
from benchmarks.fuzzing.library_words import library_words
from tests.project import ROOT


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("mines=-1", "mines = -1: want greater than or equal to 1"),
        ("mines=1.5", "mines = 1.5: want a whole number"),
        ("network.attention=perhaps", "network.attention = 'perhaps': want true or false"),
        ("start=3", "start is a section of keys"),
        ("+network.depth=3", "network.depth = 3: no such key"),
        ("~seed", "seed is missing"),
        ("nosuch=1", "nosuch=1: cannot be read; write KEY=VALUE, with keys and values as in conf/train/graph.yaml"),
        ("[x", "[x: cannot be read; write KEY=VALUE, with keys and values as in conf/train/graph.yaml"),
    ],
)
def test_a_refused_setting_is_named_in_our_own_words(monkeypatch, override, message):
    monkeypatch.chdir(ROOT)
    with pytest.raises(BaselineError) as caught:
        compose_checked("graph", [override], GraphSettings)
    assert str(caught.value) == message
    assert library_words(message) == []
    assert "Input" not in message
