"""What a refused setting of a training run says."""

import pytest

from baselines.base.errors import BaselineError
from baselines.base.run_folders import take_run_folder
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


def test_a_folder_with_files_of_the_user_is_not_taken_and_keeps_them(tmp_path):
    note = tmp_path / "checkpoint"
    note.write_text("mine")
    with pytest.raises(BaselineError, match=r"holds checkpoint and no training run; name a new or an empty folder"):
        take_run_folder(tmp_path)
    assert note.read_text() == "mine"


def test_a_new_folder_an_empty_one_and_that_of_a_run_are_taken(tmp_path):
    settings = take_run_folder(tmp_path / "new")
    settings.write_text("{}")
    (tmp_path / "new" / "checkpoint").mkdir()
    assert take_run_folder(tmp_path / "new") == settings == tmp_path / "new" / "settings.json"
