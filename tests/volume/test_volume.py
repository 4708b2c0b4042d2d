"""A mine as one closed volume: shapes with known answers, floors that meet, and a shell that holds."""

import dataclasses

import numpy as np
import pytest

from benchmarks.comparisons.volume.cases import CASES, GateCase
from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.facets.separation import ConvexBodies, Facets
from pipeline.params.validation import VolumeProofParams
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floor_error import measure_floor
from pipeline.volume.floors import solve_floors
from pipeline.volume.shell import build_shell
from pipeline.volume.union import pieces_of, unite
from pipeline.volume.world.proof import physics, throws
from pipeline.volume.world.proof.certificate import _bodies
from pipeline.volume.world.proof.region import region_of
from tests.heights import HEADER

BOX = "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
PITCH = BOX + "B,2,20,0,2,2,0,3,0\nB,3,20,0,1,1,-12,3,0\nC,3,20,0,2,2,-12,3,0\nC,4,40,0,2,2,-12,3,0\n"


def built(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    return network, unite(network, pieces_of(network))


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    network, _ = built(BOX, tmp_path_factory.mktemp("box"))
    volume = solve_floors(network)
    return network, volume, build_shell(volume)


def test_a_straight_drift_has_the_volume_and_the_floor_of_its_section(box):
    _, volume, _ = box
    section = 4 * 1.8 + (4 + 2) / 2 * 1.2  # walls to 0.6 of the height, then a roof half as wide
    assert volume.solid.volume() == pytest.approx(20 * section, rel=1e-7)  # the slab is 0.3 um wider than the walls
    floor = np.linalg.norm(volume.normals[volume.label == FacetLabel.FLOOR], axis=1).sum() / 2
    assert floor == pytest.approx(80, rel=1e-6)


@pytest.mark.parametrize(("left", "right"), [(0, 3), (3, 0), (1, 4), (2, 3)])
def test_a_station_beside_its_passages_middle_has_its_measured_roof_over_it(tmp_path, left, right):
    network, _ = built(f"A,a,0,0,{left},{right},0,2,1\nA,b,20,0,{left},{right},1,2,1\n", tmp_path)
    beside = np.clip(0.0, 0.01 - right, left - 0.01)  # to the left: a station may be on a wall
    over = network.ends_m[0].mean(axis=0) + np.array([[0, beside, 1.98], [0, beside, 2.02]])
    assert (solve_floors(network).inside.distance_m(over) > 0).tolist() == [True, False]


def test_the_shell_of_a_drift_lies_in_the_rock_and_covers_every_facet(box):
    _, volume, parts = box
    found = measure_enclosure(volume, parts)
    assert found.intrusion.depth_m < 1e-6
    assert max(found.gap.width_m, found.thin.width_m) < 1e-4
    assert len(found.unbacked) == 0
    assert found.thinnest_m == pytest.approx(0.3, abs=1e-3)
    assert sorted(k for part in parts for k in part.facets) == list(range(len(volume.faces)))


def test_a_part_that_is_taken_out_is_missing_and_lets_balls_escape(box):
    _, volume, parts = box
    largest = max(parts, key=lambda part: part.area_m2)
    kept = [part for part in parts if part is not largest]
    found = measure_enclosure(volume, kept)
    front = volume.vertices[np.unique(volume.faces[largest.facets])]
    assert 4 - 1e-3 < found.gap.width_m < 8  # a strip of 20 x 4 m, in two facets
    assert (found.gap.place_m > front.min(axis=0) - 1e-6).all()
    assert (found.gap.place_m < front.max(axis=0) + 1e-6).all()
    thrown = [throws.throw_balls(volume, some, 2000, True, np.random.default_rng(0)) for some in (parts, kept)]
    assert thrown[0].escapes == 0
    assert thrown[1].escapes > 0


def test_a_part_that_is_moved_into_the_drift_is_found(box):
    _, volume, parts = box
    floor = next(part for part in parts if volume.label[part.facets[0]] == FacetLabel.FLOOR)
    raised = dataclasses.replace(floor, corners=floor.corners + np.array([0, 0, 0.1]))
    kept = [part for part in parts if part is not floor]
    found = measure_enclosure(volume, [raised, *kept])
    assert found.intrusion.depth_m == pytest.approx(0.1, abs=1e-4)


def test_the_floors_of_a_junction_on_a_slope_meet_without_a_step_and_follow_the_survey(tmp_path):
    network = CASES["tee"].network(tmp_path)
    rough = unite(network, pieces_of(network))
    assert max(abs(place.off_m) for place in measure_floor(rough, network).elsewhere) > 0.1
    found = measure_floor(solve_floors(network), network)
    assert found.error_m < 0.01
    assert found.elsewhere == ()
    assert max(found.step_m, found.other_step_m) < 0.01
    assert found.share_built == 1


def test_a_pitch_joins_two_levels_without_a_case_of_its_own(tmp_path):
    network, _ = built(PITCH, tmp_path)
    volume = solve_floors(network)
    assert len(volume.solid.decompose()) == 1
    found = measure_floor(volume, network)
    assert found.share_built == 1
    assert 0 < found.over_floor < 1  # there is none over the pitch
    assert found.error_m < 0.01


def test_a_robot_rests_and_climbs_on_a_sloping_junction(tmp_path):
    network = CASES["tee"].network(tmp_path)
    volume = solve_floors(network)
    found = physics.measure_standing(volume, build_shell(volume), np.random.default_rng(0))
    assert found.rest_m < 0.01
    assert found.climb_share == 1
    assert found.both_off_s < 0.05


def test_robots_do_not_rock_where_a_level_drift_bends_into_a_ramp(tmp_path):
    rows = "A,1,-32.927,-222.855,2,2,10,3.5,0\nA,2,27.073,-222.855,2,2,10,3.5,0\nA,3,27.073,-182.855,2,2,12,3.5,0\n"
    volume = solve_floors(built(rows, tmp_path)[0])
    found = physics.measure_standing(volume, build_shell(volume), np.random.default_rng(0))
    assert found.rest_m < 0.005
    number, place = found.rest_at
    assert 0 <= number < physics.ROBOTS
    low, high = volume.vertices.min(axis=0), volume.vertices.max(axis=0)
    assert (low < place).all()
    assert (place < high).all()


def test_where_no_robot_fits_none_moves_and_none_climbs(tmp_path):
    _, crawl = built("A,1,0,0,0.1,0.1,0,0.2,0\nA,2,5,0,0.1,0.1,0,0.2,0\n", tmp_path)
    found = physics.measure_standing(crawl, build_shell(crawl), np.random.default_rng(0))
    assert (found.rest_m, found.climb_share, found.both_off_s) == (0, 0, 0)


def test_where_no_robot_rests_about_the_first_place_others_are_tried(tmp_path):
    crawl = "".join(f"A,{k},{10 * k},{3 * (k % 2)},0.3,0.3,0,0.5,0\n" for k in range(31))
    _, volume = built(crawl + "A,31,301,0,3,3,0,3,0\nA,32,340,0,3,3,0,3,0\n", tmp_path)
    parts, params = build_shell(volume), VolumeProofParams(most_parts=20, robot_contacts=5, ball_contacts=0)
    first = [region_of(volume, parts, params.most_parts, np.random.default_rng(seed)) for seed in range(8)]
    drift_m = volume.vertices[:, 0].max() - 41
    in_crawl = [volume.vertices[volume.faces[one.targets]][..., 0].max() < drift_m for one in first]
    assert any(in_crawl)
    found = [_bodies(params, volume, parts, np.random.default_rng(seed)) for seed in np.flatnonzero(in_crawl)]
    assert all("rest_at" in one["standing"] for one in found)


def test_robots_at_rest_are_judged_where_the_floor_about_them_is_even(tmp_path):
    network, _ = built(PITCH, tmp_path)
    volume = solve_floors(network)
    top = volume.vertices[volume.faces[volume.label == FacetLabel.FLOOR]][..., 2].max()
    at = np.array([network.places_m[network.names.index(name)] for name in ("1", "2")])
    away = (at[1] - at[0]) / np.linalg.norm(at[1] - at[0])
    inside, beside = at[0] + 6 * away, at[1] - 1.4 * away
    places = np.array([[*inside[:2], top], [*beside[:2], top]])
    assert physics._is_even(volume, places).tolist() == [True, False]


def test_shots_without_a_length_are_counted_and_left_out(tmp_path):
    network, _ = built(BOX + "A,3,20,0.0005,2,2,0,3,0\nA,4,40,0,2,2,0,3,0\n", tmp_path)
    assert network.skipped == 1
    assert len(network.shots) == 2


def test_a_prism_on_a_wide_station_ends_where_its_shortest_leg_does(tmp_path):
    rows = "A,1,0,0,2,2,0,3,0\nA,2,20,0,6,6,0,3,0\nB,2,20,0,6,6,0,3,0\nB,3,20,3,2,2,1,3,0\n"
    network = GateCase("test", HEADER + rows).network(tmp_path)
    hub = next(piece for piece in pieces_of(network) if len(piece.sections) == 1)
    middle = hub.footprint.mean(axis=0)
    assert np.linalg.norm(hub.footprint - middle, axis=1).max() == pytest.approx(3.0)


def test_a_leg_over_the_deeper_floor_of_another_is_listed_by_station_and_its_own_floors_keep_the_survey(tmp_path):
    network, rough = built(BOX + "B,3,10,-10,2,2,-0.3,3,0\nB,4,10,10,2,2,-0.3,3,0\n", tmp_path)
    found = measure_floor(rough, network)
    (entry,) = found.elsewhere
    assert (entry.leg, entry.other) == ("1 to 2", "3 to 4")
    assert entry.off_m == pytest.approx(-0.3)
    assert entry.share == pytest.approx(4 / 20, abs=0.03)
    assert found.error_m < 0.01


def test_a_ledge_whose_corners_are_not_over_each_other_is_folded_without_a_crossing(tmp_path):
    network = CASES["tee"].network(tmp_path)
    volume = solve_floors(network)
    ledge = (volume.label == FacetLabel.FLOOR) & (
        np.abs(volume.normals[:, 2]) < 1e-6 * np.linalg.norm(volume.normals, axis=1)
    )
    assert not ledge.any()


def test_a_facet_reaches_into_a_body_as_deep_as_it_is_moved_into_it():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1]]], float)
    bodies = ConvexBodies(corners, np.array([[[0, 0, 1.0]]]), np.array([[[1.0, 0, 0]]]), np.array([7]))
    touching = np.array([[0.2, 0.2, 0], [0.3, 0.2, 1], [0.2, 0.3, 1]], float)
    faces = np.array([[0, 1, 2]])
    assert len(Facets(touching, faces).crossing(bodies).body) == 0
    found = Facets(touching - [0, 0, 0.05], faces).crossing(bodies)
    assert found.depth_m == pytest.approx([0.05])


def test_a_leaning_shaft_stands_plumb_on_its_lower_floor(tmp_path):
    rows = BOX + "B,2,20,0,2,2,0,3,0\nB,3,24,0,1,1,-12,3,0\n"
    _, rough = built(rows, tmp_path)
    sections = next(piece for piece in rough.pieces if piece.is_plumb).sections
    low = sections[np.abs(sections[:, 0, 2] - sections[:, :, 2].min()) < 0.61]
    assert np.ptp(low[:, 0, 2]) == pytest.approx(0.6)
    assert np.abs(np.ptp(low[:, :, :2], axis=0)).max() == 0
