"""Levels over each other in vector files: sheets that ramps join, shafts between them, defects with their places."""

from itertools import pairwise
from pathlib import Path

import ezdxf
import networkx as nx
import numpy as np
import pyogrio.raw
import pytest
import shapely
from shapely import LineString, Polygon

from pipeline.errors import InputError
from pipeline.params.survey import VectorSurveyParams
from pipeline.proof.validator import Validator
from pipeline.survey.detect import detect_here
from pipeline.survey.levels.areas import Area
from pipeline.survey.levels.sheets import _chosen
from pipeline.survey.vector_survey import read_vector_survey
from tests.composed import compose
from tests.heights import MineWithHeights, certificate_params
from tests.project import ROOT

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


def half_turns(count, radius, half, drop, points, turned=0.0, at_m=(0.0, 0.0)):
    """Return the layers of a spiral that falls by `drop` each half turn, drawn as two wall strings a half turn."""
    layers = {}
    for k in range(count):
        share = np.linspace(k, k + 1, points + 1)
        angle = np.pi * share + turned
        layers[f"turn {k}"] = [
            [*zip(at_m[0] + r * np.cos(angle), at_m[1] + r * np.sin(angle), -drop * share, strict=True)]
            for r in (radius + half, radius - half)
        ]
    return layers


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
        wkb = np.array([shapely.to_wkb(shape, output_dimension=3) for shape in shapes], object)
        kind = "Polygon Z" if isinstance(shapes[0], Polygon) else "LineString Z"
        pyogrio.raw.write(path, wkb, [], [], geometry_type=kind, crs="EPSG:32719", layer=name, append=path.exists())
    return path


def drawn(path: Path, **values):
    section = {"kind": "vector", "name": "a", "file": "data/x", "volume": False}
    params = VectorSurveyParams.model_validate({**section, **values})
    read = read_vector_survey(params.model_copy(update={"file": path.as_posix()}))
    return read.workings, read.heights


def apart(workings, heights):
    """Return the area of the plan that each sheet covers in its own place, largest first."""
    moved = [
        shapely.transform(part, lambda p, d=offset: p - d)
        for part, offset in zip(workings.geoms, heights.offset_m, strict=True)
    ]
    return sorted(moved, key=lambda part: -part.area)


@pytest.mark.parametrize("suffix", [".dxf", ".gpkg"])
def test_levels_a_ramp_and_a_shaft_become_two_sheets(tmp_path, suffix):
    workings, heights = drawn(write(tmp_path / f"mine{suffix}", MINE))
    wanted = sum(Polygon(closed(ring)).area for ring in (UPPER, LOWER, RIGHT + LEFT[::-1]))
    assert workings.area == pytest.approx(wanted, abs=0.01)
    assert (len(workings.geoms), len(heights.seams), heights.datum_m) == (2, 1, DATUM_M - DROP_M)
    (seam,) = heights.seams
    assert seam.ends_m in (((84, 15), (84, 20)), ((84, 20), (84, 15)))
    (shaft,) = heights.shafts
    assert (shaft.top_m, shaft.bottom_m) == (DROP_M, 0)
    assert tuple(np.subtract(shaft.place_m, heights.offset_m[shaft.sheet])) == (20, 2.5)
    z = np.concatenate([np.array(line)[:, 2] for line in heights.lines])
    assert (z.min(), z.max()) == (0, DROP_M)


def test_open_wall_strings_are_closed_where_a_drift_ends(tmp_path):
    """The ramp's walls are two open strings, and the wall of the upper level has a gap at its mouth."""
    gap = at([*UPPER[2:], *UPPER[:2]], 0)
    layers = {**MINE, "upper": [gap], "ramp": [down(RIGHT), down(LEFT)]}
    found, heights = drawn(write(tmp_path / "open.dxf", layers))
    whole, _ = drawn(write(tmp_path / "closed.dxf", MINE))
    assert found.area == pytest.approx(whole.area, abs=0.01)
    assert len(heights.seams) == 1


def test_layers_without_elevations_take_the_stated_ones(tmp_path, capsys):
    layers = {**MINE, "frame": [closed(at([(-50, -50), (200, -50), (200, 90), (-50, 90)], -DATUM_M))]}
    path = write(tmp_path / "mine.dxf", layers, flat=("upper", "lower", "frame"))
    stated = {"upper": DATUM_M, "lower": DATUM_M - DROP_M}
    found, heights = drawn(path, elevations_m=stated)
    whole, _ = drawn(write(tmp_path / "whole.dxf", MINE))
    assert found.area == pytest.approx(whole.area, abs=0.01)
    assert len(heights.seams) == 1
    assert "layers without an elevation are left out: frame" in capsys.readouterr().err
    assert detect_here(str(path), {"elevations_m": stated}).values["values"]["elevations_m"] == stated
    with pytest.raises(InputError, match=r"no layer cellar to be at an elevation; there are upper, lower, ramp"):
        drawn(path, elevations_m={"cellar": 0.0})


def test_a_pillar_stays_in_its_level_and_a_room_below_it_in_its_own(tmp_path):
    room = [(0, -30), (40, -30), (40, 0), (0, 0)]
    pillar = [(15, -20), (25, -20), (25, -10), (15, -10)]
    upper = [closed(at(UPPER, 0)), closed(at(room, 0)), closed(at(pillar, 0.2))]
    found, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "upper": upper}))
    first, _ = apart(found, heights)
    assert len(first.interiors) == 1
    assert Polygon(first.interiors[0]).equals(Polygon(pillar))


def test_three_levels_with_ramps_over_each_other_are_four_sheets(tmp_path):
    """The lower ramp lies under the upper one, and its ends over and under two levels."""
    cellar = closed(at(LOWER, -2 * DROP_M))
    lower = closed(at(LOWER, -DROP_M))
    ramps = [closed(down(RIGHT + LEFT[::-1])), closed(down(RIGHT + LEFT[::-1], -DROP_M))]
    layers = {"upper": MINE["upper"], "lower": [lower], "cellar": [cellar], "ramp": ramps}
    found, heights = drawn(write(tmp_path / "mine.dxf", layers))
    assert (len(found.geoms), len(heights.seams)) == (4, 3)


def test_a_ramp_that_is_drawn_into_its_level_is_cut_where_it_leaves_it(tmp_path):
    into = [(78, 0, 0), *down(RIGHT), *down(LEFT[::-1]), (78, 5, 0), (78, 0, 0)]
    found, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "ramp": [into]}))
    whole, _ = drawn(write(tmp_path / "whole.dxf", MINE))
    assert found.area == pytest.approx(whole.area, abs=0.01)
    assert len(heights.seams) == 1


def test_a_level_that_no_ramp_reaches_is_left_out_with_a_warning(tmp_path, capsys):
    short = closed([(x, y, z + 3 * (x < 100 and y > 10)) for x, y, z in down(RIGHT + LEFT[::-1])])
    found, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "ramp": [short]}))
    said = capsys.readouterr().err
    assert "2 pieces of its levels and ramps do not meet; kept is the one of 1100 m2 about " in said
    assert "left out are 650 m2" in said
    assert len(found.geoms) == 1
    (shaft,) = heights.shafts
    assert shaft.below is None
    assert "1 pairs of levels and ramps nearly meet, the first 0.00 m apart in plan at (80." in said
    assert ", 388.0 and 391.0 m high" in said or ", 391.0 and 388.0 m high" in said


def test_pillars_of_a_dipping_room_far_from_its_outer_walls_are_pillars(tmp_path):
    """The floor falls by 8 % to the east, so that the pillars in the middle are metres below the nearest outer wall."""
    squares = [shapely.box(x, y, x + 12, y + 12) for x in range(8, 140, 20) for y in range(8, 140, 20)]
    rings = [shapely.box(0, 0, 148, 148).segmentize(4), *squares]
    room = [[(x - 148, y, -0.08 * x - 0.04 * y) for x, y in ring.exterior.coords] for ring in rings]
    under = [closed(at([(-60, 60), (-20, 60), (-20, 65), (-60, 65)], -40))]
    found, _ = drawn(write(tmp_path / "mine.dxf", {"room": room, "under": under}))
    assert len(found.geoms[0].interiors) == len(squares)
    assert found.area == pytest.approx(148**2 - 144 * len(squares))
    assert len(found.geoms) == 1


def test_walls_that_are_drawn_twice_count_once(tmp_path):
    gap = at([*UPPER[2:], *UPPER[:2]], 0)
    once = MINE["ramp"][0]
    turned = closed(once[2:-1] + once[:2])
    layers = {**MINE, "upper": [gap, gap[::-1]], "ramp": [once, once[::-1], turned]}
    path = write(tmp_path / "twice.dxf", layers)
    found, heights = drawn(path)
    whole, _ = drawn(write(tmp_path / "once.dxf", MINE))
    assert found.area == pytest.approx(whole.area, abs=0.01)
    assert len(heights.seams) == 1
    assert detect_here(str(path), {}).values["has_heights"]


def test_scraps_that_enclose_nothing_do_no_harm(tmp_path):
    scraps = [
        [(10, 1, 0), (20, 1, 0), (10, 1, 0)],
        [(30, 1, 0), (30.1, 1, 0), (30.1, 1.1, 0)],
    ]
    found, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "upper": [*MINE["upper"], *scraps]}))
    assert found.area == pytest.approx(1750, abs=0.01)
    assert len(heights.seams) == 1


def test_a_ramp_in_short_pieces_is_kept_beside_stated_elevations(tmp_path, capsys):
    """No piece of 2 m falls by a metre, but the layer does."""
    walls = [shapely.segmentize(LineString(side), 2.0).coords for side in (RIGHT, LEFT)]
    ramp = [list(pair) for side in walls for pair in pairwise(down(side))]
    path = write(tmp_path / "mine.dxf", {**MINE, "ramp": ramp}, flat=("upper", "lower"))
    found, heights = drawn(path, elevations_m={"upper": DATUM_M, "lower": DATUM_M - DROP_M})
    assert found.area == pytest.approx(1750, abs=0.01)
    assert len(heights.seams) == 1
    assert "left out" not in capsys.readouterr().err


def test_a_ramp_drawn_across_its_level_parts_neither(tmp_path):
    """The ramp is larger than its level, and takes up the whole width of it for 5 m."""
    level = [(75, -30), (80, -30), (80, 60), (75, 60)]
    into = closed([(75, 0, 0), *down(RIGHT), *down(LEFT[::-1]), (75, 5, 0)])
    found, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "upper": [closed(at(level, 0))], "ramp": [into]}))
    assert found.area == pytest.approx(450 + 650 + 525, abs=0.01)
    assert len(heights.seams) == 2
    past = closed([(60, 0, 0), *down(RIGHT), *down(LEFT[::-1]), (60, 5, 0)])
    layers = {**MINE, "upper": [closed(at(level, 0))], "ramp": [past]}
    with pytest.raises(InputError, match=r"two areas cross at \(77\.5, 2\.5\); draw one of them in two"):
        drawn(write(tmp_path / "past.dxf", layers))


def test_a_wall_across_a_drift_leaves_both_sides(tmp_path, capsys):
    bulkhead = closed(at([(60, 0), (61, 0), (61, 5), (60, 5)], 0))
    found, _ = drawn(write(tmp_path / "mine.dxf", {**MINE, "upper": [*MINE["upper"], bulkhead]}))
    assert found.area == pytest.approx(650 + 525 + 95, abs=0.01)
    assert "left out are 475 m2" in capsys.readouterr().err


def test_a_level_that_only_touches_another_with_a_corner_is_left_out_with_a_warning(tmp_path, capsys):
    corner = closed(at([(45, 40), (60, 40), (60, 80), (45, 80)], -DROP_M))
    found, _ = drawn(write(tmp_path / "mine.dxf", {**MINE, "other": [corner]}))
    assert found.area == pytest.approx(1750, abs=0.01)
    assert "1 areas touch a level, but no way of 1 m leads into them" in capsys.readouterr().err


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


def test_what_is_kept_has_the_order_of_the_file():
    """Texts in a set have another order in each process, and so would sheets."""
    boxes = [shapely.box(3 * k, 0, 3 * k + 2, 5) for k in range(60)]
    areas = [Area(box, [np.column_stack([*box.exterior.xy, np.zeros(5)])]) for box in boxes]
    joins = nx.empty_graph([str(k) for k in range(60)])
    joins.add_edges_from(pairwise([str(k) for k in range(0, 60, 3)]))
    assert list(_chosen(Path("a.dxf"), areas, joins)) == [str(k) for k in range(0, 60, 3)]


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


@pytest.mark.parametrize(
    ("top", "bottom", "reason"),
    [(30.0, 10.0, "430.0 to 410.0 m, whose ends are on no floor"), (0.0, -8.0, "400.0 to 392.0 m, which ends blind")],
)
def test_a_shaft_that_begins_or_ends_nowhere_is_left_out_with_a_warning(tmp_path, capsys, top, bottom, reason):
    shaft = [(20, 2.5, top), (20, 2.5, bottom)]
    _, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "shafts": [shaft]}))
    assert not heights.shafts
    assert f"1 shafts are left out, the first at (20.0, 2.5) from {reason}" in capsys.readouterr().err


def test_a_plumb_line_up_from_the_highest_floor_that_it_meets_is_a_raise(tmp_path):
    shaft = [(20, 2.5, 30.0), (20, 2.5, -DROP_M)]
    _, heights = drawn(write(tmp_path / "mine.dxf", {**MINE, "shafts": [shaft]}))
    down, up = heights.shafts
    assert (down.top_m, down.bottom_m, up.top_m, up.bottom_m) == (DROP_M, 0, DROP_M + 30, DROP_M)
    assert (up.sheet, up.below, up.place_m) == (None, down.sheet, down.place_m)


def test_workings_on_a_slope_that_lie_nowhere_over_each_other_stay_one_plan(tmp_path):
    dipping = {"walls": [closed([(x, y, 0.05 * x) for x, y in UPPER])]}
    found, heights = drawn(write(tmp_path / "mine.dxf", dipping))
    assert len(found.geoms) == 1
    assert heights.sampled
    assert not heights.seams


@pytest.mark.parametrize(("points", "turned"), [(12, 0.0), (5, 5.56), (30, 1.28), (9, 0.29)])
def test_half_turns_of_a_spiral_are_joined_by_seams_square_to_their_walls(tmp_path, points, turned):
    """Far from the origin, the ends of the strings are equal up to rounding only."""
    layers = half_turns(5, 12.0, 2.2, 5.0, points, turned, (450_000.0, 7_100_000.0))
    _, heights = drawn(write(tmp_path / "spiral.dxf", layers))
    assert [sorted(seam.sheets) for seam in heights.seams] == [[k, k + 1] for k in range(4)]
    for seam in heights.seams:
        one, two = np.array(seam.ends_m) - (450_000.0, 7_100_000.0)
        wide = np.hypot(*(two - one))
        assert 4.4 * np.cos(np.pi / 2 / points) - 0.01 <= wide <= 4.401  # as wide as the drift, which has flat sides


def test_a_ramp_that_leaves_its_level_at_a_small_angle_has_its_height_up_to_there(tmp_path, capsys):
    """It falls by 0.85 m while it is in the level's drift; that goes on level."""
    workings, heights = drawn(write(tmp_path / "fork.dxf", fork(20.0, 0.06)))
    said = "floors of 1 pairs of areas differ where they meet, by up to 0.83 m about (53.8, 0.1)"
    assert said in capsys.readouterr().err
    assert len(heights.seams) == 1
    points = np.concatenate([np.array(line) for line in heights.lines])
    sheet = shapely.STRtree(workings.geoms).nearest(shapely.points(points[:, :2]))
    points -= np.column_stack([np.array(heights.offset_m)[sheet], np.full(len(points), DATUM_M - heights.datum_m)])
    upper = points[(abs(points[:, 1] - 2.5) < 2.51) & (points[:, 2] > -3)]
    assert abs(upper[:, 2]).max() < 0.06
    ahead = np.array([np.cos(np.radians(-20)), np.sin(np.radians(-20))])
    far = (points[:, :2] - (40, 2.5)) @ ahead
    on_ramp = (far > 30) & (far < 100) & (points[:, 1] < -5)
    assert on_ramp.sum() > 50
    np.testing.assert_allclose(points[on_ramp, 2], -0.06 * far[on_ramp], atol=1e-3)


def test_a_ramp_too_short_for_two_misfits_is_refused(tmp_path):
    upper = [closed(at([(x, 0), (x + 60, 0), (x + 60, 5), (x, 5)], 0)) for x in (0, 64)]
    stub = closed([(60, 0, 0.9), (64, 0, -0.9), (64, 5, -0.9), (60, 5, 0.9)])
    under = closed(at([(10, -10), (20, -10), (20, 15), (10, 15)], -DROP_M))
    with pytest.raises(
        InputError, match=r"meet at \(6[04]\.0, .*\) differ, and the ramp is too short .* 1\.00 m would"
    ):
        drawn(write(tmp_path / "mine.dxf", {"upper": upper, "stub": [stub], "lower": [under]}))


def test_a_ramp_that_meets_its_level_on_half_a_metre_is_refused(tmp_path):
    lower = closed(at([(x, 15.5 if y == 20 else y) for x, y in LOWER], -DROP_M))
    with pytest.raises(InputError, match=r"two areas meet at \(80\.0, 15\.\d\), but share no straight edge of 1 m"):
        drawn(write(tmp_path / "mine.dxf", {**MINE, "lower": [lower]}))


@pytest.mark.parametrize(
    ("layers", "sheets", "openings"),
    [
        pytest.param(MINE, 2, 1, marks=pytest.mark.slow),
        (MINE | {"shafts": [[(15, 2.5, 0), (23, 2.5, -DROP_M)]]}, 2, 1),
        pytest.param(half_turns(4, 12.0, 2.2, 5.0, 12), 4, 0, marks=pytest.mark.slow),
        pytest.param(fork(20.0, 0.06), 2, 0, marks=pytest.mark.slow),
    ],
    ids=["levels", "leaning shaft", "half turns", "small angle"],
)
def test_the_certificate_of_levels_of_a_drawing_holds(tmp_path, monkeypatch, layers, sheets, openings):
    monkeypatch.chdir(ROOT)
    light = compose(["preset=light"])
    mine = MineWithHeights.from_file(write(tmp_path / "mine.dxf", layers), light)
    assert (len(mine.floor.offset_m), len(mine.openings)) == (sheets, openings)
    certificate = Validator(
        certificate_params(light, 100), mine.bundle, mine.cleaned, mine.raw, mine.survey
    ).certificate
    assert {name: clause.value for name, clause in certificate.clauses.items() if not clause.holds} == {}
    assert mine.network.loops == 0
