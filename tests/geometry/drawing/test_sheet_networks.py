"""Several sheets in one plan have the network of the workings."""

from __future__ import annotations

import pytest
import shapely
from shapely import MultiPolygon

from pipeline.geometry.floor.sheets import trace_sheets

TRACING = (0.25, 2.0, 3.0)  # cells, the shortest leg, spacing of the stations, m


@pytest.mark.parametrize("stub_m", [0.2, 1.0, 2.0, 6.0])
def test_a_seam_near_a_junction_ends_no_other_drift(stub_m):
    """A drift 4 m wide with a crosscut to its north, which goes on in another sheet after `stub_m`."""
    crosscut = shapely.box(28, 2, 32, 2 + stub_m)
    upper = shapely.union_all([shapely.box(0, -2, 60, 2), crosscut])
    free = MultiPolygon([upper, shapely.box(100, 2 + stub_m, 104, 30)])
    network = trace_sheets(free, [((30.0, 2 + stub_m), (102.0, 2 + stub_m))], *TRACING)
    ends = sorted(network.nodes_m[name] for name in network.dead_ends)
    assert [round(x / 10) for x, _ in ends] == [0, 6, 10]
    assert (len(network.junctions), network.loops, network.components) == (1, 0, 1)
