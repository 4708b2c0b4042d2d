"""Which breach of a limit fails stage 6."""

import pytest

from pipeline.errors import LimitError
from pipeline.params.validation import Limit
from pipeline.proof.groups import applying_limits
from stages.validation import check_limits
from tests.composed import compose


def outputs(load_s: float, memory_mb: float, iou: float) -> dict:
    timings = {"world_sha256": "0", "world": {"first_load_s": 3.0, "load_s": load_s, "load_memory_mb": memory_mb}}
    return {"metrics": {"iou": {"rock": iou}}, "timings": timings}


@pytest.fixture
def params(config):
    limits = {"iou.rock": Limit(min=0.9), "world.load_s": Limit(max=2.0), "world.load_memory_mb": Limit(max=2300)}
    return config.validation.model_copy(update={"limits": limits})


def test_a_slow_machine_is_warned_and_passes(params, capsys):
    check_limits(params, outputs(2.5, 2100, 0.99))
    assert "world.load_s = 2.5: limit <= 2" in capsys.readouterr().err
    check_limits(params, outputs(1.5, 2100, 0.99))
    assert capsys.readouterr().err == ""


def test_a_limited_metric_without_a_figure_fails_and_says_so(params):
    with pytest.raises(LimitError, match=r"iou\.rock: there is no figure \(limit >= 0\.9\)"):
        check_limits(params, outputs(1.5, 2100, None))


@pytest.mark.parametrize(("memory_mb", "iou", "name"), [(2400, 0.99, "world.load_memory_mb"), (2100, 0.5, "iou.rock")])
def test_memory_and_metrics_fail(params, memory_mb, iou, name):
    with pytest.raises(LimitError, match=name):
        check_limits(params, outputs(1.5, memory_mb, iou))


@pytest.mark.parametrize(("drift_m", "judged"), [(95.0, False), (96.0, True), (1355.0, True)])
def test_rock_is_judged_where_the_drifts_hold_one_whole_draw_of_stretches(drift_m, judged):
    params = compose(["survey=procedural"]).validation
    limits = applying_limits(params, {"topology.drift_m": drift_m})
    groups = {name.partition(".")[0] for name in limits}
    assert ({"texture", "relief"} <= groups) == judged
    assert {"walls", "certificate", "per_m2", "wall_error"} <= groups  # these hold in a mine of any size
