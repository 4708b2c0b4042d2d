import pytest

from baselines.base.errors import BaselineError
from baselines.scoring.split_file import write_drives
from baselines.split import evaluate_split
from baselines.worst_mines import draw, pairs_of, share, stands, tables


def test_the_mines_are_in_the_order_of_what_a_policy_sees_beside_another(mines, tmp_path):
    drives = {name: evaluate_split(name, "test", 1) for name in ("wall-following", "random")}
    pairs = pairs_of("random", "wall-following", "test")
    assert [pair.gain for pair in pairs] == sorted(pair.gain for pair in pairs)
    assert {pair.number for pair in pairs} == {0, 1}
    first = pairs[0]
    assert first.gain == share(drives["random"][first.number]) - share(drives["wall-following"][first.number])
    assert 0 <= stands(first.theirs) < 0.5
    text = tables("random", "wall-following", "test", pairs, 1)
    assert f"| {first.number} | {('room and pillar', 'drift and crosscut')[first.number]} |" in text
    assert text.count("\n| ") == 2  # the heading and one mine
    draw(pairs, tmp_path / "worst.jpg")
    assert (tmp_path / "worst.jpg").stat().st_size > 10_000
    write_drives(tmp_path / "Family-test" / "random.jsonl", drives["random"][:1])
    with pytest.raises(BaselineError, match="are of other mines"):
        pairs_of("random", "wall-following", "test")
