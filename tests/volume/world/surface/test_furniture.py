"""Furniture in a volume: along its legs and over its floors, on its own rock, and made again by the validator."""

import dataclasses

import networkx as nx
import numpy as np
import pytest
from scipy.spatial import cKDTree

from minexplore.bundle import (
    FURNITURE as FURNITURE_KINDS,
)
from minexplore.bundle import (
    FURNITURE_ABOVE_M,
    LINES_ABOVE_M,
    BundleError,
    decode_msh,
    encode_msh,
    fitting_geom,
    fitting_material,
    is_fitting,
    mesh_file,
    mesh_of,
)
from minexplore.floors.volume_arrays import FloorSpans
from minexplore.sealed.files import read_folder
from minexplore.sensing.facet_meshes import volume_meshes
from minexplore.sensing.lidar import Lidar
from minexplore.world import load_world
from pipeline.errors import ArtifactError
from pipeline.export.extract_volume import read_volume_scene
from pipeline.geometry.polyline import FloorLine
from pipeline.proof.rebuilt.fittings import require_furniture
from pipeline.schema import check_world
from pipeline.store.codecs import decode
from pipeline.volume.world.drifts.ways import Drift, drifts_along, lines_through
from pipeline.volume.world.surface.furnished import hang_again, is_furnished
from pipeline.volume.world.topology import LegNetwork
from tests.heights import HEADER
from tests.mines import require_allowed
from tests.volume.world.surface.test_volume_rock import resealed
from tests.volume_worlds import WITH_ROCK, VolumeWorld, with_rock
from tests.volumes import build_volume

# A drift that falls by 15 % and turns, 4 m wide and 3.2 m high, and one from its middle that gets 2 m high.
SLOPE = HEADER + (
    "A,1,0,0,2,2,10,3.2,0\nA,2,16,0,2,2,7.6,3.2,0\nA,3,32,6,2,2,5.2,3.2,0\nB,2,16,0,1,1,7.6,3.2,0\nB,4,16,14,1,1,7.6,2,0\n"
)
FURNITURE = WITH_ROCK.realism.furniture


@pytest.fixture(scope="module")
def slope(tmp_path_factory):
    """Return the bundle of a drift on a slope, with visible rock and furniture; tests must not change it."""
    return with_rock(SLOPE, tmp_path_factory.mktemp("slope")) / "rocky"


def furniture_of(folder):
    found = {mesh_of(str(path.relative_to(folder))): path for path in sorted(folder.glob("meshes/*"))}
    kinds = {name: name.partition("_")[0] for name in found}
    return {name: decode_msh(path.read_bytes()) for name, path in found.items() if kinds[name] in FURNITURE_KINDS}


def require(folder):
    files = [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()]
    require_furniture(folder, files, FURNITURE, hang_again(folder, files))


def copy_with(slope, folder, **changes):
    for name, data in {**read_folder(slope), **changes}.items():
        if data is not None:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(data)
    return folder


def test_bolts_pipe_and_cable_follow_the_slope_above_robots_and_on_the_rock(slope):
    furniture, cells = furniture_of(slope), decode(slope / "cells.npz", FloorSpans)
    rock = np.concatenate(
        [decode_msh(path.read_bytes()).vertices for path in slope.glob("meshes/*") if not is_fitting(path.stem)]
    )
    for kind, least in (("bolts", FURNITURE_ABOVE_M), ("pipe", LINES_ABOVE_M), ("cable", LINES_ABOVE_M)):
        points = np.concatenate([mesh.vertices for name, mesh in furniture.items() if name.startswith(kind)])
        assert cells.heights_over(points).min() >= least
        assert np.ptp(points[:, 0]) > 25  # both legs of the drift
        assert np.percentile(cKDTree(rock).query(points)[0], 95) < 0.6
        on_slope = np.interp(points[:, 0], [0, 16, 32], [5, 2.6, 0.2])  # m, in the mine frame
        assert np.ptp(points[:, 2] - on_slope) < 3.2 < np.ptp(points[:, 2])


def test_the_schema_allows_the_bundle_and_the_validator_makes_it_again(slope):
    check_world(slope)
    require(slope)


def test_ways_end_at_junctions_and_where_the_roof_is_too_low(slope):
    ways = [drift.way for drift in drifts_along(decode(slope / "topology.json", LegNetwork), is_furnished)]
    assert sorted(round(way.length_m, 1) for way in ways) == [16.2, 17.3]  # the low drift has none
    assert sorted(way.ends_at_junctions for way in ways) == [(False, True), (True, False)]


def test_ways_go_through_stations_of_two_legs_and_turn_left_and_right_where_a_leg_was_surveyed_backwards(tmp_path):
    table = "A,1,0,0,1,2,0,3,0\nA,2,10,0,1,2,0,3,0\nB,3,20,0,2,1,-1,3,0\nB,2,10,0,2,1,0,3,0\n"
    (drift,) = drifts_along(decode(build_volume(HEADER + table, tmp_path) / "topology.json", LegNetwork))
    way = drift.way
    assert way.length_m == pytest.approx(10 + np.hypot(10, 1), abs=1e-3)
    assert len({(left, right) for left, right in zip(way.left_m.tolist(), way.right_m.tolist(), strict=True)}) == 1


def test_a_ring_of_legs_is_one_way(tmp_path):
    table = "A,1,0,0,2,2,0,3,0\nA,2,30,0,2,2,1,3,0\nA,3,30,30,2,2,2,3,0\nA,4,0,30,2,2,1,3,0\nA,1,0,0,2,2,0,3,0\n"
    drifts = drifts_along(VolumeWorld(HEADER + table, tmp_path).decoded("topology.json", LegNetwork))
    assert [drift.way.length_m for drift in drifts] == pytest.approx([4 * np.hypot(30, 1)], abs=1e-3)
    (line,) = lines_through(drifts)
    assert line.length_m == pytest.approx(drifts[0].way.length_m)


def test_a_cable_goes_on_through_a_junction_where_its_rib_does(slope):
    meshes = [mesh for name, mesh in furniture_of(slope).items() if name.startswith("cable")]
    triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes]).astype(np.float64)
    _, number = np.unique(triangles.reshape(-1, 3).round(3), axis=0, return_inverse=True)
    graph = nx.Graph(edge for a, b, c in number.reshape(-1, 3).tolist() for edge in ((a, b), (b, c)))
    assert np.ptp(triangles[:, :, 0]) > 28
    assert nx.number_connected_components(graph) == 1


def test_lines_take_the_straightest_way_through_a_junction_whatever_way_legs_were_surveyed():
    def drift(start, end, places, left_m, right_m):
        floor = np.column_stack([places, np.zeros(len(places))])
        return Drift(
            FloorLine(floor, np.full(len(places), left_m), np.full(len(places), right_m), (True, True)),
            (start, end),
            np.full(len(places), 3.0),
        )

    west, north = (
        drift("x", "w", [(0.0, 0.0), (-30.0, 0.0)], 1.0, 2.0),
        drift("x", "n", [(0.0, 0.0), (0.0, 20.0)], 1.0, 1.0),
    )
    east, far = (
        drift("e", "x", [(30.0, 10.0), (0.0, 0.0)], 1.0, 2.0),
        drift("e", "f", [(30.0, 10.0), (60.0, 12.0)], 2.0, 1.0),
    )
    lines = lines_through([west, north, east, far])
    assert sorted(round(line.length_m, 2) for line in lines) == [
        20.0,
        round(30 + np.hypot(30, 10) + np.hypot(30, 2), 2),
    ]
    whole = max(lines, key=lambda line: line.length_m)
    assert len(whole.floor_m) == 4
    assert len(set(zip(whole.left_m.tolist(), whole.right_m.tolist(), strict=True))) == 1  # a rib stays on its side


def test_a_line_that_doubles_back_has_a_left_side_everywhere():
    line = np.array([[0.0, 0, 0], [8, 0, 1], [0, 0, 2]])
    at = FloorLine(line, np.ones(3), np.ones(3)).places(1.0)
    assert np.linalg.norm(at.left, axis=1) == pytest.approx(1.0)


def test_heights_are_over_the_first_floor_below_in_a_cell_or_beside_it():
    zeros = np.zeros(3)
    column, row = np.array([0, 0, 3], np.int32), np.zeros(3, np.int32)
    cells = FloorSpans(
        column,
        row,
        np.array([0.0, 5.0, 1.0]),
        zeros,
        zeros,
        row,
        np.zeros((3, 3)),
        np.zeros((3, 4)),
        np.array([10.0, 20.0]),
        0.5,
    )
    points = np.array([[10.1, 20.1, 4.0], [10.1, 20.1, 6.0], [10.6, 20.1, 4.0], [11.1, 20.1, 3.0], [10.1, 20.1, -1.0]])
    assert cells.heights_over(points).tolist() == [4.0, 1.0, 4.0, 2.0, np.inf]
    assert cells.heights_over(np.array([[50.0, -90.0, 3.0], [-70.0, 20.1, 3.0]])).tolist() == [np.inf, np.inf]


@pytest.mark.parametrize(("moved_m", "message"), [(0.05, "m from where it should be"), (None, "missing")])
def test_furniture_that_the_builder_would_not_hang_is_refused(slope, tmp_path, moved_m, message):
    name = next(name for name in furniture_of(slope) if name.startswith("pipe"))
    mesh = furniture_of(slope)[name]
    if moved_m is not None:
        mesh = encode_msh(dataclasses.replace(mesh, vertices=mesh.vertices + np.float32([0, 0, moved_m])))
    folder = copy_with(slope, tmp_path, **{mesh_file(name): mesh if moved_m is not None else None})
    with pytest.raises(ArtifactError, match=f"{name}.*{message}"):
        require(folder)


def test_the_schema_refuses_furniture_among_robots(slope, tmp_path):
    def refusal(**changes):
        changed = resealed(read_folder(slope), **changes)
        with pytest.raises(BundleError) as error:
            require_allowed(tmp_path, changed)
        return str(error.value)

    name, mesh = next((name, mesh) for name, mesh in furniture_of(slope).items() if name.startswith("bolts"))
    low = dataclasses.replace(mesh, vertices=mesh.vertices - np.float32([0, 0, 2.2]))
    assert "above the floor, want 1 m or more" in refusal(**{mesh_file(name): encode_msh(low)})


def test_beams_end_on_the_pipe(slope):
    world = load_world(slope)
    meshes = volume_meshes(world, world.volume.facets)
    bare = {name: mesh for name, mesh in meshes.items() if not name.startswith(fitting_geom(""))}
    eye, ray = np.array([[8.0, 0.0, 3.8 + 2.2]]), np.array([[[0.0, 1.0, 0.0]]])
    near, far = (Lidar(found, 20.0, floor_m=-np.inf).cast(eye, ray)[0, 0] for found in (meshes, bare))
    assert 0.05 < far - near < 0.6


def test_an_export_has_the_furniture_with_its_own_materials(slope):
    scene = read_volume_scene(load_world(slope), "CC0-1.0")
    shown = {surface.name: surface for surface in scene.surfaces if surface.label in FURNITURE_KINDS}
    assert shown.keys() == furniture_of(slope).keys()
    assert all(surface.material == fitting_material(name, []) for name, surface in shown.items())
    assert all(surface.material in scene.materials for surface in shown.values())
