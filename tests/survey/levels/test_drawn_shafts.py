"""Lines of a drawing that are too steep to drive: shafts between its levels, or defects with their places."""

import numpy as np
import pytest

from pipeline.survey.detect import detect_here
from pipeline.survey.levels.walls import axis_of, split_steep
from tests.survey.levels.test_drawn_levels import DROP_M, LOWER, MINE, at, closed, down, drawn, write

LEANING = [(15, 2.5, 0), (23, 2.5, -DROP_M)]
ROOF_M, PLUMB_M = 3.5, 0.5


def places(heights):
    """Return where the upper ends of shafts are in the mine frame."""
    plan = [shaft.below if shaft.sheet is None else shaft.sheet for shaft in heights.shafts]
    return [
        np.subtract(shaft.place_m, heights.offset_m[k]).tolist() for shaft, k in zip(heights.shafts, plan, strict=True)
    ]


@pytest.mark.parametrize("suffix", [".dxf", ".gpkg"])
def test_a_leaning_line_between_two_levels_is_a_shaft_that_follows_it(tmp_path, suffix):
    workings, heights = drawn(write(tmp_path / f"mine{suffix}", {**MINE, "shafts": [LEANING]}))
    (shaft,) = heights.shafts
    assert places(heights) == [[15, 2.5]]
    assert (shaft.top_m, shaft.bottom_m, shaft.sheet == shaft.below) == (DROP_M, 0, False)
    np.testing.assert_allclose(shaft.bends_m, [(0, 0, DROP_M - PLUMB_M), (8, 0, ROOF_M + PLUMB_M)], atol=1e-3)
    without, _ = drawn(write(tmp_path / f"without{suffix}", MINE))
    assert workings.equals(without)


@pytest.mark.parametrize(
    "layers",
    [
        {"shafts": [LEANING[::-1]]},
        {"shafts": [LEANING, LEANING[::-1]]},
        {"shafts": [[(12, 2.5, 0), *LEANING, (26, 2.5, -DROP_M)]]},
        {"shafts": [], "upper": [*MINE["upper"], LEANING]},
    ],
    ids=["from below", "twice", "led to along the drifts", "on a level's layer"],
)
def test_a_leaning_line_is_one_shaft_however_it_is_drawn(tmp_path, layers):
    workings, heights = drawn(write(tmp_path / "mine.dxf", MINE | layers))
    (shaft,) = heights.shafts
    assert (places(heights), len(shaft.bends_m)) == ([[15, 2.5]], 2)
    assert workings.area == pytest.approx(1750, abs=0.01)


def test_a_bend_of_a_line_is_a_bend_of_its_shaft(tmp_path):
    way = [(15, 2.5, 0), (17, 2.5, -5), (24, 2.5, -DROP_M)]
    _, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "shafts": [way]}))
    np.testing.assert_allclose(heights.shafts[0].bends_m, [(0, 0, 11.5), (2, 0, 7), (9, 0, 4)], atol=1e-3)


def test_a_line_within_20_deg_of_plumb_is_a_plumb_shaft_about_its_upper_end(tmp_path):
    _, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "shafts": [[(20, 2.5, 0), (22, 2.5, -DROP_M)]]}))
    (shaft,) = heights.shafts
    assert (places(heights), shaft.bends_m) == ([[20, 2.5]], ())


def test_ends_within_the_drifts_meet_their_floors(tmp_path):
    """The line begins a metre over the upper floor and ends at the roof of the lower drift."""
    _, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "shafts": [[(15, 2.5, 1.0), (23, 2.5, ROOF_M - DROP_M)]]}))
    (shaft,) = heights.shafts
    assert (shaft.top_m, shaft.bottom_m) == (DROP_M, 0)
    np.testing.assert_allclose(places(heights)[0], (15 + 8 / 9.5, 2.5), atol=0.01)
    np.testing.assert_allclose(shaft.bends_m[-1], (8 - 8 / 9.5, 0, ROOF_M + PLUMB_M), atol=0.01)


def test_a_line_through_three_levels_is_a_shaft_between_each_two(tmp_path):
    cellar = closed(at(LOWER, -2 * DROP_M))
    ramps = [MINE["ramp"][0], [(x, y, z - DROP_M) for x, y, z in MINE["ramp"][0]]]
    line = [(10, 2.5, 0), (24, 2.5, -2 * DROP_M)]
    layers = {**MINE, "cellar": [cellar], "ramp": ramps, "shafts": [line]}
    _, heights = drawn(write(tmp_path / "mine.dxf", layers))
    upper, lower = heights.shafts
    assert upper.below == lower.sheet
    assert [(shaft.top_m, shaft.bottom_m) for shaft in (upper, lower)] == [(24, 12), (12, 0)]
    np.testing.assert_allclose(places(heights), [(10, 2.5), (17, 2.5)], atol=0.01)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            [(15, 2.5, 0), (23, 12.5, -DROP_M)],
            "1 shafts are left out, the first at (15.0, 2.5) from 400.0 to 388.0 m, which leans, and its lower end is "
            "on no floor",
        ),
        ([(20, 12.5, 9), (15, 2.5, 0)], "(20.0, 12.5) from 409.0 to 400.0 m, which leans, and its upper end is on no"),
        ([(15, 20, 0), (23, 20, -DROP_M)], "(15.0, 20.0) from 400.0 to 388.0 m, whose ends are on no floor"),
        ([(10, 2.5, 0), (35, 2.5, -DROP_M)], "(10.0, 2.5) from 400.0 to 388.0 m, which leans by 25.0 m over 7.5 m"),
        (
            [(15, 2.5, 0), (23, 2.5, -8), (15, 2.5, -4), (15, 2.5, -DROP_M)],
            "1 inclined lines of layer 'shafts' are neither walls nor the axis of one shaft, and are left out, the "
            "first at (15.0, 2.5) from 400.0 to 388.0 m",
        ),
        ([(10, 2.5, 0), (45, 2.5, -DROP_M)], "the first at (10.0, 2.5) from 400.0 to 388.0 m: the open walls of"),
    ],
    ids=["ends beside", "begins beside", "nowhere near", "too flat between drifts", "up and down", "drivable"],
)
def test_an_inclined_line_that_is_no_shaft_is_listed_with_its_place_and_not_built(tmp_path, capsys, line, told):
    workings, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "shafts": [line]}))
    assert heights.shafts == []
    assert workings.area == pytest.approx(1750, abs=0.01)
    assert told in capsys.readouterr().err


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


def test_a_level_alone_has_the_raises_that_are_drawn_over_it(tmp_path):
    workings, heights = drawn(
        write(tmp_path / "mine.dxf", {"upper": MINE["upper"], "up": [[(20, 2.5, 0), (20, 2.5, 20)]]})
    )
    (up,) = heights.shafts
    assert (up.sheet, up.below, up.top_m - up.bottom_m, places(heights)) == (None, 0, 20, [[20, 2.5]])
    assert workings.area == pytest.approx(575, abs=0.01)


def test_a_steep_line_across_one_plan_is_no_wall_of_it(tmp_path, capsys):
    """The drift is on a slope and lies over nothing; the line crosses it."""
    sloping = closed([(x, y, 0.05 * x) for x, y in [(0, 0), (80, 0), (80, 5), (0, 5)]])
    workings, heights = drawn(write(tmp_path / "mine.dxf", {"walls": [sloping], "line": [[(40, -9, 30), (41, 9, 0)]]}))
    assert workings.area == pytest.approx(400)
    assert heights.shafts == []
    assert max(z for *_, z in heights.spots) + heights.datum_m < 405
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
