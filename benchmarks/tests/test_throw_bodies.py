"""Bodies thrown all over a volume: every facet is a target, a run goes on, and a missing wall lets them out."""

import dataclasses

import numpy as np
import pytest

from benchmarks.comparisons.volume import throw_bodies
from benchmarks.comparisons.volume.throw_bodies import mine_of, table_of, throw_everywhere
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.world.proof.region import regions_over


@pytest.fixture(scope="module")
def tee(tmp_path_factory):
    return mine_of("tee", tmp_path_factory.mktemp("tee"))


def test_each_facet_is_a_target_in_one_region_with_the_parts_about_it(tee):
    regions = list(regions_over(tee.volume, tee.parts, 60))
    assert len(regions) > 1
    assert (sum(region.targets.astype(int) for region in regions) == 1).all()
    for region in regions:
        behind = [facet for part in region.parts for facet in part.facets]
        assert region.targets.any()
        assert np.isin(np.flatnonzero(region.targets), behind).all()


def test_no_body_gets_out_of_a_t_a_ball_is_pushed_at_each_facet_and_a_second_run_reads_what_the_first_one_kept(
    tee, tmp_path, monkeypatch
):
    kept = tmp_path / "regions.jsonl"
    rows = throw_everywhere(tee, kept, 2000, 500)
    assert sum(row["robots"]["contacts"] for row in rows) >= 2000
    assert [row[kind]["escapes"] for row in rows for kind in ("robots", "balls")] == [0, 0] * len(rows)
    assert sum(row["balls"]["facets"] for row in rows) > 0.9 * len(tee.volume.faces)
    monkeypatch.setattr(throw_bodies, "throw_robots", None)
    assert throw_everywhere(tee, kept, 2000, 500) == rows
    assert table_of(rows).count("\n") >= 3


def test_bodies_get_out_where_walls_have_no_parts(tee, tmp_path):
    shut = [part for part in tee.parts if tee.volume.label[part.facets[0]] != FacetLabel.WALL]
    rows = throw_everywhere(dataclasses.replace(tee, parts=shut), tmp_path / "regions.jsonl", 20_000, 500)
    assert sum(row["balls"]["escapes"] for row in rows) > 0
    assert sum(row["robots"]["escapes"] for row in rows) > 0
