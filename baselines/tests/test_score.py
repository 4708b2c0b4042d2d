import json
import os
from dataclasses import replace

import numpy as np
import pytest

from baselines.base.environments import make_env
from baselines.base.errors import BaselineError, RejectedError, run_command
from baselines.base.result_file import RESULTS, Episode, chain, parse_results, read_results
from baselines.base.statistics import estimate, figures, interquartile_mean, sample_times
from baselines.evaluate import UNVERIFIED, evaluate, evaluate_all, is_current
from baselines.explorers import EXPLORERS
from baselines.leaderboard import leaderboard, sections_of, with_sections
from baselines.pages.split_page import UNVERIFIED_HEADING
from baselines.policies.policy_lookup import find_checkpoint, make_policy, policy_label
from baselines.running.parallel import SEEDS_A_PIECE, drive
from baselines.running.protocol import SEEDS, head_of, run_episodes
from baselines.sandbox.bubblewrap import require_sandbox
from baselines.score import main, score
from baselines.scoring.rerun import Rerun
from baselines.scoring.split_file import read_drives
from baselines.scoring.verified_runs import RECORD, note_driven, was_driven_here
from baselines.tests.test_learned import write_policy
from pieces.work import HERE, Where
from tests.forked import run_forked
from tests.project import ROOT
from tests.sandbox import needs_sandbox

TURNER = """
import numpy as np


class Turner:
    def __init__(self, count, task, robot):
        self.bias = np.zeros(count)

    def reset(self, robots, seeds):
        self.bias[robots] = 0.2 + 0.01 * seeds

    def act(self, observation, info):
        return np.column_stack([0.3 + 0 * self.bias, self.bias])
"""


@pytest.fixture(scope="module")
def written(short_id):
    """Return the text of a results file as the protocol writes it."""
    seeds = list(SEEDS)
    env = make_env(short_id, len(seeds))
    policy = make_policy("wall-following", len(seeds), env.task)
    head = head_of(short_id, env, "wall-following", policy, seeds)
    text = chain(head, list(run_episodes(env, policy, seeds)))
    env.close()
    return text


@pytest.fixture
def honest(written, tmp_path):
    """Return an honest results file that a test may change."""
    path = tmp_path / "wall-following.jsonl"
    path.write_text(written)
    return path


def forge(path, change_head=lambda head: head, change=lambda episode: episode):
    """Rewrite a results file with a changed head or first episode, every hash in order."""
    head, episodes = read_results(path)
    head = type(head).model_validate(change_head(head.model_dump()))
    facts = change(episodes[0].model_dump() | {"cells": head.cells})
    first = Episode.model_validate({key: value for key, value in facts.items() if key != "cells"})
    path.write_text(chain(head, [first, *episodes[1:]]))


def test_an_honest_file_passes_and_comes_out_the_same_when_driven_here(honest):
    score(honest)
    score(honest, Rerun(2))  # an episode does not depend on which others run beside it


@pytest.mark.slow
def test_episodes_driven_in_two_processes_are_those_driven_in_one(honest, short_id):
    seeds = list(SEEDS[: 2 * SEEDS_A_PIECE])
    parallel = drive("wall-following", short_id, seeds, Where(2))
    head, episodes = read_results(honest)
    assert chain(head, parallel) == chain(head, episodes[: len(seeds)])


@needs_sandbox
def test_a_learned_row_is_driven_here_by_its_name(short_id, tmp_path, monkeypatch):
    name = "Tee-beams-mlp-1"
    monkeypatch.setattr("baselines.policies.policy_lookup.CHECKPOINTS", tmp_path)
    write_policy(tmp_path / f"{name}.safetensors", "mlp", hidden=64)
    out = tmp_path / "elsewhere" / f"{name}.jsonl"
    evaluate(str(tmp_path / f"{name}.safetensors"), short_id, list(SEEDS), out)
    assert read_results(out)[0].policy == name
    score(out, Rerun(3))


@needs_sandbox
def test_a_strangers_class_is_driven_here_by_one_call_and_known_by_its_source(short_id, tmp_path, monkeypatch, capsys):
    source = tmp_path / "strange_turner.py"
    source.write_text(TURNER)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    out = tmp_path / "results.jsonl"
    evaluate("strange_turner:Turner", short_id, list(SEEDS), out)
    named = Rerun(2, "strange_turner:Turner")
    score(out, named)
    with pytest.raises(BaselineError, match="valid choices are random"):
        score(out, Rerun(2))  # the file's text does not decide what is imported
    require_sandbox.cache_clear()
    with monkeypatch.context() as without:
        without.setenv("PATH", "")
        with pytest.raises(BaselineError) as refused:
            score(out, named)
    assert str(refused.value) == (
        f"{out}: policy strange_turner:Turner of somebody else needs a sandbox: bubblewrap is not installed: "
        "`make setup` installs it; --trust-policy runs it unconfined"
    )
    with monkeypatch.context() as without:
        without.setenv("PATH", "")
        _score(out, monkeypatch, "--rerun", "all", "--policy", "strange_turner:Turner", "--trust-policy")
    said = capsys.readouterr()
    assert "with your rights, and verify nothing" in said.err
    assert UNVERIFIED in said.out
    source.write_text(TURNER + "\n")
    for rerun in (named, replace(named, trusted=True)):
        with pytest.raises(RejectedError, match=r"policy strange_turner:Turner is [0-9a-f]{12} here, not [0-9a-f]{12}"):
            score(out, rerun)


def test_every_kept_result_is_of_a_policy_that_is_found_by_its_name():
    files = sorted(RESULTS.glob("*/*.jsonl"))
    assert files
    for path in files:
        of_split = path.parent.name.startswith("Family-")
        label = read_drives(path)[0][0].policy if of_split else read_results(path)[0].policy
        assert label in (*EXPLORERS, "oracle-tour") or find_checkpoint(label).is_file()


def test_results_of_another_world_or_policy_are_recognised_as_stale_and_renewed(short_id, tmp_path, monkeypatch):
    monkeypatch.setattr("baselines.base.result_file.RESULTS", tmp_path)
    monkeypatch.setattr("baselines.evaluate.RESULTS", tmp_path)
    monkeypatch.setattr("baselines.evaluate.EXPLORERS", ["reactive"])
    monkeypatch.setattr("baselines.evaluate.CHECKPOINTS", tmp_path)  # the kept ones would be driven, too
    out = tmp_path / "ShortTee-v0" / "reactive.jsonl"
    evaluate_all([short_id], [0], HERE)
    assert was_driven_here(out, tmp_path, *read_results(out))
    written, made = out.read_bytes(), out.stat().st_mtime_ns
    evaluate_all([short_id], [0], HERE)
    assert out.stat().st_mtime_ns == made  # current: kept
    head, _ = read_results(out)
    for change in (
        {"world_sha256": "0" * 64},
        {"policy_sha256": "0" * 64},
        {"task": head.task | {"beams": 8}},
        {"robot": {}},
    ):
        forge(out, _set(**change))
        assert not is_current(out, head)
        out.write_bytes(written)
        assert is_current(out, head)
    forge(out, _set(world_sha256="0" * 64))
    evaluate_all([short_id], [0], HERE)
    assert out.read_bytes() == written
    out.write_bytes(written[: len(written) // 2])  # what an interrupted copy leaves
    evaluate_all([short_id], [0], HERE)
    assert out.read_bytes() == written


def _set(**changes):
    return lambda facts: facts | changes


def _overstated(episode):
    """Return an episode with a tenth more new cells at every time, its way kept, its path as long as it may be."""
    first, *others = episode["seen"]
    return episode | {"seen": [first, *(round(first + 1.1 * (cells - first)) for cells in others)], "path_m": 100.0}


@pytest.mark.parametrize(
    ("head", "episode", "reason"),
    [
        ({"world_sha256": "0" * 64}, None, "world 000000000000 is not"),
        ({"cells": 100}, None, "100 reachable cells, the world has"),
        ({}, _set(seen=[1, 2]), "2 samples of coverage"),
        ({}, _set(steps=5000), "an episode has at most 240"),
    ],
)
def test_what_cannot_be_is_rejected_with_its_reason(honest, head, episode, reason):
    forge(honest, _set(**head), episode or (lambda e: e))
    with pytest.raises(RejectedError, match=reason):
        score(honest)


def test_a_seed_that_comes_twice_is_rejected(honest):
    head, episodes = read_results(honest)
    twice = head.model_copy(update={"seeds": [0, 0, *head.seeds[2:]]})
    honest.write_text(chain(twice, [episodes[0], episodes[0], *episodes[2:]]))
    with pytest.raises(RejectedError, match="a seed comes twice"):
        score(honest)


def test_another_task_is_rejected(honest):
    forge(honest, lambda head: head | {"task": head["task"] | {"max_forward_mps": 3.0}})
    with pytest.raises(RejectedError, match=r"max_forward_mps = 3.0, it is 1.5"):
        score(honest)


def test_another_robot_is_rejected(honest):
    forge(honest, lambda head: head | {"robot": head["robot"] | {"radius_m": 0.1}})
    with pytest.raises(RejectedError, match=r"the robot is not .*: radius_m = 0.1, it is 0.35"):
        score(honest)


def test_a_checkpoint_cannot_take_an_explorers_name(honest, tmp_path):
    for name in ("random", "oracle-tour", "a b"):
        with pytest.raises(BaselineError, match=f"policy = '{name}'"):
            policy_label(f"{tmp_path}/{name}.safetensors")
    assert policy_label("my_explorer:Bouncer") == "my_explorer.Bouncer"
    with pytest.raises(RejectedError, match="results of 'wall-following', not of 'mine'"):
        score(honest, Rerun(1, f"{tmp_path}/mine.safetensors"))


def test_a_verified_file_that_was_edited_by_hand_is_unverified(honest, tmp_path):
    kept = tmp_path / "results" / "wall-following.jsonl"
    kept.parent.mkdir()
    kept.write_bytes(honest.read_bytes())
    note_driven(kept, tmp_path / "results", *read_results(kept))
    assert was_driven_here(kept, tmp_path / "results", *read_results(kept))
    lines = kept.read_text().splitlines()
    facts = json.loads(lines[1])
    facts["seen"][-1] += 1
    kept.write_text("\n".join([lines[0], json.dumps(facts), *lines[2:]]) + "\n")
    assert not was_driven_here(kept, tmp_path / "results", *read_results(kept))


@pytest.mark.parametrize("kept", [0, 40, 200, -1])
def test_a_file_that_is_cut_short_is_refused(honest, kept):
    honest.write_text(honest.read_text()[:kept])
    with pytest.raises(BaselineError, match="cut short"):
        score(honest)


def test_a_missing_episode_is_refused(honest):
    honest.write_text("".join(honest.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(BaselineError, match="19 episodes, the head says 20 seeds"):
        score(honest)


def test_overstated_figures_are_unverified_and_differ_when_driven_again(honest, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "results" / "ShortTee-v0"
    folder.mkdir(parents=True)
    kept = folder / "wall-following.jsonl"
    monkeypatch.setattr("baselines.base.result_file.RESULTS", tmp_path / "results")
    kept.write_bytes(honest.read_bytes())
    _score(kept, monkeypatch, "--rerun", "all")
    assert "20 of 20 episodes driven again, all figures are equal" in capsys.readouterr().out
    verified = leaderboard(tmp_path / "results")
    assert UNVERIFIED_HEADING not in verified
    forge(kept, change=_overstated)
    _score(kept, monkeypatch)
    assert UNVERIFIED in capsys.readouterr().out
    claimed = leaderboard(tmp_path / "results").split(UNVERIFIED_HEADING)
    assert "| wall-following |" not in claimed[0]
    assert "| wall-following | 20 |" in claimed[1]
    with pytest.raises(RejectedError, match=r"seed 0: driven again, the episode comes out differently \(seen\)"):
        _score(kept, monkeypatch, "--rerun", "all")
    assert not was_driven_here(kept, tmp_path / "results", *read_results(kept))


def _score(path, monkeypatch, *words):
    monkeypatch.setattr("sys.argv", ["score", str(path), *words])
    main()


def test_a_part_that_was_driven_again_verifies_no_file(honest, monkeypatch, capsys):
    _score(honest, monkeypatch, "--rerun", "1")
    said = capsys.readouterr().out
    assert "1 of 20 episodes driven again" in said
    assert UNVERIFIED in said


def test_broken_records_of_runs_are_refused_in_our_own_words(tmp_path):
    (tmp_path / RECORD).write_text("{")
    with pytest.raises(BaselineError, match=rf"{RECORD}: not JSON from line 1, character 2 on; remove it and drive"):
        was_driven_here(tmp_path / "a.jsonl", tmp_path, None, [])
    with pytest.raises(BaselineError, match=r"a\.jsonl:1: not the head of a results file \(not JSON\)$"):
        parse_results(tmp_path / "a.jsonl", "{\n")
    with pytest.raises(BaselineError, match=r"a\.jsonl:1: not the head of a results file \(format is missing\)$"):
        parse_results(tmp_path / "a.jsonl", "{}\n")


@pytest.mark.parametrize("name", ["..", ".", ".hidden", "a..b", "a.", "-x", "a/b", "", "a" * 65])
def test_a_policys_name_that_is_no_files_name_is_refused(honest, name):
    text = honest.read_text().replace('"policy":"wall-following"', f'"policy":"{name}"')
    honest.write_text(text)
    with pytest.raises(BaselineError, match="not the head of a results file"):
        score(honest)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ({"policy": "oracle-tour"}, "policy 'oracle-tour': the name is reserved"),
        ({"policy": "Oracle-Tour"}, "policy 'Oracle-Tour': the name is reserved"),
        ({"policy": "RANDOM"}, "policy 'RANDOM': the name of another policy, whose hash is "),
        ({"policy": "random"}, "policy 'random': the name of another policy, whose hash is "),
        ({"policy": "graph-42"}, "policy 'graph-42': the name of another policy, whose hash is "),
        ({"policy_sha256": "0" * 64}, "policy 'wall-following': the name of another policy"),
    ],
)
def test_a_name_that_is_reserved_or_another_policys_is_refused(honest, tmp_path, head, message):
    forge(honest, _set(**head))
    with pytest.raises(RejectedError, match=message):
        score(honest)
    place = tmp_path / "results" / "ShortTee-v0" / f"{read_results(honest)[0].policy}.jsonl"
    place.parent.mkdir(parents=True)
    honest.rename(place)
    if "reserved" not in message:  # the oracle's row is the project's own
        with pytest.raises(RejectedError, match=message):
            leaderboard(tmp_path / "results")


def test_a_leaderboard_shows_apart_what_was_not_driven_here(honest, tmp_path):
    results, (head, episodes) = tmp_path / "results", read_results(honest)
    folder = results / "ShortTee-v0"
    folder.mkdir(parents=True)
    (folder / "wall-following.jsonl").write_text(chain(head, episodes))
    mine = head.model_copy(update={"policy": "a-stranger"})
    (folder / "a-stranger.jsonl").write_text(chain(mine, episodes))
    assert note_driven(folder / "wall-following.jsonl", results, head, episodes)
    verified, claimed = leaderboard(results).split(UNVERIFIED_HEADING)
    assert ["| wall-following | 20 |" in verified, "| a-stranger | 20 |" in verified] == [True, False]
    assert ["| wall-following | 20 |" in claimed, "| a-stranger | 20 |" in claimed] == [False, True]
    forge(folder / "wall-following.jsonl", change=_set(path_m=episodes[0].path_m + 0.001))  # not what was driven
    verified, claimed = leaderboard(results).split(UNVERIFIED_HEADING)
    assert "| 20 |" not in verified
    assert "| wall-following | 20 |" in claimed
    (folder / "a-stranger.jsonl").rename(folder / "another.jsonl")
    with pytest.raises(RejectedError, match=r"another\.jsonl: results of a-stranger"):
        leaderboard(results)


def test_a_section_of_a_leaderboard_is_written_anew_alone_and_a_new_one_finds_its_place(honest, tmp_path):
    folder = tmp_path / "results" / "ShortTee-v0"
    folder.mkdir(parents=True)
    (folder / "wall-following.jsonl").write_bytes(honest.read_bytes())
    note_driven(folder / "wall-following.jsonl", tmp_path / "results", *read_results(honest))
    env = read_results(honest)[0].env
    sections = sections_of(tmp_path / "results", [env])
    assert list(sections) == [env]
    old = "\n\n## Unseen mines\n\n200 mines\n\n## MineXplore/ChileanMine-v0\n\none\n\n## MineXplore/Zoo-v0\n\ntwo\n"
    page = with_sections(old, sections)
    headings = [line for line in page.splitlines() if line.startswith("## ")]
    assert headings == ["## Unseen mines", "## MineXplore/ChileanMine-v0", f"## {env}", "## MineXplore/Zoo-v0"]
    assert sections[env].strip() in page
    assert "200 mines\n\n## " in page
    again = with_sections(page, {env: f"## {env}\n\nother\n"})
    assert "| wall-following |" not in again
    assert again.count(f"## {env}") == 1
    with pytest.raises(BaselineError, match=r"no results of MineXplore/Nothing-v0; `python -m baselines\.evaluate`"):
        sections_of(tmp_path / "results", ["MineXplore/Nothing-v0"])


def test_a_leaderboard_shows_impossible_figures_as_unverified(honest, tmp_path):
    folder = tmp_path / "results" / "ShortTee-v0"
    folder.mkdir(parents=True)
    (folder / "wall-following.jsonl").write_bytes(honest.read_bytes())
    note_driven(folder / "wall-following.jsonl", tmp_path / "results", *read_results(honest))
    forge(folder / "wall-following.jsonl", change=_set(returned=860.0))
    verified, claimed = leaderboard(tmp_path / "results").split(UNVERIFIED_HEADING)
    assert ["| wall-following |" in part for part in (verified, claimed)] == [False, True]


def test_missing_and_extra_seeds_are_rejected(honest):
    head, episodes = read_results(honest)
    honest.write_text(chain(head.model_copy(update={"seeds": head.seeds[:-1]}), episodes[:-1]))
    with pytest.raises(RejectedError, match=r"the protocol's are 0 to 19; missing \[19\], extra none"):
        score(honest)
    extra = episodes[0].model_copy(update={"seed": 20})
    honest.write_text(chain(head.model_copy(update={"seeds": [*head.seeds, 20]}), [*episodes, extra]))
    with pytest.raises(RejectedError, match=r"missing none, extra \[20\]"):
        score(honest)


def test_interquartile_means_are_those_of_the_middle_half():
    assert interquartile_mean(np.array([0.0, 1.0, 2.0, 100.0])) == 1.5
    found = estimate(list(np.random.default_rng(0).normal(5.0, 1.0, 400)))
    assert found.low < 5.0 < found.high
    assert found.high - found.low < 0.5
    assert estimate([]).value is None


def test_figures_of_an_episode_are_those_of_its_curve(honest):
    head, episodes = read_results(honest)
    share = interquartile_mean(np.array([e.seen[-1] / head.cells for e in episodes]))
    found = figures(head, episodes, lambda t: head.cells)
    assert found["coverage at 24 s"].value == pytest.approx(share)
    assert found["share of bound at 24 s"].value == pytest.approx(share)
    times = sample_times(episodes[0], 0.1)
    assert times[0] == 0
    assert times[-1] == pytest.approx(episodes[0].steps * 0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["baselines.evaluate", "--policy", "greedy", "--env", "MineXplore/Moon-v0"], "valid choices are MineXplore/"),
        (["baselines.evaluate", "--policy", "random"], "--policy and --env"),
        (["baselines.evaluate", "--policy", "a:b", "--env", "ChileanMine"], "cannot be imported"),
        (["baselines.evaluate", "--all", "--env", "mars"], "env = 'mars': valid choices are MineXplore/"),
        (["baselines.evaluate", "--all", "--jobs", "0"], "jobs = 0"),
        (["baselines.score", "README.md", "--rerun", "-1"], "rerun = -1"),
        (["baselines.oracle", "--episodes", "0"], "episodes = 0"),
        (["baselines.evaluate", "--policy", "random", "--env", "x", "--episodes", "0"], "episodes = 0"),
        (["baselines.score", "README.md"], "not the head of a results file"),
        (["baselines.score", "no.jsonl"], "no.jsonl"),
        (["baselines.oracle", "--env", "x"], "valid choices are MineXplore/"),
        (["baselines.ppo.train", "ppo.lr=-1"], "ppo.lr = -1"),
        (["baselines.ppo.train", "model=transformer"], "model=transformer: valid choices are lstm, mlp"),
        (["baselines.ppo.train", "env=moon"], "env=moon: valid choices are ChileanMine, "),
    ],
)
def test_bad_input_ends_with_one_message_and_code_two(arguments, message):
    module, *words = arguments
    done = run_forked(module, tuple(words), ROOT)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_file_name_is_one_printable_line_of_a_message(capsys):
    def fail():
        raise BaselineError(os.fsdecode(b"a\x1b[2J\xff\n.jsonl: no results"))

    assert run_command("score", fail) == 2
    assert capsys.readouterr().err == "score: a [2J  .jsonl: no results\n"
