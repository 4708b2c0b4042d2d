"""Solids as volumes: labels, legs along floors, and files of a world."""

import json
import shutil
from itertools import pairwise

import manifold3d
import numpy as np
import pytest
import trimesh

from minexplore.bundle import PARTS, TOPOLOGY, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, Parts, VolumeFacets
from pipeline.errors import GeometryError
from pipeline.params.compile3d import VolumeParams
from pipeline.store.codecs import decode
from pipeline.survey.detect import detect_survey
from pipeline.types import ClosedMesh, SurveyedLegs
from pipeline.volume.rock.polygons import LONGEST_M
from pipeline.volume.shell import facets_without_part
from pipeline.volume.world.compile import BUILT, _built, compile_volume
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.topology import LegNetwork
from tests.composed import compose
from tests.volume_worlds import VolumeWorld, validated

DRIFT_M = 40.0


def mesh_of(solid):
    mesh = solid.simplify(0.001).to_mesh64()
    vertices, faces = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int32)
    return ClosedMesh(vertices, faces, 100.0)


def crossing():
    """A drift of 40 m with a crosscut of 20 m to either side, both 4 m wide and 3 m high."""
    return manifold3d.Manifold.cube([DRIFT_M, 4, 3]) + manifold3d.Manifold.cube([4, 44, 3]).translate([18, -20, 0])


def compiled(solid, folder):
    files = compile_volume(compose(["preset=light"]).compile3d, mesh_of(solid))
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return files


def test_the_volume_is_the_solid_with_floors_walls_and_roofs(tmp_path):
    compiled(crossing(), tmp_path)
    volume = decode(tmp_path / VOLUME, VolumeFacets)
    a, b, c = np.moveaxis(volume.vertices[volume.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    plan = DRIFT_M * 4 + 2 * 20 * 4
    assert closed_volume(volume).solid.volume() == pytest.approx(3 * plan)
    for label in (FacetLabel.FLOOR, FacetLabel.ROOF):
        assert area[volume.label == label].sum() == pytest.approx(plan)


def test_legs_follow_the_middles_of_the_floors(tmp_path):
    files = compiled(crossing(), tmp_path)
    network = json.loads(files[TOPOLOGY])
    assert (len(network["dead_ends"]), network["loops"], network["components"]) == (4, 0, 1)
    assert network["total_length_m"] == pytest.approx(
        DRIFT_M + 44 - 4 * 2, abs=1
    )  # an end is half a width from its face
    built = json.loads(files[BUILT])
    assert built["built_m"] == pytest.approx(built["surveyed_m"])
    assert built["datum_m"] == 100.0


def test_no_part_of_a_long_straight_drift_is_longer_than_mujoco_keeps_exactly(tmp_path):
    drift = manifold3d.Manifold.cube([336, 4, 3]).rotate([0, 0, 30])
    files = compiled(drift, tmp_path)
    volume, parts = decode(tmp_path / VOLUME, VolumeFacets), decode(tmp_path / PARTS, Parts)
    low, high = parts.boxes_m
    assert LONGEST_M / 2 < (high - low).max() <= LONGEST_M + 2 * 0.3  # of the depth behind its facet
    assert closed_volume(volume).solid.volume() == pytest.approx(336 * 4 * 3)
    assert json.loads(files[BUILT])["built_m"] == pytest.approx(336, abs=4)


def helix(turns=2.2, radius_m=8.0, rise_m=6.0, steps=24):
    """A decline 3 m wide and 3 m high that turns over itself."""
    frames = []
    for k in range(round(turns * steps) + 1):
        angle = 2 * np.pi * k / steps
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        foot = np.array([0, 0, rise_m * k / steps])
        frames.append([r * way + foot + [0, 0, z] for r in (radius_m - 1.5, radius_m + 1.5) for z in (0, 3)])
    parts = [manifold3d.Manifold.hull_points(np.array(a + b)) for a, b in pairwise(frames)]
    return manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add)


def test_a_facet_has_the_number_of_the_nearest_leg_in_the_order_of_the_network_file(tmp_path):
    network = json.loads(compiled(helix(), tmp_path)[TOPOLOGY])
    ends = [[network["stations_m"][leg[end]] for leg in network["legs"]] for end in ("start", "end")]
    middles, volume = np.mean(ends, axis=0), decode(tmp_path / VOLUME, VolumeFacets)
    apart_m = np.linalg.norm(volume.vertices[volume.faces].mean(axis=1)[:, None] - middles, axis=2)
    assert len(middles) > 2
    assert apart_m[np.arange(len(apart_m)), volume.leg] == pytest.approx(apart_m.min(axis=1), abs=1e-3)


def test_a_helix_has_no_leg_through_the_rock_between_its_turns(tmp_path):
    network = json.loads(compiled(helix(), tmp_path)[TOPOLOGY])
    assert (network["loops"], network["components"]) == (0, 1)
    stations = network["stations_m"]
    rises = [abs(stations[leg["end"]][2] - stations[leg["start"]][2]) for leg in network["legs"]]
    assert max(rises) < 1.0


def test_floors_over_each_other_have_legs_of_their_own_that_a_ramp_joins(tmp_path):
    low, high = manifold3d.Manifold.cube([60, 4, 3]), manifold3d.Manifold.cube([60, 4, 3]).translate([0, 0, 6])
    corners = [[x, y, z + dz] for x, z in ((60, 0), (100, 6)) for y in (0, 4) for dz in (0, 3)]
    ramp = manifold3d.Manifold.hull_points(np.array(corners, float))
    turn = manifold3d.Manifold.cube([4, 9, 3]).translate([100, 0, 6])
    back = manifold3d.Manifold.cube([48, 4, 3]).translate([56, 5, 6])
    front = manifold3d.Manifold.cube([4, 9, 3]).translate([56, 0, 6])
    network = json.loads(compiled(low + high + ramp + turn + back + front, tmp_path)[TOPOLOGY])
    assert network["components"] == 1
    heights = np.array(list(network["stations_m"].values()))[:, 2]
    assert heights.min() < 1.5
    assert heights.max() > 6.5


def test_a_shaft_without_a_floor_for_robots_is_refused_by_the_area_of_its_floors(tmp_path):
    with pytest.raises(GeometryError, match=r"largest floor, however low and steep, has 0\.6 m2, .*--unit"):
        compiled(manifold3d.Manifold.cube([0.75, 0.75, 30]), tmp_path)


@pytest.mark.parametrize(
    ("solid", "option", "value"),
    [
        (manifold3d.Manifold.cube([20, 2, 0.5]), "robot_height_m", 0.4),
        (manifold3d.Manifold.cube([20, 2, 3]).rotate([0, -25, 0]), "steepest", 0.6),
    ],
)
def test_a_solid_too_low_or_steep_is_refused_and_built_by_the_parameter_that_the_refusal_names(solid, option, value):
    with pytest.raises(GeometryError, match=f"compile3d.volume.{option}="):
        compile_volume(compose(["preset=light"]).compile3d, mesh_of(solid))
    params = compose(["preset=light", f"compile3d.volume.{option}={value}"]).compile3d
    assert len(json.loads(compile_volume(params, mesh_of(solid))[TOPOLOGY])["legs"]) >= 1


def test_rock_between_drifts_that_is_thinner_than_a_body_sinks_in_is_thickened(tmp_path):
    beside = manifold3d.Manifold.cube([DRIFT_M, 4, 3]).translate([0, 4.005, 0])
    compiled(manifold3d.Manifold.cube([DRIFT_M, 4, 3]) + beside, tmp_path)
    volume = closed_volume(decode(tmp_path / VOLUME, VolumeFacets))
    assert not facets_without_part(volume)
    assert volume.solid.volume() == pytest.approx(2 * DRIFT_M * 4 * 3 - 0.1 * DRIFT_M * 3, rel=0.01)
    assert {int(label) for label in volume.label} == {FacetLabel.FLOOR, FacetLabel.ROOF, FacetLabel.WALL}


@pytest.mark.slow
def test_the_world_of_a_scanned_cave_that_crosses_itself_is_certified(shared_rock, tmp_path):
    found = detect_survey(shared_rock)
    path = shutil.copy(shared_rock, tmp_path / "cave.stl")
    cave = VolumeWorld.from_solid(path, simplify_m=found.values["simplify_m"])
    judged = validated(cave.opened(), cave.shape, robot_contacts=300, ball_contacts=300)
    assert broken(judged) == set()
    assert judged.metrics["scan"]["within_10cm"] >= 0.95


def test_limits_of_floors_are_those_of_the_robot():
    assert VolumeParams().steepest == pytest.approx(np.tan(np.radians(20)), abs=1e-3)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    path = tmp_path_factory.mktemp("solid") / "a.ply"
    mesh = mesh_of(crossing())
    trimesh.Trimesh(mesh.vertices, mesh.faces).export(path)
    return VolumeWorld.from_solid(path)


def broken(found):
    return {name for name, clause in found.certificate.clauses.items() if not clause.holds}


def test_the_world_of_a_solid_is_certified_against_it(world):
    found = validated(world.opened(), world.shape, robot_contacts=300, ball_contacts=300)
    assert broken(found) == set()
    assert (found.metrics["solid"]["iou"], found.metrics["solid"]["within_10cm"]) == (1, 1)
    assert found.certificate.contacts >= 300


def test_the_world_of_another_solid_breaks_its_clauses(world):
    other = mesh_of(crossing().translate([0.5, 0, 0]))
    clauses = {"solid.iou", "solid.within_10cm", "solid.lump_m3", "solid.surface_mm"}
    assert broken(validated(world.opened(), other)) == clauses


def room_with(*pillars):
    """A room of 70 m by 70 m, 3 m high, without boxes (low, high) m of rock."""
    room = manifold3d.Manifold.cube([70, 70, 3])
    for low, high in np.array(pillars, float):
        room -= manifold3d.Manifold.cube((high - low).tolist()).translate(low.tolist())
    return room


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    path = tmp_path_factory.mktemp("room") / "a.ply"
    mesh = mesh_of(room_with())
    trimesh.Trimesh(mesh.vertices, mesh.faces).export(path)
    return VolumeWorld.from_solid(path)


def test_a_pillar_that_a_world_lacks_is_a_lump_even_if_it_is_little_of_the_solid(room):
    pillar = mesh_of(room_with([[30, 30, 0], [30.5, 30.5, 3]]))
    found = validated(room.opened(), pillar)
    assert broken(found) == {"solid.lump_m3"}
    assert found.metrics["solid"]["lump_m3"] == pytest.approx(0.75)
    assert found.metrics["solid"]["lump_at"] == "free at 30.2, 30.2, 1.5"
    assert broken(validated(room.opened(), mesh_of(room_with()))) == set()


@pytest.mark.parametrize(
    "low_high", [[[10, 10, 0], [14, 14, 3]], [[10, 10, 1], [14, 14, 2]], [[-1, 10, 1], [1, 14, 2]]]
)
def test_a_pillar_and_rock_that_floats_or_stands_out_are_built(tmp_path, low_high):
    solid = room_with(low_high)
    compiled(solid, tmp_path)
    built = closed_volume(decode(tmp_path / VOLUME, VolumeFacets))
    assert built.solid.volume() == pytest.approx(solid.volume())
    assert not facets_without_part(built)


def test_a_shaft_over_a_station_is_not_the_height_of_its_passage(tmp_path):
    shaft = manifold3d.Manifold.cube([2, 2, 20]).translate([8, 1, 1])
    legs = json.loads(compiled(crossing() + shaft, tmp_path)[TOPOLOGY])["legs"]
    assert {up + down for leg in legs for _, _, up, down in leg["lrud_m"]} == {3}


def test_what_is_built_is_no_longer_than_the_survey_after_rounding():
    legs = LegNetwork({}, [], [], [], [], 0, 1, 9.1096)
    nothing = np.zeros(0, np.uint8)
    surveyed = SurveyedLegs(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(1, np.int32), nothing, surveyed_m=9.1084)
    built = _built(surveyed, legs, 9.10851, 0, False)
    assert built.built_m <= built.piece_m <= built.surveyed_m
