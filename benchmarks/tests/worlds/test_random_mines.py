"""Random mines through stages 2 to 6 in memory: they stay valid and connected, and the certificate holds."""

import numpy as np
import pytest

from benchmarks.worlds.random_mines import holds, judge
from pipeline.metrics.iou import intersection_over_union
from pipeline.metrics.topology import compare_topology
from pipeline.mjcf.bundle import open_bundle
from pipeline.mjcf.render import render_free_space
from pipeline.proof.certificate import certify, measure_containment
from tests.composed import compose
from tests.mines import COARSE_ROCK, BuiltMine, random_mine


def test_a_random_mine_becomes_a_world_that_matches_its_plan(tmp_path):
    config = compose([*COARSE_ROCK, "surface.texture.size_px=64"])
    built = BuiltMine(random_mine(np.random.default_rng(3), 3), config, tmp_path)
    world = open_bundle(built.bundle)
    assert built.free_space.polygon.is_valid
    rendered = render_free_space(world.model, np.array(world.record.T_world_mine), built.frame, 3.5)
    # A wall's error may reach the tolerance; the mean error must be below half of it.
    polygon, tolerance_m = built.free_space.polygon, config.contours.tolerance_m
    assert intersection_over_union(rendered, built.cleaned) >= 1 - 0.5 * tolerance_m * polygon.length / polygon.area
    match = compare_topology(built.cleaned, rendered, built.frame, 0.25, 2.0)
    assert match.loops_difference == 0
    assert match.components_world == 1
    assert match.drifts_lost == match.drifts_added == 0
    assert built.network.loops == built.free_space.areas.islands
    params = config.validation.certificate.model_copy(update={"contacts": 0})
    limits = {k: v for k, v in params.limits.items() if k not in ("contacts", "escapes", "deepest_m")}
    measured = measure_containment(built.bundle, world, built.free_space, params, (0.25, 2.0))
    certificate = certify(world.record.world_sha256, measured, limits)
    assert certificate.holds, {name: clause for name, clause in certificate.clauses.items() if not clause.holds}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))  # a style each
def test_a_picture_of_a_random_mine_passes_all_checks(seed):
    row = judge(seed)
    assert holds(row), row
