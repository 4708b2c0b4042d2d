"""Columns through a volume, the floors that a robot fits on, storeys, reach, and the maps of them."""

import dataclasses

import manifold3d
import numpy as np
import pytest

from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.params.compile3d import SpawnParams
from pipeline.volume.world import room
from pipeline.volume.world.cells import _rounded_down, cells_of
from pipeline.volume.world.maps import octree_of, storey_maps
from pipeline.volume.world.proof.reached import straight_ways
from pipeline.volume.world.reach import RobotSize, components_of, covered, neighbours_of, regions_of
from pipeline.volume.world.spans import spans_of
from pipeline.volume.world.topology import LegNetwork, start_of
from tests.octomap import FREE, OCCUPIED, BinaryTree

ROBOT = RobotSize(steepest=0.364, step_m=0.05, height_m=0.655, radius_m=0.35)


def volume_of(solid):
    """Return a solid as a volume all of whose facets are floors, walls or roofs by their direction."""
    mesh = solid.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int32)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    up = normal[:, 2] / np.linalg.norm(normal, axis=1)
    label = np.where(up < -0.7, 0, np.where(up > 0.7, 2, 1)).astype(np.int32)
    return VolumeFacets(vertices, faces, label, np.zeros(len(faces), np.int32))


def box(x, y, z, east, north, up):
    return manifold3d.Manifold.cube([east, north, up]).translate([x, y, z])


# Two passages of 10 x 2 m, one 4 m over the other, and a shaft of 1 x 1 m between them at the east end.
SHAFT = box(0, 0, 0, 10, 2, 2) + box(0, 0, 4, 10, 2, 2) + box(8.5, 0.5, 0.5, 1, 1, 4.5)


@pytest.mark.parametrize("cell", [0.25, 0.1, 0.37])
def test_columns_through_a_box_have_its_floor_and_its_height_wherever_the_grid_lies(cell):
    volume = volume_of(box(0, 0, 0, 10, 2, 2))
    found = spans_of(volume.vertices, volume.faces, np.array([-1.0, -1.0]), cell)
    assert len(found.column) == pytest.approx(20 / cell**2, rel=0.1)
    assert np.allclose(found.floor_m, 0)
    assert np.allclose(found.roof_m, 2)


def test_robots_start_on_the_largest_floor_that_they_reach_of_those_on_which_they_have_room():
    chamber, drift = box(0, 0, 0, 5, 5, 2), box(10, 0, 0, 90, 0.9, 2) + box(50, -1, 0, 3, 3, 2)
    volume = volume_of(chamber + drift)
    cells = cells_of(volume, 0.25, ROBOT)
    ends = {"chamber": (1.0, 1.0, 0.0), "west": (10.0, 0.45, 0.0), "east": (100.0, 0.45, 0.0)}
    legs = LegNetwork(ends, [], [], list(ends), [], 0, 2, 95.0)
    spawn = SpawnParams(radius_m=15.0, clearance_m=0.5)
    start = start_of(cells, legs, None, spawn, ROBOT)
    assert 50 < start.anchor_m[0] < 53  # more of the chamber's places have room
    only = start_of(cells, legs, None, SpawnParams(radius_m=15.0, clearance_m=1.6), ROBOT)
    assert only.anchor_m[0] < 5  # only the chamber has such room


def test_a_column_through_vertices_and_edges_has_one_span():
    volume = volume_of(box(0, 0, 0, 4, 4, 2).refine(4))  # its edges run through the middles of cells
    found = spans_of(volume.vertices, volume.faces, np.array([-0.5, -0.5]), 1.0)
    assert len(np.unique(found.column * 100 + found.row)) == len(found.column) == 16


@pytest.mark.parametrize("top", [10.0, -10.0])  # of the wedge behind the facet, over it or under it
def test_a_facet_that_stands_upright_but_for_rounding_leaves_no_column_open(top):
    upright = [  # its plane passes through the middle of a cell, and its normal points up by 1.6e-16
        [58.00406272877015, 4.175390529679104, -37.503837966918944],
        [58.260873224994484, 4.068386156252299, -37.281165539760316],
        [57.77884615384615, 4.269230769230769, -36.353837966918945],
    ]
    vertices = np.array([*upright, [59.0, 6.0, -37.0 + top]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    spans = spans_of(vertices, faces, np.array([-131.5, -117.75]), 0.25)
    assert len(spans.column) == len(np.unique(np.column_stack([spans.column, spans.row]), axis=0)) > 5
    assert (spans.floor_m < spans.roof_m).all()


def test_columns_have_the_volume_of_the_free_space_with_floors_over_each_other_and_a_shaft():
    volume = volume_of(SHAFT)
    found = spans_of(volume.vertices, volume.faces, np.array([0.0, 0.0]), 0.25)
    assert (found.roof_m - found.floor_m).sum() * 0.25**2 == pytest.approx(SHAFT.volume(), rel=1e-9)
    in_shaft = found.roof_m - found.floor_m > 2.5
    assert in_shaft.sum() * 0.25**2 == pytest.approx(1.0)
    assert np.allclose((found.roof_m - found.floor_m)[in_shaft], 6)


def reached_from(cells, pairs, start):
    """Return the spans that a robot's disc covers on its ways from one."""
    region = regions_of(cells, start, ROBOT)
    return covered(cells, pairs, region == region[start], ROBOT)


def test_floors_over_each_other_are_two_storeys_and_a_robot_stays_on_its_own():
    cells = cells_of(volume_of(SHAFT), 0.25, ROBOT)
    assert sorted(np.unique(cells.storey).tolist()) == [0, 1]
    pairs = neighbours_of(cells, ROBOT)
    start = int(np.argmin(np.linalg.norm(cells.places_m - [2, 1, 4], axis=1)))
    reached = reached_from(cells, pairs, start)
    assert np.allclose(cells.floor_m[reached], 4)
    assert reached[(cells.floor_m == 4) & (cells.places_m[:, 0] < 8)].all()
    assert not reached[cells.places_m[:, 0] > 9.5].any()  # beside the shaft the floor is 0.5 m wide


def test_clearance_is_the_distance_from_the_wall_and_a_crawl_is_no_floor_to_stand_on():
    solid = box(0, 0, 0, 10, 4, 2) + box(10, 1, 0, 10, 1, 0.5)
    cells = cells_of(volume_of(solid), 0.25, ROBOT)
    inside = cells.places_m[:, 0] < 8
    for places in (cells.places_m, cells.roomiest_m):
        wall = np.minimum(places[:, 1], 4 - places[:, 1])
        expected = np.minimum(wall, places[:, 0])[inside]
        assert (cells.clearance_m[inside] > expected - 1e-4).all()
    assert np.allclose(cells.clearance_m[inside], expected, atol=1e-4)
    assert (cells.storey[cells.places_m[:, 0] > 10.5] == -1).all()


@pytest.mark.parametrize("height", [0.7, 3.0])
def test_a_slab_has_the_clearances_in_plan_that_other_volumes_have_from_stretched_rock(height, monkeypatch):
    slab = (box(0, 0, 0, 14, 12, height) - box(4, 4, 0, 2, 1.3, height)).rotate([0, 0, 20]).translate([3, 5, -2])
    assert len(room.walls_of_slab(*_mesh(slab))) == 8
    found = cells_of(volume_of(slab), 0.25, ROBOT)
    monkeypatch.setattr(room, "walls_of_slab", lambda *_: None)
    wanted = cells_of(volume_of(slab), 0.25, ROBOT)
    for name in ("clearance_m", "way_m"):
        assert np.abs(getattr(found, name) - getattr(wanted, name)).max() < 1.1e-3, name
    assert (found.clearance_m == wanted.clearance_m).mean() > 0.95
    assert np.array_equal(found.storey, wanted.storey)


@pytest.mark.parametrize(
    "solid",
    [
        manifold3d.Manifold.cylinder(3.0, 5.0, 4.0, 12),  # its walls lean
        box(0, 0, 0, 5, 5, 3) + box(5, 0, 0, 5, 5, 2),
        box(0, 0, 0, 5, 5, 3).rotate([3, 0, 0]),
    ],
)
def test_what_has_a_third_height_or_a_wall_that_leans_is_no_slab(solid):
    assert room.walls_of_slab(*_mesh(solid)) is None


def _mesh(solid):
    volume = volume_of(solid)
    return volume.vertices, volume.faces


def test_a_step_and_a_slope_that_a_robot_does_not_take_part_a_floor():
    step = box(0, 0, 0, 5, 2, 2) + box(5, 0, -0.5, 5, 2, 2)
    assert cells_of(volume_of(step), 0.25, ROBOT).storey.max() == 1
    assert cells_of(volume_of(step), 0.25, dataclasses.replace(ROBOT, step_m=0.6)).storey.max() == 0


def test_the_disc_of_a_robot_does_not_pass_a_gap_that_is_narrower():
    solid = box(0, 0, 0, 4, 3, 2) + box(4, 1.2, 0, 1, 0.6, 2) + box(5, 0, 0, 4, 3, 2)
    cells = cells_of(volume_of(solid), 0.1, ROBOT)
    start = int(np.argmin(np.linalg.norm(cells.places_m - [2, 1.5, 0], axis=1)))
    reached = reached_from(cells, neighbours_of(cells, ROBOT), start)
    assert cells.places_m[reached, 0].max() < 5
    assert cells.storey.max() == 0  # a storey is what is level; width is the robot's matter


@pytest.mark.parametrize("angle", range(0, 90, 15))
@pytest.mark.parametrize(("wide", "passes"), [(0.66, False), (0.69, False), (0.76, True), (0.8, True)])
def test_the_disc_of_a_robot_passes_a_gap_that_is_a_little_wider_wherever_the_grid_lies(angle, wide, passes):
    gap = manifold3d.Manifold.cube([8.0, wide, 2.0]).translate([0.0, -wide / 2, 0.0])
    solid = (
        (box(-3, -1.5, 0, 3.1, 3, 2) + gap + box(7.9, -1.5, 0, 3, 3, 2))
        .rotate([0, 0, angle])
        .translate([0.04, 0.07, 0])
    )
    cells = cells_of(volume_of(solid), 0.25, ROBOT)
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    west, east = (int(np.hypot(*(cells.places_m[:, :2] - at * along).T).argmin()) for at in (-1.5, 9.5))
    region = regions_of(cells, west, ROBOT)
    assert (region[west] == region[east]) == passes


def test_a_way_past_an_edge_is_as_wide_as_the_floor_beside_it():
    hole = box(3, 1.0, -3, 4, 2, 4)
    for beside, passes in (
        (0.5, False),
        (0.62, False),
        (0.72, True),
    ):  # 0.05 m less than a disc
        solid = box(0, 0, 0, 10, 3, 2) + hole.translate([0, beside - 1.0, 0])
        cells = cells_of(volume_of(solid), 0.25, ROBOT)
        places = cells.places_m
        west, east = (int(np.linalg.norm(places - [x, 1.5, 0], axis=1).argmin()) for x in (1.5, 8.5))
        region = regions_of(cells, west, ROBOT)
        assert (region[west] == region[east]) == passes, beside


def test_connected_sets_are_numbered_from_the_largest():
    usable = np.array([True, True, True, False, True, True])
    assert components_of(6, np.array([[0, 1], [2, 3], [3, 4], [4, 5], [5, 2]]), usable).tolist() == [1, 1, 0, -1, 0, 0]


def test_the_octree_has_all_the_free_space_and_a_map_has_each_storey():
    cells = cells_of(volume_of(SHAFT), 0.25, ROBOT)
    tree = BinaryTree(octree_of(cells))
    assert tree.volume_m3(FREE) == pytest.approx(SHAFT.volume(), rel=1e-9)
    assert tree.query(np.array([[5, 1, 5], [5, 1, 2.1], [9, 1, 3]])).tolist() == [FREE, OCCUPIED, FREE]
    maps = storey_maps(cells)
    assert sorted(maps) == ["map_00.png", "map_00.yaml", "map_01.png", "map_01.yaml"]
    assert b"# storey 1: floor" in maps["map_01.yaml"]


def test_straight_ways_of_a_metre_end_four_cells_farther_and_none_crosses_a_step_that_the_map_has():
    step = box(0, 0, 0, 3, 2, 2) + box(3, 0, -0.5, 3, 2, 2)
    cells = cells_of(volume_of(step), 0.25, ROBOT)
    ways = straight_ways(cells, neighbours_of(cells, ROBOT))
    apart = cells.places_m[ways[:, -1]] - cells.places_m[ways[:, 0]]
    assert np.allclose(np.sort(apart[:, :2], axis=1), [0, 1])
    assert np.allclose(apart[:, 2], 0)
    columns, rows = 24, 8
    assert len(ways) == 2 * (columns // 2 - 4) * rows + columns * (rows - 4)


def test_clearances_are_whole_millimetres_that_are_not_more():
    exact = np.array([0.0, 0.35, 0.35 - 1e-7, 0.3499, 0.3509, 1000.0])
    assert _rounded_down(exact).tolist() == [0.0, 0.35, 0.35, 0.349, 0.35, 1000.0]
