"""A drawing of several layers that enclose nothing together names the layers that are a way on; each way works."""

import re

import numpy as np
import pytest
import shapely
from shapely import LineString

from pipeline.errors import InputError
from pipeline.geometry.outline.enclosure import enclose_workings
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from tests.survey.shape_files import write_shapes

OTHERS = {
    "roads": [LineString([(-400, -400), (-400, 400)])],
    "power": [LineString([(800, -300), (800, 300)])],
    "fence": [LineString([(-900, 0), (-900, 40)])],
    "rivers": [LineString([(1200, 0), (1300, 500)])],
    "tracks": [LineString([(0, 900), (400, 900)])],
}
WALLS = [LineString([(0, 0), (200, 0)]), LineString([(0, 5), (200, 5)])]
AXES = [LineString([(0, 0), (400, 0)]), LineString([(200, 0), (200, 300)])]


def write(path, layers):
    for number, (name, lines) in enumerate(layers.items()):
        moved = [shapely.transform(line, lambda p: np.add(p, [500_000, 5_000_000])) for line in lines]
        write_shapes(path, moved, "EPSG:32633", layer=name, append=number > 0)
    return path


def test_the_layer_whose_walls_enclose_a_drift_is_named_with_its_gap_and_the_advice_works(tmp_path):
    path = write(tmp_path / "mine.gpkg", OTHERS | {"walls": WALLS})
    with pytest.raises(InputError, match=r"its 6 layers .* enclose nothing as one plan") as refused:
        detect_survey(path)
    layer, snap, area = re.search(r"--layer '(\w+)' --snap (\d+) reads (\d+) m2", str(refused.value)).groups()
    assert (layer, area) == ("walls", "1000")
    found = detect_survey(path, StatedOptions(layers=[layer], snap_m=float(snap)))
    assert found.width_m == pytest.approx(2 * 1000 / 410, abs=0.01)


def test_where_no_layer_encloses_anything_their_lines_are_listed_as_centrelines_and_the_advice_works(tmp_path):
    path = write(tmp_path / "mine.gpkg", OTHERS | {"axes": AXES})
    with pytest.raises(InputError, match=r"none of its 6 layers encloses an area; --half-width M") as refused:
        detect_survey(path)
    assert "--snap" not in str(refused.value)
    assert "'roads' with 800 m, 'axes' with 700 m" in str(refused.value)
    found = detect_survey(path, StatedOptions(layers=["axes"], half_width_m=2.0))
    assert found.width_m == pytest.approx(4.0, abs=0.05)


def test_a_gap_that_is_wider_than_any_snap_is_told_without_that_option():
    for gap in (6.0, 310.0):
        walls = [LineString([(0, 0), (900, 0)]), LineString([(0, gap), (900, gap)])]
        with pytest.raises(
            Exception, match=r"6\.00 m apart.*--snap M" if gap < 10 else r"310\.00 m and more apart.*at most 10 m"
        ):
            enclose_workings(walls, 0.25, [])


def test_a_system_in_feet_is_not_given_up_for_another_unit(tmp_path):
    """Walls with a gap, which a smaller unit would close."""
    moved = [shapely.transform(line, lambda p: np.add(p, [2_700_000, 250_000])) for line in WALLS]
    path = write_shapes(tmp_path / "mine.gpkg", moved, "EPSG:2272")
    with pytest.raises(InputError, match="enclose nothing") as refused:
        detect_survey(path)
    assert "--unit" not in str(refused.value)
