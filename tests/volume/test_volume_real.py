"""A real survey's floors: Wheal Pell had steps of up to 5 cm where legs meet."""

import pytest

from benchmarks.comparisons.volume.cases import CASES
from pipeline.geometry.facets.crossings import crossing_facets
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors


@pytest.mark.slow
def test_the_floors_of_wheal_pell_follow_its_survey_without_a_step(tmp_path):
    network = CASES["pell"].network(tmp_path)
    volume = solve_floors(network)
    found = measure_floor(volume, network)
    assert max(found.way_step_m, found.step_m, found.other_step_m) < 0.01
    assert found.error_m < 0.01
    assert found.share_built > 0.99
    assert len(crossing_facets(volume.vertices, volume.faces, 1e-6)) == 0
