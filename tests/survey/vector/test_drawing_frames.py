"""Vector drawings that show more than walls."""

import itertools
import json

import ezdxf
import pytest
import shapely
from shapely import LineString, box

from minesurveys.vector.shapes import Shapes
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from pipeline.survey.vector.drawing_frames import require_no_boundary
from tests.mines import RING, TEE
from tests.survey.shape_files import write_shapes


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
        ({}, "with a frame on layer 'FRAME' and 6 lines of a grid; --layer NAME, .* layers: FRAME, GRID, WALLS$"),
        ({"grid": False}, "with a frame on layer 'FRAME'; --layer NAME"),
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


ROOM = box(0, 0, 60, 40)
PILLARS = [box(x, y, x + 9, y + 8) for x in (6, 21, 36) for y in (6, 20)]


def save_rings(path, **layers):
    """Write a DXF drawing in metres with the closed lines of each layer."""
    drawing = ezdxf.new(units=6)
    for layer, areas in layers.items():
        for area in areas:
            points = list(area.exterior.coords)[:-1]
            drawing.modelspace().add_lwpolyline(points, close=True, dxfattribs={"layer": layer})
    drawing.saveas(path)
    return path


def test_a_rectangular_mine_whose_pillars_are_on_another_layer_is_read_as_on_one(tmp_path, capsys):
    one = detect_survey(save_rings(tmp_path / "one.dxf", WALLS=[ROOM, *PILLARS]))
    two = detect_survey(save_rings(tmp_path / "two.dxf", WALLS=[ROOM], PILLARS=PILLARS))
    told = capsys.readouterr().err
    assert "two.dxf: the rectangle on layer 'WALLS' is read as the wall round pillars; --layer chooses" in told
    assert "one.dxf: the rectangle" not in told
    free = ROOM.difference(shapely.union_all(PILLARS))
    assert one.width_m == two.width_m == pytest.approx(2 * free.area / free.length)


@pytest.mark.parametrize(
    "layers",
    [
        {"FRAME": [box(-60, -60, 170, 140)], "WALLS": [ROOM], "PILLARS": PILLARS},  # a frame round a mine
        {"FRAME": [box(-60, -60, 170, 140)], "WALLS": [TEE, box(0, 60, 60, 65), box(0, 80, 60, 85)]},  # three levels
        {"FRAME": [box(-9, -9, 69, 49)], "WALLS": [ROOM]},  # the room may be a pillar in the frame
        {"FRAME": [ROOM], "WALLS": [PILLARS[0], shapely.affinity.translate(PILLARS[0], 4, 4)]},  # they overlap
    ],
)
def test_a_rectangle_round_what_is_no_row_of_pillars_stays_a_frame_whose_layer_is_named(tmp_path, layers):
    path = save_rings(tmp_path / "mine.dxf", **layers)
    with pytest.raises(InputError, match=r"a frame on layer 'FRAME'; --layer NAME, .* layers: FRAME, .*WALLS$"):
        detect_survey(path)
    assert detect_survey(path, StatedOptions(layers=["WALLS"])).values["layers"] == ["WALLS"]


def test_a_frame_round_a_mine_with_pillars_is_noticed_on_one_layer(tmp_path):
    path = save_rings(tmp_path / "mine.dxf", WALLS=[box(-20, -20, 110, 70), ROOM, *PILLARS])
    with pytest.raises(InputError, match="with a frame; all its lines are on one layer: save the walls alone"):
        detect_survey(path)


LEASE = shapely.Polygon([(-30, -20), (120, -30), (130, 70), (-20, 80)])


def save_layers(path, **layers):
    """Write a GeoPackage in metres with the areas of each layer."""
    for name, areas in layers.items():
        write_shapes(path, areas, "EPSG:32632", layer=name)
    return path


def test_geodata_with_the_boundary_of_a_lease_names_the_layers(tmp_path):
    path = save_layers(tmp_path / "mine.gpkg", drifts=[TEE], lease=[LEASE])
    with pytest.raises(InputError, match=r"an area of layer 'lease' encloses .*--layer NAME, .*: drifts, lease$"):
        detect_survey(path)
    assert detect_survey(path, StatedOptions(layers=["drifts"])).width_m == pytest.approx(2 * TEE.area / TEE.length)
    features = [
        {"type": "Feature", "properties": {"layer": name}, "geometry": shapely.geometry.mapping(area)}
        for name, area in (("drifts", TEE), ("lease", LEASE))
    ]
    path = tmp_path / "mine.geojson"
    path.write_text(json.dumps({"note": "metres", "type": "FeatureCollection", "features": features}))
    with pytest.raises(InputError, match=r"--layer NAME, once for each layer with walls, .*: drifts, lease$"):
        detect_survey(path)


def test_drifts_that_hold_shafts_and_levels_over_each_other_are_no_boundary(tmp_path):
    shafts = [TEE.intersection(TEE.boundary.interpolate(k / 3, normalized=True).buffer(1.5)) for k in range(3)]
    path = save_layers(tmp_path / "shafts.gpkg", drifts=[TEE], shafts=shafts)
    assert detect_survey(path).width_m == pytest.approx(2 * TEE.area / TEE.length, rel=0.01)
    low, high = (shapely.force_3d(area, z) for area, z in ((box(0, 0, 60, 40), 0.0), (box(5, 5, 40, 30), 20.0)))
    require_no_boundary(path, Shapes([low, high], layer_of=["low", "high"]))
    with pytest.raises(InputError, match="'low' encloses"):
        require_no_boundary(path, Shapes([low, shapely.force_2d(high)], layer_of=["low", "high"]))


@pytest.mark.parametrize(
    ("mine", "refused"),
    [
        ([[(10, 10), (30, 22)], [(30, 22), (61, 64)]], True),
        ([[(10, 10), (30, 22)], [(30, 22), (50, 64)]], False),  # a drift that ends at one of the others
        (
            [[(0, 20), (120, 20)], [(0, 80), (120, 80)]],
            False,
        ),  # drifts along one axis on one layer, along the other on two
        ([[(10, 10), (61, 64)], [(-40, 90), (260, 210)]], False),  # they are shorter than six tenths of the drawing
    ],
)
def test_a_layer_of_lines_across_centrelines_that_meets_none_is_a_grid(tmp_path, mine, refused):
    path, drawing = tmp_path / "a.dxf", ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    for layer, lines in (("DRIFTS", mine), ("OTHERS", [[(0, 50), (130, 50)], [(50, 0), (50, 118)]])):
        for line in lines:
            drawing.modelspace().add_lwpolyline(line, dxfattribs={"layer": layer})
    drawing.saveas(path)
    if not refused:
        assert detect_survey(path, StatedOptions(half_width_m=1.0)).values["layers"] is None
        return
    with pytest.raises(InputError, match=r"a grid: 2 straight lines .* 'OTHERS', .*--layer NAME, .*: DRIFTS, OTHERS$"):
        detect_survey(path, StatedOptions(half_width_m=1.0))
    for layers in (["DRIFTS"], ["DRIFTS", "OTHERS"]):
        assert detect_survey(path, StatedOptions(half_width_m=1.0, layers=layers)).values["layers"] == layers
