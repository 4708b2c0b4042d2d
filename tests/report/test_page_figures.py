"""The figures of the report's page, and which of them are judged."""

import json
import re

from pipeline.metrics.limits import flatten
from pipeline.params.validation import Limit
from pipeline.report.figure_rows import figures_of, places_of
from pipeline.report.meanings import GROUPS, meaning_of
from tests.composed import compose
from tests.project import ROOT


def test_a_time_beyond_its_limit_is_no_failure_of_the_world_and_any_other_figure_is():
    limits = {"world.load_s": Limit(max=0.4), "iou.free": Limit(min=0.99)}
    metrics = {"world.load_s": 0.5, "iou.free": 0.5, "iou.more": 1.0}
    (_, (load,)), (_, (free, more)) = figures_of(metrics, limits)
    assert (load.holds, load.limit) == (None, "<= 0.4, depends on the machine")
    assert (free.holds, free.limit) == (False, ">= 0.99")
    assert (more.holds, more.limit) == (None, "")


def test_every_figure_that_is_measured_or_has_a_limit_has_a_sentence_of_its_own_group():
    params = compose([]).validation
    names = {
        *flatten(json.loads((ROOT / "artifacts/validation/metrics.json").read_text())),
        *params.limits,
        *params.volume.limits,
        *(f"certificate.{name}" for name in params.certificate.limits),
    }
    assert len(names) > 100
    assert [name for name in sorted(names) if " " not in meaning_of(name)] == []
    assert [name for name in sorted(names) if name.partition(".")[0] not in GROUPS] == []
    pages = {group.page.partition("#") for group in GROUPS.values()}
    for page, _, anchor in pages:
        text = (ROOT / "docs" / page).read_text()
        heads = [re.sub(r"[^\w -]", "", head).lower() for head in re.findall(r"^#+ (.*)$", text, re.M)]
        heads = [head.strip().replace(" ", "-") for head in heads]
        assert not anchor or anchor in heads


def test_figures_that_differ_in_their_size_or_axis_have_different_sentences():
    assert meaning_of("texture.rq_ratio.at_10_cm") != meaning_of("texture.rq_ratio.at_20_cm")
    assert "jaggedness" in meaning_of("texture.published.wall_jaggedness_deg")
    assert meaning_of("no.such_figure") == ""


def test_a_list_of_places_has_numbers_and_places_on_the_map():
    lines = [
        "1 to 2 through 3 to 4 (-0.59 m at (34.73, 24.71, 41.93) m)",
        "5 to 6 on 7 to 8 (0.2 m at (1.0, -2.5, 3.0) m)",
    ]
    groups = figures_of({"floor.through": lines, "floor.step_at": "1 to 2 at (9.00, 8.00, 7.00) m"}, {})
    places = places_of(groups)
    assert [(place.number, place.x, place.y) for place in places] == [(1, 34.73, 24.71), (2, 1.0, -2.5)]
    ((_, (through, step)),) = groups
    assert through.value == "2, listed"
    assert step.lines[0].at == "9.00,8.00"
