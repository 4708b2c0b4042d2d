"""Results on the mines of a split: driven, kept, resumed, checked and compared."""

from pathlib import Path

import numpy as np
import pytest

import minexplore
from baselines import split
from baselines.base.errors import BaselineError, RejectedError
from baselines.base.statistics import Figure
from baselines.pages.split_page import (
    UNVERIFIED_HEADING,
    _beside,
    _by_style,
    _SplitRow,
    in_order,
    require_own_rows,
    split_section,
)
from baselines.score import print_split, score_split
from baselines.scoring import verified_runs as driven
from baselines.scoring.bounds import Bound, bounds_file, read_bounds, write_bound
from baselines.scoring.rerun import Rerun
from baselines.scoring.split_file import read_drives, require_whole, write_drives
from baselines.scoring.split_statistics import improvement, middle, profile, stratified
from baselines.split import bound_split, evaluate_split

WORLDS = "`python -m benchmarks worlds"


def test_a_split_is_driven_once_and_resumed(mines, tmp_path, monkeypatch):
    path = tmp_path / "Family-test" / "wall-following.jsonl"
    drives = evaluate_split("wall-following", "test")
    assert [head.env for head, _ in drives] == mines
    whole = path.read_bytes()
    path.unlink()
    driven = []
    monkeypatch.setattr(split, "_drive", lambda policy, mine: driven.append(mine))
    assert evaluate_split("wall-following", "test") == drives  # its pieces were kept
    assert path.read_bytes() == whole
    assert not driven


@pytest.mark.slow
def test_a_split_has_bounds_and_a_table_with_a_picture(mines, tmp_path, monkeypatch):
    for policy in ("wall-following", "random"):
        evaluate_split(policy, "test")
    monkeypatch.setattr(split, "_BANDS", 25)  # a hundred take the solver six seconds
    bounds = bound_split("test")
    assert all(bound.found[-1] <= bound.most[-1] <= bound.cells for bound in bounds.values())
    picture = tmp_path / "profiles.png"
    text = split_section(tmp_path, "test", picture)
    assert f"]({picture.as_posix()})" in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| ") and "never in" in line]
    assert [row[1].strip() for row in rows] == ["wall-following", "random"]
    assert "best classical explorer in the table does, `wall-following`" in " ".join(text.split())
    assert [cell.strip() for cell in rows[0][-3:-1]] == ["", ""]
    assert float(rows[1][-3].split("(")[0]) == 0.0  # it sees less in every mine
    assert float(rows[1][-2].split("(")[0]) < 0


def test_a_file_that_is_not_whole_is_refused_and_one_that_was_changed_is_unverified(mines, tmp_path):
    drives = evaluate_split("random", "test")
    path = tmp_path / "Family-test" / "random.jsonl"
    with pytest.raises(BaselineError, match=r"nothing where MineXplore/Family-test-0001-v0 is due"):
        require_whole(path, drives[:1], "test")
    with pytest.raises(BaselineError, match=r"Family-test-0001-v0 where MineXplore/Family-test-0000-v0 is due"):
        require_whole(path, drives[::-1], "test")
    text = path.read_text()
    forged = text.replace('"collided":', '"collided":1000', 1)
    assert forged != text
    path.write_text(forged)  # digits before the number of contacts
    for env_id, (head, _) in zip(mines, drives, strict=True):
        whole = Bound(world_sha256=head.world_sha256, cells=head.cells, time_s=[20.0], most=[head.cells], found=[1])
        write_bound(env_id, whole)
    verified, claimed = split_section(tmp_path, "test").split(UNVERIFIED_HEADING)
    assert ["| random |" in part for part in (verified, claimed)] == [False, True]
    path.write_text(text.splitlines()[0] + "\n")
    with pytest.raises(BaselineError, match="0 episodes"):
        read_drives(path)


def test_results_without_a_bound_are_no_row(mines, tmp_path):
    evaluate_split("random", "test")
    with pytest.raises(BaselineError, match=r"has no bound; `python -m baselines.split --bounds`"):
        split_section(tmp_path, "test")


def test_a_mine_that_is_not_built_is_named_with_the_command_that_builds_it(mines, monkeypatch):
    monkeypatch.setattr(split, "SIZES", {"test": 3})
    with pytest.raises(BaselineError, match=rf"Family-test-0002-v0: not built; {WORLDS} --count 3 --split test`"):
        evaluate_split("random", "test")


def test_a_table_of_mines_that_are_not_built_says_what_builds_them(mines, monkeypatch, tmp_path):
    evaluate_split("random", "test")
    monkeypatch.setattr(minexplore, "FAMILY_MINES", {mines[0]: minexplore.FAMILY_MINES[mines[0]]})
    with pytest.raises(BaselineError, match=rf"Family-test-0001-v0: not built; {WORLDS} --count 2 --split test`"):
        split_section(tmp_path, "test")


def test_bounds_of_a_split_lie_beside_its_results(mines, tmp_path):
    write_bound(mines[0], Bound(world_sha256="0" * 64, cells=9, time_s=[20.0], most=[8], found=[7]))
    assert bounds_file(mines[0]) == tmp_path / "Family-test" / "bounds.json"
    assert read_bounds(bounds_file(mines[0]))[mines[0]].found == [7]
    assert read_bounds() == {}


def test_the_probability_of_improvement_is_the_mann_whitney_statistic_of_each_mine():
    from scipy.stats import mannwhitneyu  # takes half a second to load, in each worker

    rng = np.random.default_rng(0)
    ours, theirs = rng.integers(0, 5, 40) / 5, rng.integers(0, 5, 40) / 5
    wanted = np.mean([mannwhitneyu([a], [b]).statistic for a, b in zip(ours, theirs, strict=True)])
    assert improvement(ours, theirs) == pytest.approx(wanted)
    assert improvement(ours, ours) == 0.5


def test_a_stratified_interval_is_narrower_where_strata_differ():
    rng = np.random.default_rng(1)
    strata = np.arange(200) % 4
    values = strata + rng.normal(0, 0.1, 200)
    by_style = stratified(np.mean, values, strata=strata)
    mixed = stratified(np.mean, values, strata=np.zeros(200, int))
    assert by_style.low < by_style.value < by_style.high
    assert by_style.high - by_style.low < 0.25 * (mixed.high - mixed.low)
    assert middle(np.array([0.0, 1.0, 2.0, 100.0])) == 1.5


def test_a_profile_falls_from_all_to_none():
    values = np.array([0.2, 0.4, 0.6])
    np.testing.assert_allclose(profile(values, np.array([0.0, 0.3, 0.5, 0.9])), [1, 2 / 3, 1 / 3, 0])


def test_a_file_of_a_split_was_driven_here_only_with_its_present_contents(mines, tmp_path):
    path = tmp_path / "Family-test" / "random.jsonl"
    drives = evaluate_split("random", "test")
    head, episodes = drives[0][0], [episode for _, episode in drives]
    assert driven.was_driven_here(path, tmp_path, head, episodes)
    assert not driven.was_driven_here(path, tmp_path, head, episodes[:1])


def test_rows_stand_by_their_share_of_the_bound():
    figures = {name: Figure(1.0, 1.0, 1.0, 4) for name in ("distance, m", "collisions per 100 m")}
    rows = [
        _SplitRow(name, here, np.ones(4), {**figures, "share of bound": Figure(share, share, share, 4)}, 0)
        for name, here, share in (("a", False, 0.9), ("b", True, 0.2), ("c", True, 0.5), ("d", False, 0.95))
    ]
    assert [row.policy for row in in_order(rows)] == ["d", "a", "c", "b"]
    assert rows[0].text("share of bound").startswith("90.0 %")


def test_the_difference_to_another_policy_is_that_of_the_same_mines_and_styles_have_their_own_shares():
    of_mine = np.tile([0.2, 0.4, 0.6, 0.8], 50) + np.random.default_rng(2).normal(0, 0.05, 200)
    other, better = _SplitRow("other", True, of_mine, {}, 0), _SplitRow("better", True, of_mine + 0.03, {}, 0)
    assert _beside(better, other) == ("1.00 (1.00-1.00)", "+3.0 (+3.0 to +3.0)")
    assert _beside(other, better) == ("0.00 (0.00-0.00)", "-3.0 (-3.0 to -3.0)")
    table = _by_style([better, other], other).splitlines()
    assert table[0] == "| policy | room and pillar | drift and crosscut | ramp | cave |"
    assert [cell.split(", ")[1].strip() for cell in table[-2].split("|")[2:-1]] == ["P 1.00"] * 4
    assert "P" not in table[-1]
    shares = [float(cell.split(" %")[0]) for cell in table[-1].split("|")[2:-1]]
    np.testing.assert_allclose(shares, [20, 40, 60, 80], atol=2.0)


def test_a_file_with_the_name_of_another_policy_is_refused(mines, tmp_path):
    drives = evaluate_split("random", "test")
    with pytest.raises(RejectedError, match=r"other\.jsonl: results of random, which are kept as random\.jsonl"):
        require_own_rows({Path("other.jsonl"): drives})
    require_own_rows({Path("random.jsonl"): drives})


def test_what_was_not_driven_here_stands_apart_and_is_compared_with_nothing(mines, tmp_path):
    drives = evaluate_split("random", "test")
    for head, _ in drives:
        bound = Bound(world_sha256=head.world_sha256, cells=head.cells, time_s=[20.0], most=[head.cells], found=[1])
        write_bound(head.env, bound)
    claimed = [(head.model_copy(update={"policy": "a-stranger"}), episode) for head, episode in drives]
    write_drives(tmp_path / "Family-test/a-stranger.jsonl", claimed)
    verified, apart = split_section(tmp_path, "test").split(UNVERIFIED_HEADING)
    assert "a-stranger" not in verified
    assert "| a-stranger |" in apart
    assert "random" not in apart
    assert " P " not in apart
    named = [(head.model_copy(update={"policy_sha256": "0" * 64}), episode) for head, episode in drives]
    write_drives(tmp_path / "Family-test/random.jsonl", named)
    with pytest.raises(RejectedError, match=r"random\.jsonl: policy 'random': the name of another policy"):
        split_section(tmp_path, "test")


def test_a_file_that_somebody_sent_is_driven_again_and_not_called_driven_here(mines, tmp_path, capsys):
    drives = evaluate_split("random", "test")
    path = tmp_path / "Family-test" / "random.jsonl"
    honest = path.read_bytes()
    head, episode = drives[1]
    forged = [drives[0], (head, episode.model_copy(update={"collided": episode.collided + 1}))]
    write_drives(path, forged)
    assert evaluate_split("random", "test") == drives
    assert f"{path}: was not driven here" in capsys.readouterr().err
    assert path.read_bytes() == honest


def test_a_part_of_a_split_that_is_driven_leaves_the_other_mines_in_the_file(mines, tmp_path):
    drives = evaluate_split("random", "test")
    assert evaluate_split("random", "test", most=1) == drives[:1]
    assert read_drives(tmp_path / "Family-test" / "random.jsonl") == drives


def test_a_file_of_a_split_is_scored_and_driven_again_mine_by_mine(mines, tmp_path, capsys):
    drives = evaluate_split("wall-following", "test")
    path = tmp_path / "sent" / "wall-following.jsonl"
    write_drives(path, drives)
    assert [episode.seen for _, episode in score_split(path, Rerun(1000))] == [episode.seen for _, episode in drives]
    print_split(drives[:1], verified=False)
    said = capsys.readouterr().out
    assert "2 of 2 mines driven again" in said
    assert "wall-following in 1 of the 200 mines of the split test" in said
    assert "unverified: " in said
    (first, one), (second, other) = drives
    useful = other.model_copy(update={"path_m": round(other.path_m + 0.001, 3)})
    write_drives(path, [(first, one), (second, useful)])
    score_split(path)  # unverified
    with pytest.raises(RejectedError, match=rf"{mines[1]}: driven again, the episode comes out differently \(path_m"):
        score_split(path, Rerun(1000))
    write_drives(path, [(first, one), (first, one)])
    with pytest.raises(BaselineError, match=rf"{mines[0]} comes twice"):
        score_split(path)
    named = second.model_copy(update={"policy": "another"})
    write_drives(path, [(first, one), (named, other)])
    with pytest.raises(BaselineError, match="results of 2 policies"):
        score_split(path)


@pytest.mark.parametrize("count", ["0", "-1", "51"])
def test_a_number_of_mines_that_is_no_part_of_the_split_is_refused_and_zero_is_not_all(monkeypatch, count):
    monkeypatch.setattr("sys.argv", ["split", "--split", "validation", "--policy", "random", "--mines", count])
    with pytest.raises(BaselineError, match=rf"mines = {count}: want 1 to 50"):
        split.main()


def test_bounds_that_cannot_be_read_are_named(mines, tmp_path):
    path = bounds_file(mines[0])
    path.parent.mkdir()
    for text in ("", "[]", "[" * 100_000, '{"a": {"cells": "many"}}', "{}x"):
        path.write_text(text)
        with pytest.raises(BaselineError, match=r"bounds\.json: no bounds"):
            read_bounds(path)
