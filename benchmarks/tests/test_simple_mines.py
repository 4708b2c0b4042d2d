"""The simplest mines that a newcomer draws: what they are, and that they pass with rock."""

import ezdxf.filemanagement
import pytest
import shapely

from benchmarks.simple_mines import KINDS, judge, random_mine


def test_kinds_take_turns_and_every_outline_is_one_valid_polygon_of_the_stated_size():
    mines = [random_mine(seed) for seed in range(60)]
    assert [mine.kind for mine in mines[:6]] == list(KINDS)
    for mine in mines:
        assert isinstance(mine.outline, shapely.Polygon)
        assert mine.outline.is_valid
        assert 1.6 <= mine.width_m <= 12
        assert mine.length_m <= 400
        assert len(mine.outline.interiors) == (mine.kind == "ring")
    assert {mine.unit for mine in mines} == {"m", "ft", "mm"}
    assert {mine.suffix for mine in mines} == {".dxf", ".geojson"}


def test_a_drawing_is_written_in_its_own_unit(tmp_path):
    mine = next(m for m in map(random_mine, range(60)) if (m.unit, m.suffix) == ("ft", ".dxf"))
    assert mine.write(tmp_path)[0] == "--from"
    drawing = ezdxf.filemanagement.readfile(tmp_path / "mine.dxf")
    assert drawing.header["$INSUNITS"] == 2
    (line,) = drawing.modelspace().query("LWPOLYLINE").entities[:1]
    drawn = shapely.Polygon([point[:2] for point in line.get_points()])
    assert drawn.area * 0.3048**2 == pytest.approx(shapely.Polygon(mine.outline.exterior).area, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [56, 3, 6])  # a survey with heights, a ring, a box: short ones
def test_a_simple_mine_passes_with_its_rock(seed):
    row = judge(seed)
    assert row["exit_code"] == 0, row
