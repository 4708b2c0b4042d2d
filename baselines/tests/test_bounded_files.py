"""Files of strangers are counted before anything is made of them, and a bad path is one line with exit code 2."""

import json
import os
import signal
import sys
from pathlib import Path

import pytest

from baselines import evaluate, score
from baselines.base.errors import BaselineError, run_command
from baselines.base.result_file import RESULTS, read_results, replace_text
from baselines.policies.policy_lookup import find_checkpoint
from baselines.policies.policy_source import require_checkpoint
from baselines.scoring.split_file import read_parts

HEAD = (RESULTS / "Family-test" / "nearest-frontier.jsonl").open().readline()
KEYS = ",".join(f'"k{number}":0' for number in range(1_200_000))

HOSTILE = {
    "keys of a head": (f'{{"format":0,{KEYS}}}\n', ":1: 14,488,902 characters, at most 100,000"),
    "few bytes, many keys": (f"{{{KEYS[:90_000]}}}\n", ":1: more than 2,532 values or 212 keys"),
    "values of a head": (f'{{"task":{{"x":[{"0," * 40_000}0]}}}}\n', ":1: more than 2,532 values"),
    "keys of an episode": (f"{HEAD}{{{KEYS[:1_900_000]}}}\n", ":2: more than 200,108 values or 20 keys"),
    "depth": ("[" * 90_000 + "\n", ":1: values are nested deeper than 3 levels"),
    "wrong samples": (f'{HEAD}{{"seen":[{"null," * 50_000}0]}}\n', r":2: not an episode \(seed is missing\)"),
    "a long line": (f'{HEAD}{{"seen":"{"x" * 3_000_000}"}}\n', r":2: 3,000,011 characters, at most 2,000,000"),
    "escapes": ('{"format":"' + "\\u0041" * 2_000_000 + '"}\n', ":1: 12,000,013 characters, at most 100,000"),
    "lines": ("\n" * 1_000_000, ": more than 2,000 lines"),
    "parts": ('{"format":\n' * 1_000_000, ": more than 2,000 lines"),
    "other ends of lines": ("\x0b\u2028" * 100_000 + "\n", ":1: 200,000 characters"),
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("read", [read_results, read_parts])
def test_what_a_results_file_holds_is_counted_before_it_is_read(tmp_path, name, read):
    text, message = HOSTILE[name]
    (tmp_path / "a.jsonl").write_text(text, newline="")
    with pytest.raises(BaselineError, match=message) as found:
        read(tmp_path / "a.jsonl")
    assert len(str(found.value)) < 300 + len(str(tmp_path))


def test_no_object_is_made_of_the_keys_of_a_hostile_file(tmp_path, monkeypatch):
    def refuse(*words):
        raise AssertionError("the line is parsed")

    monkeypatch.setattr("baselines.base.result_file.Head.model_validate_json", refuse)
    (tmp_path / "a.jsonl").write_text(f'{{"format":0,{KEYS}}}\n')
    with pytest.raises(BaselineError, match="at most 100,000 are read"):
        read_results(tmp_path / "a.jsonl")


@pytest.fixture
def places(tmp_path):
    """Return paths by what is wrong with them."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    return {
        "zero byte": f"{tmp_path}/a\0b",
        "no UTF-8": f"{tmp_path}/a\udcff",
        "no text": f"{tmp_path}/a\ud800",
        "folder": str(tmp_path),
        "pipe": str(tmp_path / "pipe"),
        "device": "/dev/zero",
        "link to a device": str(tmp_path / "link"),
        "links in a circle": str(tmp_path / "loop"),
        "missing": str(tmp_path / "missing"),
        "below a file": f"{__file__}/a",
        "long": "x" * 5000,
    }


KINDS = ["zero byte", "no UTF-8", "no text", "folder", "pipe", "device", "link to a device", "links in a circle"]
KINDS += ["missing", "below a file", "long"]


@pytest.fixture
def ends(monkeypatch, capsys):
    """Return a function that runs a command and returns its one line of error."""
    before = signal.getsignal(signal.SIGTERM)

    def run(command, *words):
        monkeypatch.setattr(sys, "argv", ["command", *words])
        assert run_command("command", command) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert said.strip().isprintable()
        return said

    yield run
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_that_is_no_results_file_is_one_line(places, ends, kind):
    ends(score.main, places[kind])
    with pytest.raises(BaselineError):
        read_results(Path(places[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_that_is_no_checkpoint_is_one_line(places, ends, kind):
    ends(evaluate.main, "--env", "ChileanMine", "--policy", f"{places[kind]}.safetensors")
    with pytest.raises(BaselineError):
        require_checkpoint(Path(places[kind]))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("missing", "no UTF-8", "no text")])
def test_a_place_for_results_that_is_none_is_refused_before_anything_is_driven(places, ends, kind, monkeypatch):
    monkeypatch.setattr(evaluate, "drive", lambda *words: pytest.fail("it drives"))
    ends(evaluate.main, "--env", "ChileanMine", "--policy", "random", "--out", places[kind])


def test_results_do_not_replace_a_pipe_or_device(places):
    for kind in ("pipe", "link to a device", "folder"):
        with pytest.raises(BaselineError, match="not a plain file"):
            replace_text(Path(places[kind]), "text")
    assert Path(places["pipe"]).is_fifo()


def test_the_header_of_a_checkpoint_is_counted_before_it_is_read(tmp_path):
    path = tmp_path / "a.safetensors"
    for values, message in ((30_000, "more than 20,000 values"), (200_000, "a header of 2,200,001 bytes, at most")):
        header = json.dumps({f"{number:06}": 0 for number in range(values)}, separators=(",", ":")).encode()
        path.write_bytes(len(header).to_bytes(8, "little") + header)
        with pytest.raises(BaselineError, match=message):
            find_checkpoint(str(path))
