"""The figures of the report's page, and which of them are judged."""

from pipeline.params.validation import Limit
from pipeline.report.page import _figures


def test_a_time_beyond_its_limit_is_no_failure_of_the_world_and_any_other_figure_is():
    limits = {"world.load_s": Limit(max=0.4), "iou.free": Limit(min=0.99)}
    groups = _figures({"world.load_s": 0.5, "iou.free": 0.5, "iou.more": 1.0}, limits)
    (load,), (free, more) = groups["world"], groups["iou"]
    assert (load.holds, load.limit) == (None, "<= 0.4, depends on the machine")
    assert (free.holds, free.limit) == (False, ">= 0.99")
    assert (more.holds, more.limit) == (None, "")
