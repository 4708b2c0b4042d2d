"""The results table: values beyond their limits, and pages that state the same figures."""

import re

import numpy as np

from pipeline.metrics.iou import DifferingAreas, differing_areas
from pipeline.params.validation import Limit
from pipeline.report.results import MetricRow, results_table
from tests.project import ROOT


def test_a_value_beyond_its_limit_is_marked():
    rows = [MetricRow("load", ("per_metre.load_s",), ".6f"), MetricRow("bytes", ("per_metre.bytes",), ",.0f")]
    metrics = {"world.load_s": 0.4, "per_metre.load_s": 0.0003, "per_metre.bytes": 17381}
    limits = {"per_metre.load_s": Limit(max=0.000294), "per_metre.bytes": Limit(max=18400)}
    assert results_table(rows, metrics, limits).splitlines()[2:] == [
        "| load | 0.000300 | <= 0.000294 (missed) | - |",
        "| bytes | 17,381 | <= 18400 | - |",
    ]


def test_rock_in_the_plans_free_space_and_missing_rock_are_areas_of_pixels():
    plan, world = np.zeros((2, 40, 40), dtype=bool)
    plan[10:20, 10:20] = True
    world[10:20, 12:21] = True  # 20 pixels are rock in the world, 10 were rock in the plan
    assert differing_areas(world, plan, 2.0) == DifferingAreas(5.0, 0.2, 2.5)


def test_the_ledger_and_the_results_state_the_same_load_time_and_size():
    results, claims = ((ROOT / "docs/evidence" / name).read_text() for name in ("results.md", "parts/claims.md"))
    ledger = re.search(r"\| load below 10 s \| ([\d.]+) s .* a bundle of ([\d.]+) MB", claims)
    table = [re.search(rf"\| {title} \| ([\d.]+) ", results) for title in ("MjModel load, the first.*?", "bundle, MB")]
    assert ledger.groups() == tuple(found[1] for found in table), "run `make report claims`"
