import numpy as np
import pytest

from benchmarks.worlds.deep_mine import deep_mine
from pipeline.geometry.floor.mesh import build_floor
from pipeline.survey.passages.sheets import lay_out_sheets
from pipeline.survey.stations.table import read_station_legs
from tests.heights import table


@pytest.fixture(scope="module")
def legs():
    return deep_mine(8, 10_000.0, 1)


@pytest.mark.slow
def test_levels_under_one_another_lie_in_rows_and_keep_their_heights(legs, tmp_path):
    path = tmp_path / "deep.csv"
    path.write_text(table(legs, 2.5))
    workings, heights = lay_out_sheets(path, read_station_legs(path), 4.0)
    west, south, east, north = workings.bounds
    assert east - west < 2100
    assert north - south < 2100
    assert len(workings.geoms) >= 8
    lines = [np.array(line) for line in heights.lines]
    floor = build_floor(workings, lines, 20.0, heights.offset_m, heights.seams)
    assert len(floor.rows) > 1
    stations = np.concatenate(lines)
    assert np.abs(floor.heights_at(stations[:, :2]) - stations[:, 2]).max() < 0.02
    assert np.ptp(floor.vertices[:, 2]) == pytest.approx(350, abs=5)
    folded = floor.fold(np.column_stack([stations[:, :2], np.zeros(len(stations))]))
    wanted = np.array([place for leg in legs.values() for _, *place in leg])
    apart = np.linalg.norm(folded[:, None, :2] - wanted[None, :, :2], axis=2)
    apart = np.hypot(apart, folded[:, None, 2] + heights.datum_m - wanted[None, :, 2])
    assert apart.min(axis=0).max() < 0.02
