"""What keeps a volume's mesh fit for a shell: no crossings, no slivers, no thin rock, floors that keep their slope."""

import dataclasses

import manifold3d
import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import GateCase
from benchmarks.comparisons.volume.random_caves import random_cave
from benchmarks.comparisons.volume.random_volumes import beyond, judge
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import InputError
from pipeline.geometry.facets.crossings import crossing_facets
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.types import ClosedMesh
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.network import network_of
from pipeline.volume.shell import build_shell, facets_without_part
from pipeline.volume.slivers import without_slivers
from pipeline.volume.thin_rock import without_thin_rock
from pipeline.volume.union import Volume, mesh_of, pieces_of, unite, without_crumbs
from pipeline.volume.world.solid import volume_of_solid
from tests.heights import HEADER

DRIFT = "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
BESIDE = DRIFT + "B,3,0,4.01,2,2,0,3,0\nB,4,20,4.01,2,2,0,3,0\n"  # 1 cm of rock between two drifts
UNDER = DRIFT + "B,3,0,0,2,2,-3.01,3,0\nB,4,20,0,2,2,-3.01,3,0\n"  # 1 cm of rock between roof and floor


def built(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    rough = unite(network, pieces_of(network))
    return network, rough, solve_floors(network)


def floor_heights(volume):
    return volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR]), 2]


def test_facets_cross_where_two_bodies_overlap_and_not_where_they_share_corners(tmp_path):
    _, _, volume = built(DRIFT, tmp_path)
    assert len(crossing_facets(volume.vertices, volume.faces, 1e-6)) == 0
    both = np.concatenate([volume.vertices, volume.vertices + np.full(3, 0.5)])
    faces = np.concatenate([volume.faces, volume.faces + len(volume.vertices)])
    pairs = crossing_facets(both, faces, 1e-6)
    assert len(pairs)
    assert ((pairs < len(volume.faces)).sum(axis=1) == 1).all()


def test_a_vertex_one_millimetre_beside_another_goes_and_the_mesh_stays_closed(tmp_path):
    _, _, volume = built(DRIFT, tmp_path)
    a, b, c = volume.faces[0]
    other = next(k for k, face in enumerate(volume.faces.tolist()) if {a, b} <= set(face) and k)
    d = next(k for k in volume.faces[other] if k not in (a, b))
    way = volume.vertices[b] - volume.vertices[a]
    vertices = np.vstack([volume.vertices, volume.vertices[a] + 1e-3 * way / np.linalg.norm(way)])
    m = len(volume.vertices)
    faces = np.vstack([np.delete(volume.faces, [0, other], axis=0), [[a, m, c], [m, b, c], [b, m, d], [m, a, d]]])
    parents = [k for k in range(len(volume.faces)) if k not in (0, other)] + [0, 0, other, other]
    spoilt = dataclasses.replace(
        volume, vertices=vertices, faces=faces, source=volume.source[parents], label=volume.label[parents]
    )
    found = without_slivers(spoilt)
    assert len(found.faces) == len(volume.faces)
    assert found.solid.volume() == pytest.approx(volume.solid.volume(), rel=1e-3)


def test_slivers_beside_each_other_in_one_plane_all_go():
    along = [(3.5026, 0.4997), (1.7663, 0.5002), (2.5993, 0.5003), (2.313, 0.5002), (3.3076, 0.5), (1.4743, 0.4999)]
    base = np.array([(0, 0), (4, 0), (4, 1), (0, 1), (0, 0.5), (4, 0.5), *along])
    vertices = np.vstack([np.column_stack([base, np.zeros(len(base))]), [[2, 0.5, -1]]])
    flat = [(0, 1, 5), (4, 2, 3), (0, 5, 6), (4, 0, 6), (2, 4, 7), (5, 2, 8), (2, 7, 8), (7, 5, 9)]
    flat += [(5, 8, 9), (8, 7, 9), (4, 5, 10), (5, 7, 10), (7, 4, 10), (5, 4, 11), (4, 6, 11), (6, 5, 11)]
    rim, tip = [0, 1, 5, 2, 3, 4], len(base)
    faces = np.array(flat + [(b, a, tip) for a, b in zip(rim, np.roll(rim, -1).tolist(), strict=True)])
    solid = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces.astype(np.uint64)))
    none = np.zeros(len(faces), int)
    found = without_slivers(Volume(vertices, faces, none, none, []))
    corners = found.vertices[found.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert (np.linalg.norm(found.normals, axis=1) > 0.003 * longest).all()
    assert found.solid.volume() == pytest.approx(solid.volume(), rel=1e-9)


@pytest.mark.parametrize("rows", [BESIDE, UNDER])
def test_two_drifts_with_a_centimetre_of_rock_between_them_stay_two_with_rock_that_parts_fit_into(rows, tmp_path):
    _, rough, volume = built(rows, tmp_path)
    assert facets_without_part(rough)
    assert not facets_without_part(volume)
    assert len(volume.solid.decompose()) == 2
    found = measure_enclosure(volume, build_shell(volume))
    assert found.thin.width_m < 1e-3
    assert found.thinnest_m > 0.0199
    assert found.intrusion.depth_m < 1e-6


def test_a_free_space_under_a_litre_that_thin_rock_did_not_cut_off_stays(tmp_path):
    _, rough, _ = built(BESIDE, tmp_path)
    hole = manifold3d.Manifold.cube([0.07, 0.07, 0.07]).translate([0, 0, -9])
    mesh = manifold3d.Manifold.compose([rough.solid, hole]).to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int32)
    volume = volume_of_solid(ClosedMesh(vertices, faces, 0.0, np.zeros((0, 3))), 0.364)
    assert facets_without_part(volume)
    sizes = sorted(part.volume() for part in without_thin_rock(volume, np.zeros((0, 3))).solid.decompose())
    assert len(sizes) == 3
    assert sizes[0] == pytest.approx(0.07**3)


def test_thin_rock_under_a_floor_is_taken_from_the_drift_below(tmp_path):
    _, rough, volume = built(UNDER, tmp_path)
    assert np.unique(floor_heights(rough).round(9)) == pytest.approx(np.unique(floor_heights(volume).round(9)))
    below = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.ROOF])][:, 2]
    assert below[below < floor_heights(volume).max()].max() < floor_heights(volume).max() - 0.05


@pytest.mark.parametrize(("east", "up"), [(6, 6.5), (0.5, 6.5), (-4, 4.2)])
def test_a_narrow_raise_that_leans_into_a_high_passage_is_built_from_floor_to_floor(east, up, tmp_path):
    place = f"{20 + east},0,0.4,0.4,{up},6,0.2"
    rows = DRIFT + f"B,2,20,0,0.4,0.4,0,3,0\nB,3,{place}\nC,3,{place}\nC,4,{40 + east},0,2,2,{up},3,0\n"
    network, _rough, volume = built(rows, tmp_path)
    assert measure_floor(volume, network).share_built == 1


def test_the_floor_of_a_wide_slope_is_level_across_to_its_far_wall(tmp_path):
    _, _, volume = built("A,1,0,0,1,10,0,3,0\nA,2,4,0,1,10,1,3,0\n", tmp_path)
    places = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR])]
    off = places[:, 2] - places[:, 0] / 4
    assert np.ptp(off) < 0.01


def test_a_steep_leg_begins_on_its_own_floor_and_is_built_whole(tmp_path):
    rows = DRIFT + "B,2,20,0,2,2,0,3,0\nB,3,30,0,2,2,-6,3,0\n"
    network, _rough, volume = built(rows, tmp_path)
    assert measure_floor(volume, network).share_built == 1


def test_floors_that_part_slowly_meet_without_a_step(tmp_path):
    rows = "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,-1,3,0\nA,3,40,5,2,2,-2,3,0\nB,2,20,0,2,2,-1,3,0\nB,4,40,-5,2,2,1,3,0\n"
    network, _rough, volume = built(rows, tmp_path)
    found = measure_floor(volume, network)
    assert max(found.way_step_m, found.step_m, found.other_step_m) < 0.01
    assert found.error_m < 0.01


def test_a_passage_whose_skew_sections_would_cross_is_built_without_crossings(tmp_path):
    network = GateCase("cave", random_cave(0)).network(tmp_path)  # its legs s9 to s10 to s11
    rough = unite(network, pieces_of(network))
    assert len(crossing_facets(rough.vertices, rough.faces, 1e-6)) == 0


def test_bad_stations_are_listed_by_name_and_the_rest_is_built():
    places = np.array([[0.0, 0], [20, 0], [20, 0.0004], [40, 0]])
    walls = np.array([[2.0, 2], [2, 2], [2, 2], [-1, 0.5]])
    heights = np.array([[0.0, 3, 0], [0, 3, 0], [0, 3, 0], [0, 0, 0]])
    network = network_of([SurveyLeg("1", ["1", "2", "2b", "3"], places, walls, heights)], 3.0, 1.0)
    assert network.repairs == (
        "3: its walls are -0.50 m apart, 0.05 m are taken",
        "3: its roof and floor are 0.00 m apart, 0.05 m are taken",
        "2 to 2b: no length, left out",
    )
    assert solve_floors(network).solid.volume() > 20 * 4 * 1.8


def test_a_leg_of_half_a_millimetre_at_the_end_of_a_chain_ends_its_tube():
    places = np.array([[0.0, 0], [20, 0], [20.0005, 0]])
    chain = SurveyLeg("1", ["1", "2", "2b"], places, np.full((3, 2), 2.0), np.tile([0.0, 3, 0], (3, 1)))
    east, north = np.array([20.0, 0]), np.array([0, 50.0])
    on = SurveyLeg("2", ["2b", "3"], places[:2] + east, np.full((2, 2), 2.0), np.tile([0.0, 3, 0], (2, 1)))
    far = SurveyLeg("3", ["4", "5"], places[:2] + north, np.full((2, 2), 2.0), np.tile([0.0, 3, 0], (2, 1)))
    network = network_of([chain, on, far], 3.0, 1.0)
    assert network.names == ("1", "2", "3", "4", "5")
    assert [network.leg_name(k) for k in range(3)] == ["1 to 2", "2 to 3", "4 to 5"]
    solid = unite(network, pieces_of(network)).solid
    assert len(solid.decompose()) == 2
    assert solid.volume() == pytest.approx(60 * (4 * 1.8 + 3 * 1.2), rel=1e-3)


def row_of(name, stations, places, walls=(2.0, 1.0)):
    """Return a leg of stations on one level."""
    count = len(stations)
    return SurveyLeg(
        name, list(stations), np.array(places), np.tile(walls, (count, 1)), np.tile([0.0, 3, 0], (count, 1))
    )


@pytest.mark.parametrize(
    ("on", "is_joined"),
    [
        (row_of("B", "bc", [(20.0, 0), (40, 4)]), True),
        (row_of("B", "cb", [(40.0, 4), (20, 0)], (1.0, 2.0)), True),  # the other way round
        (row_of("B", "bc", [(20.0, 0), (40, 4)], (2.0, 1.5)), False),
        (row_of("B", "bc", [(20.0, 0), (20, 20)]), False),  # a corner
    ],
)
def test_two_rows_that_end_at_a_station_with_a_section_of_their_own_share_it(on, is_joined):
    first = row_of("A", "ab", [(0.0, 0), (20, 0)])
    through = row_of("C", "dbe", [(20.0, 9), (20, 0), (20, -9)], (1.0, 1.0))
    assert shared_at_b([first, through, on]) == [is_joined, is_joined]


def test_which_of_three_rows_with_one_section_goes_on_is_not_known():
    first, on = row_of("A", "ab", [(0.0, 0), (20, 0)]), row_of("B", "bc", [(20.0, 0), (40, 4)])
    assert shared_at_b([first, on]) == [True, True]
    assert shared_at_b([first, on, row_of("D", "bf", [(20.0, 0), (40, -4)])]) == [False, False, False]
    alike = row_of("C", "dbe", [(20.0, 9), (20, 0), (20, -9)])
    assert shared_at_b([first, alike, on]) == [False, False]


def test_the_same_rows_go_on_however_legs_are_parted_into_rows():
    whole = [
        row_of("A", "abc", [(0.0, 0), (20, 0), (40, 4)]),
        row_of("B", "dbe", [(20.0, 9), (20, 0), (22, -9)], (1.0, 1.0)),
    ]
    parted = [
        row_of("A", "ab", [(0.0, 0), (20, 0)]),
        row_of("B", "db", [(20.0, 9), (20, 0)], (1.0, 1.0)),
        row_of("C", "bc", [(20.0, 0), (40, 4)]),
        row_of("D", "be", [(20.0, 0), (22, -9)], (1.0, 1.0)),
    ]
    one, other = network_of(whole, 3.0, 1.0), network_of(parted, 3.0, 1.0)
    legs = [[network.leg_name(k) for k in range(4)] for network in (one, other)]
    assert legs[0] == legs[1] == ["a to b", "b to c", "d to b", "b to e"]
    np.testing.assert_array_equal(one.across, other.across)
    np.testing.assert_array_equal(one.joined, other.joined)


def shared_at_b(legs):
    """Return of each leg of the network that has station b, but those to d and e, whether it shares its section."""
    network = network_of(legs, 3.0, 1.0)
    names = [network.leg_name(k).split(" to ") for k in range(len(network.shots))]
    return [
        bool(network.joined[k, ends.index("b")])
        for k, ends in enumerate(names)
        if "b" in ends and not {"d", "e"} & {*ends}
    ]


def test_legs_without_a_length_are_refused_in_one_line():
    leg = SurveyLeg("1", ["1", "2"], np.zeros((2, 2)), np.ones((2, 2)), np.zeros((2, 3)))
    with pytest.raises(InputError, match=r"^no leg of 1 has a length of 0\.001 m or more$"):
        network_of([leg], 3.0, 1.0)


def test_two_drifts_that_only_touch_are_built_with_rock_behind_every_facet(tmp_path):
    _, _, volume = built(DRIFT + "B,3,0,4,2,2,0,3,0\nB,4,20,4,2,2,0,3,0\n", tmp_path)
    found = measure_enclosure(volume, build_shell(volume))
    assert found.intrusion.depth_m < 1e-6
    assert max(found.gap.width_m, found.thin.width_m) < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed"),
    [("mine", 0), ("mine", 125), ("cave", 0), ("cave", 4), ("cave", 20), ("cave", 28), ("cave", 38), ("cave", 40)],
)
def test_a_random_survey_is_clean(kind, seed):
    assert beyond(judge(kind, seed)) == {}


def test_a_facet_that_booleans_of_all_parts_at_once_leave_by_rounding_is_not_missing():
    assert beyond(judge("cave", 144)) == {}


def test_pockets_and_rock_that_floats_go_and_the_facets_that_stay_keep_their_numbers():
    cube = manifold3d.Manifold.cube((1.0, 1.0, 1.0), True)
    large, tall, small = (
        cube.scale(size).translate(place).as_original()
        for size, place in (((4, 4, 4), (0, 0, 0)), ((1, 1, 9), (1000, 0, 0)), ((0.05, 0.05, 0.05), (1000, 2000, 0)))
    )
    floating = cube.as_original()
    kept = without_crumbs(manifold3d.Manifold.compose([large - floating, tall, small]), 1e-3)
    assert kept.volume() == pytest.approx(4**3 + 9, rel=1e-12)
    vertices, faces, number = mesh_of(kept, {large.original_id(): 1, tall.original_id(): 2, small.original_id(): 3})
    assert number.tolist() == [1] * 12 + [2] * 12
    assert (np.abs(vertices[faces[number == 2], 2]) == 4.5).all()
    assert without_crumbs(small, 1e-3) is small  # all there is stays
