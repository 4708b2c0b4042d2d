"""Bodies thrown all over a volume: every facet is a target, and a missing wall lets them out."""

import dataclasses

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import CASES
from benchmarks.comparisons.volume.random_volumes import mine_of
from benchmarks.comparisons.volume.throw_bodies import throw_everywhere
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.world.proof.region import regions_over


@pytest.fixture(scope="module")
def tee(tmp_path_factory):
    return mine_of(CASES["tee"], tmp_path_factory.mktemp("tee"))


def test_each_facet_is_a_target_in_one_region_with_the_parts_about_it(tee):
    regions = list(regions_over(tee.volume, tee.parts, 60))
    assert len(regions) > 1
    assert (sum(region.targets.astype(int) for region in regions) == 1).all()
    for region in regions:
        behind = [facet for part in region.parts for facet in part.facets]
        assert region.targets.any()
        assert np.isin(np.flatnonzero(region.targets), behind).all()


def test_no_body_gets_out_of_a_t_and_a_ball_is_pushed_at_each_facet(tee):
    robots, balls = throw_everywhere(tee, 500, 500)
    assert robots.contacts >= 500
    assert robots.escapes == balls.escapes == 0
    assert balls.facets > 0.9 * len(tee.volume.faces)


def test_bodies_get_out_where_walls_have_no_parts(tee):
    shut = [part for part in tee.parts if tee.volume.label[part.facets[0]] != FacetLabel.WALL]
    robots, balls = throw_everywhere(dataclasses.replace(tee, parts=shut), 500, 500)
    assert balls.escapes > 0
    assert robots.escapes > 0
