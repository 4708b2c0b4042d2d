"""Walls of levels in vector files: which areas they enclose, and defects with their places."""

from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon

from pipeline.errors import InputError
from pipeline.params.survey import VectorSurveyParams
from pipeline.survey.detect import detect_here
from pipeline.survey.levels.areas import Area
from pipeline.survey.vector_survey import read_vector_survey
from tests.survey.shape_files import write_shapes

DROP_M, DATUM_M = 12.0, 400.0
UPPER = [(0, 0), (80, 0), (80, 5), (45, 5), (45, 40), (40, 40), (40, 5), (0, 5)]
LOWER = [(0, 0), (80, 0), (80, 20), (75, 20), (75, 5), (45, 5), (45, 40), (40, 40), (40, 5), (0, 5)]
RIGHT, LEFT = [(80, 0), (127.5, 0), (127.5, 20), (80, 20)], [(80, 5), (122.5, 5), (122.5, 15), (80, 15)]
SHAFT = [(20, 2.5, 0), (20, 2.5, -DROP_M)]
WAY = LineString([(80, 2.5), (125, 2.5), (125, 17.5), (80, 17.5)])


def at(points, z):
    return [(x, y, z) for x, y in points]


def down(points, top=0.0):
    """Return the walls of the ramp, which falls evenly from `top` along its way."""
    return [(x, y, top - DROP_M * WAY.project(shapely.Point(x, y), normalized=True)) for x, y in points]


def closed(points):
    return [*points, points[0]]


def turn(radius):
    """Return a wall of a ramp that falls by a whole turn; its end lies under its beginning."""
    angle = np.linspace(0, 2 * np.pi, 37)
    places = radius * np.cos(angle), radius * np.sin(angle) - 40, -DROP_M * angle / angle[-1]
    return [tuple(place) for place in np.column_stack(places).tolist()]


def fork(angle_deg, grade, length=100.0):
    """Return a level, a ramp that leaves it at an angle from the axis of its drift, and a level at the ramp's end.

    The lower level passes under the upper one.
    """
    ahead = np.array([np.cos(np.radians(-angle_deg)), np.sin(np.radians(-angle_deg))])
    left = 2.5 * np.array([-ahead[1], ahead[0]])
    along = np.linspace(0, length, 13)[:, None]
    sides = [np.column_stack([(40, 2.5) + along * ahead + side, -grade * along]).tolist() for side in (left, -left)]
    end, z = (40, 2.5) + length * ahead, -grade * length
    on = end + 40 * ahead
    back = shapely.box(on[0] - 6, on[1] - 2.5, on[0], 60)
    lower = shapely.union_all([Polygon([end + left, on + left, on - left, end - left]), back])
    upper = closed(at([(0, 0), (120, 0), (120, 5), (0, 5)], 0))
    return {
        "upper": [upper],
        "ramp": [closed([*sides[0], *sides[1][::-1]])],
        "lower": [at(lower.exterior.coords, z)],
    }


MINE = {
    "upper": [closed(at(UPPER, 0))],
    "lower": [closed(at(LOWER, -DROP_M))],
    "ramp": [closed(down(RIGHT + LEFT[::-1]))],
    "shafts": [SHAFT],
}


def write(path: Path, layers, lift_m=DATUM_M, flat=()):
    """Write the lines of layers; the layers in `flat` without elevations."""
    lines = [
        (name, shapely.transform(LineString(line), lambda p: np.add(p, [0, 0, lift_m]), include_z=True))
        for name, found in layers.items()
        for line in found
    ]
    if path.suffix == ".dxf":
        drawing = ezdxf.new()
        drawing.header["$INSUNITS"] = 6
        for name, line in lines:
            if name in flat:
                drawing.modelspace().add_lwpolyline([p[:2] for p in line.coords], dxfattribs={"layer": name})
            else:
                drawing.modelspace().add_polyline3d(list(line.coords), dxfattribs={"layer": name})
        drawing.saveas(path)
        return path
    for name in layers:
        shapes = [Polygon(line) if len(line.coords) > 3 else line for layer, line in lines if layer == name]
        write_shapes(path, shapes, layer=name, append=path.exists())
    return path


def drawn(path: Path, **values):
    params = VectorSurveyParams.model_validate({"kind": "vector", "name": "a", "file": "data/x", **values})
    return read_vector_survey(params.model_copy(update={"file": path.as_posix()}))


def area_m2(floors):
    return shapely.area(shapely.polygons(floors.vertices[floors.faces][:, :, :2])).sum()


def test_open_wall_strings_are_closed_where_a_drift_ends(tmp_path):
    """The ramp's walls are two open strings, and the wall of the upper level has a gap at its mouth."""
    gap = at([*UPPER[2:], *UPPER[:2]], 0)
    layers = {**MINE, "upper": [gap], "ramp": [down(RIGHT), down(LEFT)]}
    found = drawn(write(tmp_path / "open.dxf", layers)).shape.mesh
    assert area_m2(found) == pytest.approx(1750, abs=0.01)


def test_layers_without_elevations_take_the_stated_ones(tmp_path, capsys):
    layers = {**MINE, "frame": [closed(at([(-50, -50), (200, -50), (200, 90), (-50, 90)], -DATUM_M))]}
    path = write(tmp_path / "mine.dxf", layers, flat=("upper", "lower", "frame"))
    stated = {"upper": DATUM_M, "lower": DATUM_M - DROP_M}
    assert area_m2(drawn(path, elevations_m=stated).shape.mesh) == pytest.approx(1750, abs=0.01)
    assert "layers without an elevation are left out: frame" in capsys.readouterr().err
    assert detect_here(str(path), {"elevations_m": stated}).values["values"]["elevations_m"] == stated
    with pytest.raises(InputError, match=r"no layer cellar to be at an elevation; there are upper, lower, ramp"):
        drawn(path, elevations_m={"cellar": 0.0})


def test_a_pillar_stays_in_its_level_and_a_room_below_it_in_its_own(tmp_path):
    room = [(0, -30), (40, -30), (40, 0), (0, 0)]
    pillar = [(15, -20), (25, -20), (25, -10), (15, -10)]
    upper = [closed(at(UPPER, 0)), closed(at(room, 0)), closed(at(pillar, 0.2))]
    found = drawn(write(tmp_path / "mine.dxf", {**MINE, "upper": upper})).shape.mesh
    assert area_m2(found) == pytest.approx(1750 + 40 * 30 - 100, abs=0.01)


def test_pillars_of_a_dipping_room_far_from_its_outer_walls_are_pillars(tmp_path):
    """The floor falls by 8 % to the east, so that the pillars in the middle are metres below the nearest outer wall."""
    squares = [shapely.box(x, y, x + 12, y + 12) for x in range(8, 140, 20) for y in range(8, 140, 20)]
    rings = [shapely.box(0, 0, 148, 148).segmentize(4), *squares]
    room = [[(x - 148, y, -0.08 * x - 0.04 * y) for x, y in ring.exterior.coords] for ring in rings]
    found = drawn(write(tmp_path / "mine.dxf", {"room": room})).shape.mesh
    assert area_m2(found) == pytest.approx(148**2 - 144 * len(squares))


def test_walls_that_are_drawn_twice_count_once(tmp_path):
    gap = at([*UPPER[2:], *UPPER[:2]], 0)
    once = MINE["ramp"][0]
    turned = closed(once[2:-1] + once[:2])
    layers = {**MINE, "upper": [gap, gap[::-1]], "ramp": [once, once[::-1], turned]}
    path = write(tmp_path / "twice.dxf", layers)
    assert area_m2(drawn(path).shape.mesh) == pytest.approx(1750, abs=0.01)
    assert detect_here(str(path), {}).values["has_heights"]


def test_scraps_that_enclose_nothing_do_no_harm(tmp_path):
    scraps = [
        [(10, 1, 0), (20, 1, 0), (10, 1, 0)],
        [(30, 1, 0), (30.1, 1, 0), (30.1, 1.1, 0)],
    ]
    found = drawn(write(tmp_path / "mine.dxf", {**MINE, "upper": [*MINE["upper"], *scraps]})).shape.mesh
    assert area_m2(found) == pytest.approx(1750, abs=0.01)


def test_a_ramp_in_short_pieces_is_kept_beside_stated_elevations(tmp_path, capsys):
    """No piece of 2 m falls by a metre, but the layer does."""
    walls = [shapely.segmentize(LineString(side), 2.0).coords for side in (RIGHT, LEFT)]
    ramp = [list(pair) for side in walls for pair in pairwise(down(side))]
    path = write(tmp_path / "mine.dxf", {**MINE, "ramp": ramp}, flat=("upper", "lower"))
    found = drawn(path, elevations_m={"upper": DATUM_M, "lower": DATUM_M - DROP_M}).shape.mesh
    assert area_m2(found) == pytest.approx(1750, abs=0.01)
    assert "left out" not in capsys.readouterr().err


def test_open_walls_whose_wrong_ends_are_joined_are_listed(tmp_path, capsys):
    """The rib between two drifts is thinner than the drifts are wide, so that its ends are the nearest."""
    outer = at([(0, 60), (0, 30), (13, 30), (13, 60)], -20)
    rib = at([(5, 60), (5, 35), (8, 35), (8, 60)], -20)
    drawn(write(tmp_path / "mine.dxf", {**MINE, "fork": [outer, rib]}))
    said = capsys.readouterr().err
    assert "1 of 2 open walls of layer 'fork' about (0.0, 60.0), 380.0 m high bound no area" in said


def test_the_height_of_a_wall_is_linear_between_its_points():
    walls = [np.array([(x, y, 0.15 * x) for x, y in [(0, 0), (40, 0), (40, 5), (0, 5), (0, 0)]])]
    places = np.column_stack([np.arange(0.1, 40, 0.37), np.full(108, 0.05)])
    np.testing.assert_allclose(Area(shapely.box(0, 0, 40, 5), walls).heights_at(places), 0.15 * places[:, 0])


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        (
            {**MINE, "ramp": [closed(down([(80, 0), (140, 0), (140, 30), (100, -10), (80, 5)]))]},
            r"a wall of layer 'ramp' that begins at \(80\.0, 0\.0\), 400\.0 m high, crosses itself in plan",
        ),
        (
            {**MINE, "turn": [[*turn(17.5), *turn(12.5)[::-1], turn(17.5)[0]]]},
            r"a wall of layer 'turn' that begins at \(17\.5, -40\.0\), 400\.0 m high, crosses itself in plan",
        ),
        (
            {**MINE, "turn": [turn(17.5), turn(12.5)]},
            r"open walls of layer 'turn' about \(17\.5, -40\.0\), 400\.0 m high are joined to walls over or under them",
        ),
        (
            {
                **MINE,
                "ramp": [
                    closed([(x, y, z * (x != 127.5) - DATUM_M * (x == 127.5)) for x, y, z in MINE["ramp"][0][:-1]])
                ],
            },
            r"2 points of walls have elevation 0, the first at \(127\.5, 0\.0\)",
        ),
        (
            {"0": [list(pair) for name in ("upper", "lower", "ramp") for pair in pairwise(MINE[name][0])]},
            r"open walls of layer '0' about .* are joined to walls over or under them; close the walls of each level",
        ),
    ],
    ids=["crosses itself", "a whole turn", "a whole turn of open walls", "stray zero", "segments on one layer"],
)
def test_defects_are_refused_with_their_place(tmp_path, layers, message):
    with pytest.raises(InputError, match=message):
        drawn(write(tmp_path / "mine.dxf", layers))


def test_seeds_are_refused_with_levels(tmp_path):
    with pytest.raises(InputError, match=r"survey\.seeds_m is not read with levels over each other"):
        drawn(write(tmp_path / "mine.dxf", MINE), seeds_m=[(5.0, 2.5)])
    assert drawn(tmp_path / "mine.dxf", seeds_m=[(5.0, 2.5)], layers=["upper"]).workings.area > 400


def test_seeds_choose_workings_on_a_slope_that_lie_nowhere_over_each_other(tmp_path):
    dipping = [closed([(x + aside, y, 0.05 * x) for x, y in UPPER]) for aside in (0, 200)]
    found = drawn(write(tmp_path / "mine.dxf", {"walls": dipping}), seeds_m=[(5.0, 2.5)])
    assert found.workings.area == pytest.approx(Polygon(UPPER).area)
    assert found.heights.sampled
