"""A measurement goes on where the last run stopped."""

from baselines.base.errors import BaselineError
from benchmarks.resume import resume, run_benchmark
from pipeline.errors import InputError


def test_only_rows_that_are_missing_are_measured(tmp_path):
    path, asked = tmp_path / "kept" / "rows.jsonl", []

    def measure(seeds):
        asked.append(list(seeds))
        return ({"seed": seed} for seed in seeds)

    assert [row["seed"] for row in resume(path, [1, 2], measure, "row")] == [1, 2]
    rows = resume(path, [1, 2, 3, 4], measure, "row")
    assert asked == [[1, 2], [3, 4]]
    assert [row["seed"] for row in rows] == [1, 2, 3, 4]
    again = resume(path, [3], measure, "row")
    assert asked[2:] == [[]]
    assert len(again) == 4


def test_an_expected_error_is_one_line_and_exit_code_two(capsys):
    def fail():
        raise InputError("plan.png: missing")

    def fail_baseline():
        raise BaselineError("no policy")

    assert [run_benchmark("bench", fail), run_benchmark("bench", fail_baseline), run_benchmark("bench", int)] == [
        2,
        2,
        0,
    ]
    assert capsys.readouterr().err == "bench: plan.png: missing\nbench: no policy\n"
