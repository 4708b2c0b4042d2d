"""How commands of measurements end."""

from baselines.base.errors import BaselineError
from benchmarks.results import run_benchmark
from pipeline.errors import InputError


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
