"""Drawings that are no plans are named: sections and contours; mines that resemble them are read."""

import numpy as np
import pytest
import shapely
from shapely import LineString

from minesurveys.remarks import collect_remarks
from minesurveys.vector.shapes import Shapes
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from pipeline.survey.vector.plan_doubts import contours_hint, require_plan, warn_of_crossings


def ring(radius, height, centre=(0.0, 0.0)):
    turn = np.linspace(0, 2 * np.pi, 40)
    places = np.column_stack([np.cos(turn), np.sin(turn)]) * radius + centre
    places[-1] = places[0]
    return LineString(np.column_stack([places, np.full(len(turn), height)]))


def judge(tmp_path, *lines, layers=("0",)):
    layer_of = [layers[k % len(layers)] for k in range(len(lines))]
    require_plan(tmp_path / "a.dxf", Shapes(list(lines), "m", layer_of=layer_of))


def test_lines_in_one_vertical_plane_are_called_a_section_whatever_way_it_faces(tmp_path):
    wall = LineString([(0, 0, 0), (80, 40, -10), (80, 40, -14), (0, 0, -4), (0, 0, 0)])
    with pytest.raises(InputError, match=r"1 lines lie in one vertical plane, 89\.\d+ long and 14 high .* a section"):
        judge(tmp_path, wall)
    with pytest.raises(InputError, match=r"--half-width M .* centrelines.*; if it is a section, give the plan$"):
        judge(tmp_path, wall)
    judge(tmp_path, wall, LineString([(0, 5, 0), (80, 45, -10)]))  # the other wall of a ramp


def test_five_contours_within_each_other_are_called_a_pit_or_the_ground(tmp_path):
    for fall in (10.0, -10.0):
        pit = [ring(200 - 20 * k, 100 - fall * k) for k in range(5)]
        with pytest.raises(InputError, match=r"5 of its closed lines .* contours of an open pit .*--heights FILE"):
            judge(tmp_path, *pit)
        judge(tmp_path, *pit[:4])


def test_levels_and_pillars_are_no_contours(tmp_path):
    up_and_down = [ring(200 - 20 * k, 10.0 * (k % 2)) for k in range(9)]
    judge(tmp_path, *up_and_down)
    beside = [ring(10, -30.0 * k, (40.0 * k, 0.0)) for k in range(9)]
    judge(tmp_path, *beside)
    room = [ring(200, 0.0), *(ring(3, 0.0, (20.0 * k, 0.0)) for k in range(9))]
    judge(tmp_path, *room, *(shapely.transform(line, lambda p: p - (0, 0, 40), include_z=True) for line in room))


def test_contours_without_heights_are_contours_and_pillars_in_rooms_are_none(tmp_path):
    pit = [shapely.force_2d(ring(200 - 20 * k, 0.0)) for k in range(5)]
    with pytest.raises(InputError, match="5 of its closed lines lie within each other: contours of an open pit"):
        judge(tmp_path, *pit)
    judge(tmp_path, *pit[:4])


def test_open_contours_that_enclose_nothing_are_called_contours(tmp_path):
    rows = ((f"MULTILINESTRING Z (({x} 0 {9 * x}, {x + 5} 90 {9 * x}, {x} 200 {9 * x}))") for x in range(16, 112, 16))
    shapes = shapely.union_all([shapely.from_wkt(row) for row in rows])
    path = tmp_path / "pit.geojson"
    path.write_text('{"note": "metres", ' + shapely.to_geojson(shapes)[1:])
    with pytest.raises(
        InputError, match=r"the walls enclose nothing.*level, at 6 heights, as contours .*--heights FILE"
    ):
        detect_survey(path)  # in a process of its own


def test_open_walls_of_levels_are_no_contours():
    walls = [LineString([(x, y, 20.0 * z), (x + 9, y, 20.0 * z)]) for x in range(3) for y in range(3) for z in range(6)]
    assert contours_hint(Shapes(walls, "m")) == ""


def test_lines_that_cross_are_counted_with_the_option_for_centrelines_and_that_for_levels(tmp_path, capsys):
    grid = [LineString([(0, 20 * k), (60, 20 * k)]) for k in range(1, 3)]
    grid += [LineString([(20 * k, 0), (20 * k, 60)]) for k in range(1, 3)]
    warn_of_crossings(tmp_path / "coal.geojson", Shapes(grid, "m", fields=["seam"]))
    told = capsys.readouterr().err
    assert "coal.geojson: 4 pairs of its lines cross each other" in told
    assert "; --half-width M reads them as centrelines; --level-by FIELD keeps levels apart by the value of a" in told
    assert told.endswith("property (seam)\n")
    walls = [LineString(part) for part in ([(0, 0), (9, 0)], [(9, 0), (9, 9)], [(9, 9), (0, 9)], [(0, 9), (0, 0)])]
    warn_of_crossings(tmp_path / "room.geojson", Shapes(walls, "m"))
    assert capsys.readouterr().err == ""


def test_centrelines_that_are_read_as_walls_of_narrow_drifts_are_named_as_such(tmp_path):
    legs = [[(0, 0), (9, 0)], [(9, 0), (9, 0.4)], [(9, 0.4), (0, 0.2)], [(0, 0.2), (0, 0)], [(4, -0.2), (4, 0.6)]]
    path = tmp_path / "legs.geojson"
    path.write_text('{"note": "metres", ' + shapely.to_geojson(shapely.MultiLineString(legs))[1:])
    with collect_remarks() as remarks:
        detect_survey(path, StatedOptions(unit="m"))
    assert any("pairs of its lines cross each other, as centrelines do" in remark.what for remark in remarks)
