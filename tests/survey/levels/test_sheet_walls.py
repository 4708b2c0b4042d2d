"""Sheets of surveys whose widths differ from station to station: whole walls, and nothing in the drifts."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from scipy.spatial import ConvexHull

from minexplore.floors.floor import Floor
from pipeline.errors import GeometryError
from pipeline.metrics.containment import cover_floor
from pipeline.survey.passages.sheet_cells import Cell
from pipeline.survey.passages.sheet_layout import lay_apart
from pipeline.survey.passages.sheets import _lie_over, lay_out_sheets
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.stations.table import read_station_legs, read_station_survey
from pipeline.types import Workings
from stages.compile3d import compile_rock
from stages.contours import trace_free_space
from tests.composed import compose
from tests.heights import HEADER, lay_out

# A drift, and a ramp from its east end that comes back under it; station, east, north, left, right, floor.
UPPER = [
    ("a0", 0, 0, 2.8, 1.2, 10.6),
    ("a1", 15, 0, 2.7, 1.6, 9.9),
    ("a2", 30, 0, 1.8, 2, 9.2),
    ("a4", 60, 0, 3, 3, 7.8),
]
RAMP = [UPPER[-1], ("r1", 74, -10, 2.6, 2, 7.6), ("r2", 70, -36, 2.3, 1.8, 6.9), ("r3", 48, -50, 3.1, 1.9, 6)]
LOWER = [("b0", 30, -27, 2.4, 1.5, 5), ("b1", 10, 4.1, 1.7, 2.4, 4), ("b3", -2, 22.8, 1.9, 1.5, 3.4)]
_ABOVE_M = (0.02, 0.5, 1.5, 3.4)


def rows(leg, stations):
    """Return the rows of a leg."""
    return "".join(f"{leg},{name},{x},{y},{left},{right},{z},3.5,0\n" for name, x, y, left, right, z in stations)


def read_solved_legs(path):
    """Return the legs of a table as of a survey in three dimensions, which may cross without a station."""
    return plan_legs(path, read_station_survey(path))


@pytest.fixture(scope="module")
def config():
    return compose(["preset=light"])


def built(text, config, folder):
    """Return outline, floor and walls of a table, as stages 1 to 3 make them."""
    path = folder / "stations.csv"
    path.write_text(HEADER + text)
    plan, polygons, survey = lay_out(path)
    traced = trace_free_space(config.contours, plan, survey, Workings(polygons))
    rock = compile_rock(config.compile3d, traced["free_space"], traced["topology"], survey)
    return traced["free_space"].polygon, rock["floor"], rock["collision"]


def in_the_way(floor, parts):
    """Return the places (k, 3) m in the workings, above the middles of faces, at which there is a wall."""
    middles = floor.vertices[floor.faces].mean(axis=1)
    places = np.concatenate([middles * [1, 1, 0] + [0, 0, z] for z in _ABOVE_M])
    folded = floor.fold(places)
    inside = np.zeros(len(folded), bool)
    for part in (parts[k] for k in range(len(parts))):
        planes = ConvexHull(part).equations
        inside |= (folded @ planes[:, :3].T + planes[:, 3] < -1e-3).all(axis=1)
    return folded[inside]


def test_the_walls_of_an_upper_drift_do_not_reach_into_the_lower_one(config, tmp_path):
    _, floor, parts = built(rows("A", UPPER) + rows("R", [*RAMP, LOWER[0]]) + rows("B", LOWER), config, tmp_path)
    assert len(floor.offset_m) == 2
    assert len(in_the_way(floor, parts)) == 0


@pytest.mark.parametrize("turned_m", [0.001, 0.5, 3.0])
def test_legs_that_go_on_at_a_station_share_their_walls(turned_m, tmp_path):
    """Their left side is wider than the disc about the station, so quadrilaterals alone would leave a slit."""
    path = tmp_path / "stations.csv"
    middle = ("b", 20, 0, 3, 1, 2)
    path.write_text(
        HEADER + rows("A", [("a", 0, 0, 3, 1, 0), middle]) + rows("B", [middle, ("c", 40, -turned_m, 3, 1, 4)])
    )
    polygons, _ = lay_out_sheets(path, read_station_legs(path))
    closed = polygons.buffer(0.2, join_style="mitre").buffer(-0.2, join_style="mitre")
    assert closed.difference(polygons).intersection(shapely.box(10, -5, 30, 5)).area < 1e-3
    assert shapely.get_num_coordinates(polygons) < 45  # no ring has gone into a slit


def test_a_pillar_is_measured_where_it_is_thinnest(config, tmp_path):
    """Both drifts slope by 10 %: over the middle of the crossing there are 0.55 m of rock, at a corner 0.15 m."""
    upper = [("a0", 0, 0, 2, 2, 12), ("a1", 20, 0, 2, 2, 10), ("a2", 60, 0, 2, 2, 10)]
    lower = [("b0", 10, -27, 2, 2, 4.25), ("b1", 10, 4, 2, 2, 7.35), ("b2", 10, 24, 2, 2, 9.35)]
    ramp = [upper[-1], ("r1", 74, -10, 2, 2, 9), ("r2", 70, -36, 2, 2, 7), ("r3", 40, -50, 2, 2, 5), lower[0]]
    with pytest.raises(GeometryError, match=r"pillar: .* leave 0\.15 m of rock"):
        built(rows("A", upper) + rows("R", ramp) + rows("B", lower), config, tmp_path)


def test_no_cut_is_made_where_the_drift_before_a_sharp_bend_reaches_past_it(config, tmp_path):
    upper = [("a0", 0, 0, 2.3, 2.7, 11.2), ("a1", 30, 0, 2.7, 2, 10.4), ("a2", 60, 0, 2.5, 3.1, 9.5)]
    bend = [("r1", 74, -8, 3, 2.3, 8.4), ("r2", 70, -40, 1.3, 1.5, 6), ("r3", 71, -52, 1.3, 3.1, 5.2)]
    lower = [("b0", 51, -31, 2.7, 3, 3.1), ("b1", 42.8, 0.7, 1.5, 2.8, 4.4), ("b2", 35.4, 29, 1.8, 2.5, 5.6)]
    text = rows("A", upper) + rows("R", [upper[-1], *bend, lower[0]]) + rows("B", lower)
    _, floor, parts = built(text, config, tmp_path)
    assert len(floor.offset_m) == 2
    assert len(in_the_way(floor, parts)) == 0


def test_of_passages_that_pass_over_each_other_without_rock_the_less_useful_is_left_out_with_a_warning(
    tmp_path, capsys
):
    """A side drift of 44 m comes back over the main drift 0.7 m above its floor; 40 m go on from the main drift."""
    path = tmp_path / "stations.csv"
    main = [("a", 0, 0, 1, 1, 0), ("b", 20, 0, 1, 1, 0), ("c", 60, 0, 1, 1, 0)]
    side = [main[1], ("d", 20, 12, 1, 1, 0.5), ("e", 5, 12, 1, 1, 0.7), ("f", 5, -5, 1, 1, 0.7)]
    path.write_text(HEADER + rows("M", main) + rows("S", side) + rows("H", [main[2], ("g", 60, 15, 1, 1, 3)]))
    legs = read_solved_legs(path)
    whole, _ = lay_out_sheets(path, legs)
    polygons, heights = lay_out_sheets(path, legs, 4.0)
    assert shapely.Point(5, -3).within(whole.geoms[0])
    assert not shapely.Point(5, -3).within(polygons.geoms[0])
    assert shapely.Point(2, 0).within(polygons.geoms[0])
    assert (len(polygons.geoms), len(heights.seams)) == (1, 0)
    told = capsys.readouterr().err
    assert "1 shots, 17 m, lie less than 4 m over or under others" in told
    assert "e to f (0.70 m from another at (4.5, -0.9))" in told


def test_arms_of_a_junction_and_passages_with_rock_between_are_kept(tmp_path, capsys):
    path = tmp_path / "stations.csv"
    main = [("a", 0, 0, 1, 1, 0), ("b", 20, 0, 1, 1, 0), ("c", 60, 0, 1, 1, 0)]
    side = [main[1], ("d", 26, 12, 1, 1, 2), ("e", 5, 12, 1, 1, 4.5), ("f", 5, -5, 1, 1, 4.5)]
    path.write_text(HEADER + rows("M", main) + rows("S", side))
    polygons, heights = lay_out_sheets(path, read_solved_legs(path), 4.0)
    assert (len(polygons.geoms), len(heights.seams)) == (2, 1)
    assert "left out" not in capsys.readouterr().err


def test_many_wide_sheets_lie_in_rows_apart_from_each_other_and_are_found_again():
    east = [3.0, -40.0, 500.0, 3.0, -900.0, 3.0, 3.0]
    polygons = [shapely.box(x, -7.0 * k, x + 1500, -7.0 * k + 90) for k, x in enumerate(east)]
    offsets = lay_apart(polygons)
    moved = [shapely.transform(polygon, lambda xy, d=d: xy + d) for polygon, d in zip(polygons, offsets, strict=True)]
    apart = [one.distance(two) for one, two in itertools.combinations(moved, 2)]
    assert min(apart) >= 12.0
    assert np.ptp(shapely.bounds(moved)[:, ::2]) < 4000  # one row would be 10 km long
    assert (offsets % 10 == 0).all()
    assert not offsets[0].any()
    corners = np.concatenate([np.asarray(polygon.exterior.coords)[:3] for polygon in moved])
    number = np.arange(len(moved))
    floor = Floor(np.pad(corners, [(0, 0), (0, 1)]), np.arange(len(corners)).reshape(-1, 3), number, offsets)
    assert len(floor.rows) > 1
    places = np.concatenate([np.asarray(polygon.buffer(5).exterior.coords) for polygon in moved])
    counts = [len(polygon.buffer(5).exterior.coords) for polygon in moved]
    np.testing.assert_array_equal(floor.sheets_at(places), np.repeat(number, counts))


def test_few_sheets_lie_in_one_row():
    offsets = lay_apart([shapely.box(0, 0, 60, 50), shapely.box(10, 200, 90, 260), shapely.box(-5, -90, 20, 0)])
    assert not offsets[:, 1].any()
    assert (np.diff(offsets[:, 0]) > 0).all()


def test_a_cell_surely_over_another_is_one_that_overlaps_it_at_another_height():
    rng = np.random.default_rng(3)
    cells, shapes = {}, []
    for k in range(60):
        (x, y), z = rng.uniform(0, 12, 2), rng.choice([0.0, 2.0, 40.0])
        ends = np.array([[x, y, z], [x + rng.uniform(1, 4), y, z + rng.uniform(0, 1)]])
        shapes.append(shapely.LineString(ends[:, :2]).buffer(rng.uniform(0.4, 2)))
        cells[str(k)] = Cell(str(k), [shapes[-1]], [ends])
    pairs = np.array(list(itertools.combinations(range(60), 2)))
    sure = _lie_over(np.array(shapes), cells, [str(k) for k in range(60)], pairs)
    common = shapely.intersection(*np.array(shapes)[pairs.T])
    for (i, j), part in zip(pairs[sure], common[sure], strict=True):
        at = part.representative_point()
        assert part.area >= 0.01
        assert abs(cells[str(i)].height_at(at.x, at.y) - cells[str(j)].height_at(at.x, at.y)) > 1.0
    assert 100 < sure.sum() < (shapely.area(common) >= 0.01).sum()


def test_arms_that_part_slowly_are_one_floor_until_they_have_parted(tmp_path, capsys):
    """Of two arms at 12 deg, the floors differ by 0.31 m where they still overlap, 13 m along them from each other."""
    path = tmp_path / "stations.csv"
    left = [("a", 0, 0, 1, 1, 3.6), ("b", 8.4, 8, 1, 1, 3.01), ("c", 12, 15.5, 1, 1, 1.81)]
    right = [left[0], ("d", 4.8, 3, 1, 1, 3.56), ("e", 9, 5, 1, 1, 3.52), ("f", 30, 17.5, 1, 1, 3.4)]
    path.write_text(HEADER + rows("L", left) + rows("R", right))
    polygons, _ = lay_out_sheets(path, read_solved_legs(path), 4.0)
    assert shapely.Point(6.9, 4).within(polygons.geoms[0])
    assert "left out" not in capsys.readouterr().err


@pytest.mark.parametrize("end", [(8.6, 4.6, 3.4), (9, 5.3, 3.6), (9.4, 4.6, 3.6), (9.4, 5, 3.52)])
def test_a_thin_pillar_between_floors_of_different_heights_is_rock_up_to_the_higher_roof(end, config, tmp_path):
    """A third of a metre to a metre of rock parts a drift from a dead end whose floor is half a metre higher."""
    low = [("a", 0, 0, 1, 1, 3.6), ("b", 8.4, 8, 1, 1, 3.01), ("c", 12, 15.5, 1, 1, 1.81), ("d", 20, 30, 1, 1, 2)]
    high = [low[-1], ("e", 34, 26, 1, 1, 3), ("f", 30, 17.5, 1, 1, 3.4), ("g", *end[:2], 1, 1, end[2])]
    _, floor, parts = built(rows("L", low) + rows("H", high), config, tmp_path)
    cover = cover_floor((parts[k] for k in range(len(parts))), floor, (0.05, 1.75, 3.45))
    assert cover.missing_m2 < 3e-4
    assert cover.intrusion_m2 < 3e-4
    assert cover.widest_gap_m == 0
