"""Areas of a drawing as floors of one volume: heights, seams, shafts, pieces, and what is refused with its place."""

import numpy as np
import pytest
import shapely
from shapely import Polygon

from pipeline.types import lines_of
from tests.survey.levels.test_drawn_levels import (
    DATUM_M,
    DROP_M,
    LEFT,
    LOWER,
    MINE,
    RIGHT,
    UPPER,
    area_m2,
    at,
    closed,
    drawn,
    fork,
    write,
)

DRIFT = [(0, 0), (60, 0), (60, 5), (0, 5)]
UNDER = [(10, -20), (15, -20), (15, 40), (10, 40)]
TWO = {"upper": [closed(at(DRIFT, 0))], "lower": [closed(at(UNDER, -DROP_M))]}


def heights_at(floors, x, y):
    """Return the heights of all floors at a place, the lowest first."""
    found = []
    for a, b, c in floors.vertices[floors.faces]:
        share = np.linalg.solve(np.array([[*a[:2], 1], [*b[:2], 1], [*c[:2], 1]]).T, [x, y, 1])
        if share.min() > -1e-9:
            found.append(round(float(share @ [a[2], b[2], c[2]]), 3))
    return sorted(set(found))


def test_a_room_has_the_heights_of_its_walls_and_the_lowest_is_the_datum(tmp_path):
    slope = [(x, y, 0.05 * x) for x, y in DRIFT]
    found = drawn(write(tmp_path / "a.dxf", {"a": [closed(slope)]}))
    assert (found.heights, found.shape.mesh.datum_m) == (None, DATUM_M)
    assert area_m2(found.shape.mesh) == pytest.approx(300)
    assert heights_at(found.shape.mesh, 20.0, 2.5) == [1.0]
    assert found.width_m == pytest.approx(2 * 300 / 130)


@pytest.mark.parametrize("suffix", [".dxf", ".gpkg"])
def test_levels_and_their_ramp_are_one_mesh_without_a_step_and_the_shaft_is_a_leg(tmp_path, suffix):
    found = drawn(write(tmp_path / f"mine{suffix}", MINE))
    floors, wanted = found.shape.mesh, sum(Polygon(closed(ring)).area for ring in (UPPER, LOWER, RIGHT + LEFT[::-1]))
    assert area_m2(floors) == pytest.approx(wanted, abs=0.01)
    assert floors.datum_m == DATUM_M - DROP_M
    assert heights_at(floors, 20.0, 2.4) == [0, DROP_M]
    on_seam = floors.vertices[(np.abs(floors.vertices[:, 0] - 80) < 1e-6) & (floors.vertices[:, 1] < 5.01)]
    assert len(np.unique(on_seam.round(6), axis=0)) == len(on_seam)
    assert found.shape.shafts.positions_m[:, :2] == pytest.approx(np.array([[20, 2.5], [20, 2.5]]))
    assert found.shape.shafts.positions_m[:, 2] == pytest.approx([DROP_M + 0.6, 0.6])


def test_levels_that_do_not_meet_are_all_built_and_a_piece_chooses_one(tmp_path, capsys):
    path = write(tmp_path / "a.dxf", TWO)
    assert area_m2(drawn(path).shape.mesh) == pytest.approx(600)
    said = " ".join(capsys.readouterr().err.split())
    assert "2 pieces of its levels and ramps do not meet; all are built, and --piece (survey.piece) builds one" in said
    one = drawn(path, piece=(12.5, 30.0, DATUM_M - DROP_M))
    assert (area_m2(one.shape.mesh), one.shape.mesh.datum_m) == (pytest.approx(300), DATUM_M - DROP_M)


def test_stated_elevations_lift_levels_that_are_drawn_in_one_plane(tmp_path):
    path = write(tmp_path / "a.dxf", TWO, flat=("upper", "lower"))
    found = drawn(path, elevations_m={"upper": 100.0, "lower": 80.0})
    assert heights_at(found.shape.mesh, 12.5, 2.5) == [0, 20]
    assert found.shape.mesh.datum_m == 80


def test_a_ramp_drawn_into_its_level_ends_where_the_level_begins(tmp_path):
    ramp = closed([(50, 0, 0), (60, 0, 0), (100, 0, -4), (100, 5, -4), (60, 5, 0), (50, 5, 0)])
    found = drawn(write(tmp_path / "a.dxf", {"level": [closed(at(DRIFT, 0))], "ramp": [ramp]}))
    assert area_m2(found.shape.mesh) == pytest.approx(300 + 200)
    assert heights_at(found.shape.mesh, 55.0, 2.5) == [4]
    assert heights_at(found.shape.mesh, 80.0, 2.5) == [2]


def test_two_drifts_of_a_level_may_cross(tmp_path):
    slope = [(x, y, 0.05 * x) for x, y in DRIFT]
    across = [(x, y, 0.05 * x) for x, y in UNDER]
    floors = drawn(write(tmp_path / "a.dxf", {"one": [closed(slope)], "two": [closed(across)]})).shape.mesh
    assert area_m2(floors) == pytest.approx(300 + 300 - 25)
    assert heights_at(floors, 12.5, 2.5) == [0.625]


def test_raises_and_blind_shafts_keep_their_ends_and_one_that_meets_no_floor_is_left_out(tmp_path, capsys):
    axes = [[(5, 2.5, 0), (5, 2.5, 9)], [(50, 2.5, 0), (50, 2.5, -30)], [(200, 0, 0), (200, 0, -9)]]
    slope = [(x, y, -0.05 * x) for x, y in DRIFT]
    found = drawn(write(tmp_path / "a.dxf", {"level": [closed(slope)], "shafts": axes}))
    low, legs = found.shape.mesh.datum_m - DATUM_M, found.shape.shafts
    assert len(lines_of(legs.names)) == 4
    assert legs.positions_m[:, 2] + low == pytest.approx([9, -0.25 + 0.6, -2.5 + 0.6, -30 + 0.5])
    assert "1 shafts reach no floor and are left out: (200.0, 0.0) from 400.0 to 391.0 m" in " ".join(
        capsys.readouterr().err.split()
    )


def test_areas_that_meet_in_a_corner_alone_are_built_apart_with_a_warning(tmp_path, capsys):
    corner = [(60, 5), (70, 5), (70, 15), (60, 15)]
    layers = {"one": [closed(at(DRIFT, 0))], "two": [closed(at(corner, 0))], "low": [closed(at(UNDER, -DROP_M))]}
    found = drawn(write(tmp_path / "a.dxf", layers))
    assert area_m2(found.shape.mesh) == pytest.approx(300 + 300 + 100)
    said = " ".join(capsys.readouterr().err.split())
    assert "1 pairs of areas meet but share no edge, and are not joined, the first at (60.0, 5.0), 400.0 m high" in said
    assert "3 pieces of its levels and ramps do not meet" in said


def test_a_ramp_that_leaves_its_level_at_a_small_angle_is_cut_along_the_wall(tmp_path):
    """The corner of the ramp inside the level is no corner of what is left of it."""
    floors = drawn(write(tmp_path / "fork.dxf", fork(20.0, 0.06))).shape.mesh
    corners = floors.vertices[floors.faces]
    middle = corners.mean(axis=1)
    outlines = shapely.STRtree(shapely.polygons(corners[:, :, :2]).tolist())
    place, face = outlines.query(shapely.points(middle[:, :2]), predicate="within")
    other = face != place
    assert (np.abs(middle[place[other], 2] - middle[face[other], 2]) > 3.5).all()
