"""Vector drawings that show more than walls."""

import itertools

import ezdxf
import pytest
import shapely
from shapely import LineString, box

from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from tests.mines import RING, TEE


def save(path, mine, frames=1, grid=True, one_layer=False):
    """Write a DXF drawing in metres of a mine's walls, with frames round them and a grid."""
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    space = drawing.modelspace()

    def draw(points, layer, closed=True):
        space.add_lwpolyline(points, close=closed, dxfattribs={"layer": "0" if one_layer else layer})

    for ring in (mine.exterior, *mine.interiors):
        draw(list(ring.coords)[:-1], "WALLS")
    for k in range(frames):
        draw(list(box(-20 + k, -20 + k, 110 - k, 70 - k).exterior.coords)[:-1], "FRAME")
    for x in range(0, 101, 20) if grid else ():
        draw([(x, -15), (x, 65)], "GRID", closed=False)
    drawing.saveas(path)


@pytest.mark.parametrize(
    ("shown", "message"),
    [
        ({}, "with a frame and 6 lines of a grid; --layer NAME, .* layers: FRAME, GRID, WALLS$"),
        ({"grid": False}, "with a frame; --layer NAME"),
        ({"frames": 0}, "with 6 lines of a grid; --layer NAME"),
        ({"one_layer": True}, "all its lines are on one layer: save the walls alone, or give a PDF or a picture"),
        ({"one_layer": True, "grid": False, "frames": 2}, "with a frame; all its lines are on one layer"),
    ],
)
def test_a_drawing_with_more_than_walls_is_refused_with_what_settles_it(tmp_path, shown, message):
    path = tmp_path / "drawing.dxf"
    save(path, TEE, **shown)
    with pytest.raises(InputError, match=f"drawing.dxf: looks like a drawing .*{message}"):
        detect_survey(path)


def test_the_stated_layer_of_a_drawing_holds_the_walls(tmp_path):
    path = tmp_path / "drawing.dxf"
    save(path, TEE)
    found = detect_survey(path, StatedOptions(layers=["WALLS"]))
    assert found.values["layers"] == ["WALLS"]
    assert found.width_m == pytest.approx(2 * TEE.area / TEE.length)


def test_a_rectangular_mine_with_a_pillar_is_read_whole(tmp_path):
    path = tmp_path / "mine.dxf"
    save(path, RING, frames=0, grid=False)
    assert detect_survey(path).width_m == pytest.approx(2 * RING.area / RING.length)


def test_a_mine_drawn_with_single_lines_is_no_grid(tmp_path):
    drawing = ezdxf.new(units=6)
    corners = list(TEE.exterior.coords)
    for start, end in itertools.pairwise(corners):
        drawing.modelspace().add_line(start, end)
    drawing.saveas(tmp_path / "mine.dxf")
    assert detect_survey(tmp_path / "mine.dxf").width_m == pytest.approx(2 * TEE.area / TEE.length)


@pytest.mark.parametrize("cut_m", [0.0, 0.1])
def test_lines_whose_ends_nearly_meet_are_no_grid(tmp_path, cut_m):
    fork = shapely.union_all([box(0, 0, 60, 5), box(0, 20, 60, 25), box(-5, 0, 0, 25)])
    drawing = ezdxf.new(units=6)
    for side in itertools.pairwise(fork.exterior.coords):
        line = LineString(side)
        ends = [line.interpolate(cut_m), line.interpolate(line.length - cut_m)]
        drawing.modelspace().add_line(*[(end.x, end.y) for end in ends])
    drawing.saveas(tmp_path / "mine.dxf")
    assert detect_survey(tmp_path / "mine.dxf").width_m == pytest.approx(2 * fork.area / fork.length, rel=0.02)
