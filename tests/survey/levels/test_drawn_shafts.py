"""Lines of a drawing that are too steep to drive: axes of shafts, or walls."""

import numpy as np
import pytest

from pipeline.survey.detect import detect_here
from pipeline.survey.levels.walls import axis_of, split_steep
from tests.survey.levels.test_drawn_levels import DROP_M, MINE, closed, down, drawn, write


def test_both_walls_of_a_ramp_are_walls_however_steep_and_one_is_none():
    walls = [(np.array([(0, y, 0), (20, y, -9.0)]), "ramp") for y in (0.0, 4.0)]
    assert split_steep(walls) == (walls, [])
    rest, (axis,) = split_steep(walls[:1])
    assert rest == []
    np.testing.assert_array_equal(axis, walls[0][0])


def test_walls_with_a_steep_step_are_no_axis():
    assert axis_of(np.array(closed(down([(80, 0), (127, 0), (127, 20)])))) is None
    assert axis_of(np.array([(0, 0, 0), (30, 0, 0), (31, 0, -4), (60, 0, -4)])) is None
    assert axis_of(np.array([(0, 0, 0), (0.5, 0, -0.9)])) is None


def test_a_steep_line_across_one_plan_is_no_wall_of_it(tmp_path, capsys):
    """With a seed the walls of the drift, which is on a slope, are read as one plan; the line crosses it."""
    sloping = closed([(x, y, 0.05 * x) for x, y in [(0, 0), (80, 0), (80, 5), (0, 5)]])
    path = write(tmp_path / "mine.dxf", {"walls": [sloping], "line": [[(40, -9, 30), (41, 9, 0)]]})
    found = drawn(path, seeds_m=[(5.0, 2.5)])
    assert found.workings.area == pytest.approx(400)
    assert max(z for *_, z in found.heights.spots) + found.heights.datum_m < 405
    said = capsys.readouterr().err
    assert (
        "1 lines too steep to drive are left out, as the walls are read as one plan; the first at (40.0, -9.0)" in said
    )


def test_levels_with_many_raises_are_not_taken_for_centrelines(tmp_path):
    raises = [[(x, 2.5, 0), (x + 8, 2.5, -DROP_M)] for x in range(5, 25)] * 5
    path = write(
        tmp_path / "mine.dxf",
        {**MINE, "shafts": [[(x, y + k / 99, z) for x, y, z in line] for k, line in enumerate(raises)]},
    )
    assert detect_here(str(path), {}).values["has_heights"]
