"""Families of worlds: seeds of the splits, errors of variants, and builds over cores and a cluster."""

import json

import numpy as np
import pytest
import shapely

from pipeline.build import family
from pipeline.build.family import STYLES, Member, generated, make_family, variants
from pipeline.errors import GeometryError, LimitError
from pipeline.geometry.generate import generate_workings
from pipeline.geometry.perturb import displace, perturb_workings
from tests.mines import RING, TEE
from tests.project import ROOT

SHAPE = {
    "size_m": (60.0, 90.0),
    "width_m": (4.0, 6.0),
    "loops": 0.5,
    "dead_ends": 0.3,
    "rib_noise_m": 0.15,
    "pillar_m": 8.0,
    "spacing_m": 24.0,
    "wander": 0.5,
}


def generate(style, seed, **changed):
    return generate_workings(style=style, rng=np.random.default_rng(seed), **{**SHAPE, **changed})


@pytest.mark.parametrize("style", STYLES)
def test_a_procedural_mine_is_connected_and_the_same_for_the_same_seed(style):
    for seed in range(12):
        mine = generate(style, seed)
        assert mine.is_valid
        assert len(mine.geoms) == 1
        assert mine.equals_exact(generate(style, seed), 0)
    assert not mine.equals(generate(style, 99))


@pytest.mark.parametrize("style", STYLES)
def test_drifts_have_the_given_width(style):
    for seed in range(4):
        mine = generate(style, seed, width_m=(4.0, 4.2), rib_noise_m=0.0)
        assert mine.buffer(-1.9).area > 0
        if style != "cave":  # a cave has chambers
            assert mine.buffer(-2.11, join_style="mitre").area < 0.15 * mine.area  # only junctions are wider


def test_more_crosscuts_make_more_loops():
    few, many = (
        sum(len(generate("drift_and_crosscut", s, loops=share, dead_ends=1.0).geoms[0].interiors) for s in range(6))
        for share in (0.0, 1.0)
    )
    assert few == 0
    assert many > 50


def test_rock_too_thin_to_stand_is_removed():
    for seed in range(8):
        (mine,) = generate("drift_and_crosscut", seed, spacing_m=12.0).geoms
        pillars = [shapely.Polygon(ring) for ring in mine.interiors]
        assert all(pillar.buffer(-0.5).area > 0 for pillar in pillars)


def test_a_variant_keeps_the_network_and_is_within_the_errors():
    distances = []
    for seed in range(20):
        perturbed = perturb_workings(RING, 0.3, 0.1, 20.0, np.random.default_rng(seed))
        assert len(perturbed.geoms) == 1
        assert len(perturbed.geoms[0].interiors) == 1
        distances.append(RING.exterior.hausdorff_distance(perturbed.geoms[0].exterior))
    assert 0.2 < np.mean(distances) < 1.5
    moved = [displace(TEE, 0.3, 40.0, np.random.default_rng(s)).exterior.coords[0] for s in range(400)]
    np.testing.assert_allclose(np.std(moved, axis=0), 0.3, rtol=0.15)


def test_errors_that_would_fold_a_plan_or_close_a_drift_are_refused():
    with pytest.raises(GeometryError, match="would fold the plan"):
        displace(TEE, 3.0, 5.0, np.random.default_rng(0))
    with pytest.raises(GeometryError, match="closes or opens a drift"):
        perturb_workings(RING, 0.0, 30.0, 20.0, np.random.default_rng(3))


def test_a_ring_stays_closed_whatever_its_length():
    """A matrix product may round equal rows differently, which is visible at the origin."""
    for length in range(10, 400, 10):
        ring = shapely.Polygon([(0, 0), (length, 0), (length, 5), (0, 5)])
        assert displace(ring, 0.3, 8.0, np.random.default_rng(length)).exterior.is_closed


def test_splits_share_no_seed_and_styles_alternate(monkeypatch):
    monkeypatch.chdir(ROOT)
    seeds = [m.seed for split in ("train", "validation", "test") for m in generated(split, 100, [])]
    assert len(set(seeds)) == 300
    assert [m.style for m in generated("train", 5, [])] == [*STYLES, STYLES[0]]
    world_params = {"compile3d.height_m": 2.8, "survey.entrance_m": [1.0, 2.0]}
    members = variants("x", ROOT / "data/x.geojson", "test", 5, 0.1, world_params, [])
    heights = [float(m.overrides[-1].partition("=")[2]) for m in members]
    assert len(set(heights)) == 5
    assert np.mean(heights) == pytest.approx(2.8, abs=0.2)
    assert all("survey.entrance_m=[1.0,2.0]" in m.overrides for m in members)


def broken_member():
    return Member("broken", "test", 1, "cave", ["survey=procedural", "survey.mine.style=maze"])


def test_a_world_that_cannot_be_built_is_in_the_manifest_with_its_problem(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(family, "FAMILIES", tmp_path)
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    with pytest.raises(LimitError, match=r"1 of 1 worlds failed, broken: ParamsError: survey\.mine\.style = 'maze'"):
        make_family([broken_member()], 1, lambda done, count: done)
    (record,) = json.loads((tmp_path / "manifest.json").read_text()).values()
    assert record["world_sha256"] is None
    assert "maze" in record["problem"]


@pytest.mark.slow
def test_a_cluster_builds_what_cores_build(monkeypatch, tmp_path):
    pytest.importorskip("ray", reason="Ray comes with `make setup-baselines`")
    from ray.cluster_utils import Cluster

    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(family, "FAMILIES", tmp_path)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    try:
        with pytest.raises(LimitError, match=r"ParamsError: survey\.mine\.style = 'maze'"):
            make_family([broken_member()], 1, lambda done, count: done)
    finally:
        import ray

        ray.shutdown()
        cluster.shutdown()
