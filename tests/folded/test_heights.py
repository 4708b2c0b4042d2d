"""Worlds with heights: the floor follows the survey, sheets pass over each other, and the certificate holds."""

import numpy as np
import pytest
import shapely

from minexplore.bundle import BundleError
from minexplore.floors.floor import Floor
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.schema.floor_mesh import _check_figures
from minexplore.sensing.coverage import CoverageGrid
from minexplore.world import load_world
from pipeline.errors import GeometryError
from pipeline.geometry.floor.mesh import build_floor
from pipeline.geometry.floor.network_heights import floor_lines
from pipeline.geometry.network.skeleton import trace_network
from pipeline.geometry.rock.delaunay import Triangulation
from pipeline.proof.validator import Validator
from pipeline.survey.spots import read_spots
from pipeline.types import METRIC, Heights
from tests.heights import RAMP, UNDER, certificate_params
from tests.mines import STRAIGHT, TEE, sealed

GRADE_DEG = np.degrees(np.arctan(0.15))


@pytest.fixture(scope="module")
def ramp(mine_of_legs):
    return mine_of_legs(RAMP, "preset=light")


@pytest.fixture(scope="module")
def under(mine_of_legs):
    return mine_of_legs(UNDER, "preset=light")


def clauses(mine, light, contacts=100):
    validator = Validator(certificate_params(light, contacts), mine.bundle, mine.cleaned, mine.raw, mine.survey)
    return validator.certificate


def broken(certificate):
    return {name: clause.value for name, clause in certificate.clauses.items() if not clause.holds}


def test_a_straight_ramp_is_linear_between_its_stations_and_level_across():
    line = np.array([[0, 2.5, 0], [40, 2.5, 0], [60, 2.5, 3.0], [100, 2.5, 3.0]])
    floor = build_floor(STRAIGHT, [line], 30.0)
    places = np.array([[50, 0.1], [50, 2.5], [50, 4.9], [45, 1.0], [20, 4.0], [90, 0.5]])
    np.testing.assert_allclose(floor.heights_at(places), [1.5, 1.5, 1.5, 0.75, 0.0, 3.0], atol=1e-9)
    assert floor.steepness_deg().max() == pytest.approx(GRADE_DEG, abs=1e-6)


def test_the_mesh_of_a_floor_covers_the_workings_and_neighbours_share_their_edges():
    floor = build_floor(TEE, [np.array([[0, 2.5, 0], [40.5, 2.5, 2], [80, 2.5, 5.0]])], 30.0)
    triangles = shapely.polygons(floor.vertices[floor.faces][:, :, :2])
    assert shapely.area(triangles).sum() == pytest.approx(TEE.area, abs=1e-9)
    outer = sum(np.hypot(*(floor.vertices[a] - floor.vertices[b])[:2]) for _, (a, b) in floor.wall_edges())
    assert outer == pytest.approx(TEE.length, abs=1e-9)  # an edge with a floor on one side only is a wall


def test_a_floor_folds_and_unfolds_without_loss(under):
    rng = np.random.default_rng(3)
    places = under.floor.vertices[under.floor.faces].mean(axis=1)[:, :2]
    points = np.column_stack([places, rng.uniform(0.1, 3.4, len(places))])
    folded = under.floor.fold(points)
    assert np.ptp(folded[:, 2]) > 9
    np.testing.assert_allclose(under.floor.unfold(folded, 1.75), points, atol=1e-9)
    flat = Floor()
    np.testing.assert_array_equal(flat.fold(points), points)
    assert flat.is_flat
    assert flat.heights_at(places).max() == 0


def test_a_line_that_leaves_the_workings_counts_up_to_their_wall():
    # The last 30 m lie beyond the end wall; they would put the floor there 1.5 m too high.
    line = np.array([[0.0, 2.5, 0.0], [100.0, 2.5, 10.0], [130.0, 2.5, 13.0]])
    floor = build_floor(STRAIGHT, [line], 30.0)
    x = np.linspace(0.5, 99.5, 100)
    assert np.abs(floor.heights_at(np.column_stack([x, np.full(100, 2.5)])) - x / 10).max() < 0.01


def test_points_beyond_a_corner_of_the_workings_are_that_corner():
    mesh = Triangulation(shapely.box(0, 0, 10, 5))
    numbers = {mesh.insert((10.0 + k, 5.0 + 0.3 * k), 0.02) for k in range(1, 9)}
    assert [mesh.xy[number] for number in numbers] == [(10.0, 5.0)]


def test_a_grade_rises_from_the_entrance_along_the_drifts():
    network = trace_network(TEE, 0.25, 2.0, 3.0)
    lines = floor_lines(Heights(grade=0.1), network, (2.5, 2.5))
    points = np.concatenate(lines)
    run = np.abs(points[:, 0] - 2.5) + np.abs(points[:, 1] - 2.5)  # along the T
    assert np.abs(points[:, 2] - 0.1 * run).max() < 0.15
    assert points[:, 2].min() == 0


def test_spots_are_joined_linearly_along_the_drifts(tmp_path):
    path = tmp_path / "spots.csv"
    path.write_text("easting_m,northing_m,elevation_m\n10,2.5,1200.5\n90,2.5,1204.5\n")
    heights = read_spots(path, METRIC)
    assert heights.datum_m == 1200
    (line,) = floor_lines(heights, trace_network(STRAIGHT, 0.25, 2.0, 3.0), (2.5, 2.5))
    inside = line[(line[:, 0] > 15) & (line[:, 0] < 85)]
    np.testing.assert_allclose(inside[:, 2], 0.5 + (inside[:, 0] - 10) / 20, atol=0.1)
    path.write_text("easting_m,northing_m,elevation_m\n10,60,3\n")
    with pytest.raises(GeometryError, match=r"the spot \(10\.0, 60\.0\), 0\.00 m high, is .* m from the nearest drift"):
        floor_lines(read_spots(path, METRIC), trace_network(STRAIGHT, 0.25, 2.0, 3.0), (2.5, 2.5))


@pytest.mark.parametrize("cell_m", [2.0, 1.7])  # sheets are whole cells apart, and are not
def test_beams_cross_the_cells_that_points_along_them_lie_in_on_whatever_sheet(under, cell_m):
    world = load_world(under.bundle)
    grid = CoverageGrid(world, cell_m, 0.35, np.array(world.record["spawn"]["anchor_m"]), np.inf)
    rng, places, floor = np.random.default_rng(0), world.places_m(0.35), world.floor
    places = places[rng.integers(len(places), size=150)]
    starts = floor.fold(np.column_stack([places, np.full(len(places), 0.5)]))
    ways = rng.normal(size=starts.shape) * [1, 1, 0.1]
    ends = starts + 8 * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    found = set(zip(*(column.tolist() for column in grid.cells_crossed(starts, ends, 10.0)), strict=True))
    shares = np.linspace(0, 1, 200)[:, None, None]
    points = (starts + shares * (ends - starts)).reshape(-1, 3)
    inside = floor.unfold(points)
    col, row = np.floor((inside[:, :2] - grid.origin_m) / cell_m).astype(int).T
    over = floor.covers(inside[:, :2]) & (inside[:, 2] > 0.3) & (inside[:, 2] < 3.2) & grid.reachable[row, col]
    ray = np.tile(np.arange(len(starts)), len(shares))
    there = set(zip(ray[over].tolist(), row[over].tolist(), col[over].tolist(), strict=True))
    assert len(there) > 300
    assert len(set(floor.sheets_at(inside[over, :2]).tolist())) == 2
    assert there <= found


def test_the_certificate_of_a_drift_under_a_drift_holds(under, light):
    assert len(under.floor.offset_m) == 2
    assert broken(clauses(under, light)) == {}


def test_a_wedge_that_was_moved_is_refused_with_its_name(ramp):
    files = read_folder(ramp.bundle)
    name = "roof_00003"
    start = files["mine.xml"].index(f'<geom name="{name}"'.encode())
    geom = files["mine.xml"][start : files["mine.xml"].index(b"/>", start)]
    moved = geom.replace(b'pos="', b'pos="1')
    changed = sealed({**files, "mine.xml": files["mine.xml"].replace(geom, moved)})
    with pytest.raises(BundleError, match="roof_00003"):
        check_files(ramp.bundle, changed, hash_files(changed))
    without = sealed({name: data for name, data in files.items() if name != "floor.npz"})
    with pytest.raises(BundleError, match=r"floor\.npz: missing"):
        check_files(ramp.bundle, without, hash_files(without))


def test_a_sliver_of_9e_8_m2_on_end_does_not_make_a_floor_steep():
    """A ramp of 10 % whose lower edge has a corner 18 nm beside it and 4 mm above: that face stands upright."""
    corners = np.array([(0, 0, 0), (10, 0, 0), (10, 10, 1), (0, 10, 1), (5, -1.8e-8, 0.004)])
    floor = Floor(corners, np.array([(0, 1, 2), (0, 2, 3), (0, 4, 1)], np.int32), np.zeros(3, np.int32))
    assert np.degrees(np.arctan(np.hypot(*floor.planes[2, :2]))) > 89
    steepest = float(floor.steepness_deg().max())
    assert steepest == pytest.approx(np.degrees(np.arctan(0.1)))
    _check_figures(floor, {"heights": {"low_m": 0.0, "high_m": 1.0, "steepest_deg": round(steepest, 3)}})


@pytest.mark.parametrize("east_m", np.arange(0.3017, 60, 3.0113).round(4))
def test_sheets_join_at_the_middle_of_a_seam_whose_fifth_decimal_is_a_half(east_m):
    """The middle of ends at 0.0001 and 4.0 m is 2.00005 m: the last bit of a subtraction decides how it is rounded."""
    square = np.array([(0, 0, 0), (5, 0.0001, 0), (5, 2.00005, 0), (5, 4, 0), (0, 4, 0)])
    other = np.array([(5, 0.0001, 0), (10, 0, 0), (10, 4, 0), (5, 4, 0), (5, 2.00005, 0)])
    aside = np.array([(0, 0), (east_m, -0.7 * east_m)]).round(4)
    other[:, :2] += aside[1]
    fan = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4)], np.int32)
    floor = Floor(np.vstack([square, other]), np.vstack([fan, fan + 5]), np.array([0] * 3 + [1] * 3), aside)
    assert len(floor.wall_segments()) == 6
