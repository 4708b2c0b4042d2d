"""Visible rock leaves the width of a mine's narrowest passages, however wide they are."""

import numpy as np
import pytest
import shapely

from pipeline.geometry.network.skeleton import trace_network
from pipeline.metrics.clearance import measure_walls
from pipeline.surface.build import build_rough_surface, lay_rough_lattice
from pipeline.surface.reference import measure_sources
from pipeline.surface.relief_source import choose_relief
from pipeline.surface.roughness_report import wall_section
from tests.composed import compose


def gaps_of(outline, own):
    """Return the gaps of walls at robot height, from a coarse surface of an own mine."""
    network = trace_network(outline, 0.25, 2.0, 3.0)
    lattice = lay_rough_lattice(own, outline, network, 3.5)
    rough = build_rough_surface(own, lattice, choose_relief(own, measure_sources(own), lattice))
    return measure_walls(np.concatenate(list(wall_section(rough).values())), outline, network)


@pytest.fixture(scope="module")
def own():
    return compose(["+mine=own", "surface.rough.spacing_m=0.2", "surface.rough.roof_spacing_m=0.5"]).surface


@pytest.mark.parametrize("width_m", [1.6, 3.0, 4.6, 5.0, 8.0, 12.0])
def test_a_drift_of_any_width_keeps_95_percent_of_it(own, width_m):
    gaps = gaps_of(shapely.box(0, 0, 70, width_m), own)
    assert gaps.narrowest_kept >= 0.95
    assert gaps.gap_median_m <= 0.15


def test_a_wide_drift_beside_a_narrow_one_has_the_relief_of_wide_drifts(own):
    wide = shapely.box(0, 0, 60, 5)
    alone, beside = (gaps_of(outline, own) for outline in (wide, wide.union(shapely.box(60, 1, 90, 4))))
    assert beside.median_kept < alone.median_kept
    assert beside.narrowest_kept >= 0.95
