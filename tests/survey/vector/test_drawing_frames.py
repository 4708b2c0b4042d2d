"""Vector drawings that show more than walls."""

import itertools
import json

import ezdxf
import numpy as np
import pyogrio
import pytest
import shapely
from shapely import LineString, box

from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from pipeline.survey.vector.drawing_frames import require_no_boundary
from pipeline.survey.vector.shapes import Shapes
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


LEASE = shapely.Polygon([(-30, -20), (120, -30), (130, 70), (-20, 80)])


def save_layers(path, **layers):
    """Write a GeoPackage in metres with the areas of each layer."""
    for name, areas in layers.items():
        shapes = shapely.to_wkb(np.array(areas, object))
        pyogrio.raw.write(path, shapes, [], [], layer=name, geometry_type="Polygon", crs="EPSG:32632")
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
