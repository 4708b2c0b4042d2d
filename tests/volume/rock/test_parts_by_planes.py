"""Parts against the free space by planes and rays: what they say is what booleans say."""

import dataclasses

import manifold3d
import numpy as np
import pytest
import shapely

from benchmarks.comparisons.volume.cases import GateCase
from pipeline.geometry.facets.crossings import crossing_facets
from pipeline.geometry.facets.separation import Facets
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.floors import solve_floors
from pipeline.volume.rock.cleared import parts_not_cleared
from pipeline.volume.rock.depth import deepest, is_deeper
from pipeline.volume.rock.faces import PartFaces, faces_on_facets, polygons_shared
from pipeline.volume.rock.intruding_volume import shared_m3
from pipeline.volume.rock.polygons import polygons_of
from pipeline.volume.rock.ragged import parts_of
from pipeline.volume.rock.rays import blocked
from pipeline.volume.rock.shapes import shaped
from pipeline.volume.rock.surfaces import RockSurfaces
from pipeline.volume.rock.tiles import Tile
from pipeline.volume.shell import build_shell
from tests.heights import HEADER

DRIFT = "A,1,0,0,2,2,0,3,0\nA,2,20,0,2,2,0,3,0\n"
BESIDE = DRIFT + "B,3,0,4.1,2,2,0,3,0\nB,4,20,4.1,2,2,0,3,0\n"  # 10 cm of rock between two drifts

FORK = DRIFT + "B,1,0,0,2,2,0,3,0\nB,4,20,8,1.5,1.5,2,2.5,0\n"  # a wedge of rock between two drifts


def built(rows, folder):
    network = GateCase("test", HEADER + rows).network(folder)
    return solve_floors(network)


@pytest.fixture(scope="module")
def drift(tmp_path_factory):
    volume = built(DRIFT, tmp_path_factory.mktemp("drift"))
    return volume, build_shell(volume)


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    return built(BESIDE, tmp_path_factory.mktemp("beside"))


def shared_of(volume, bodies):
    return shared_m3(Facets(volume.vertices, volume.faces), bodies, volume.inside.are_free)


def bare_by_booleans(volume, parts):
    """Return the area, m2, of facets that is left of the free space when each part, moved 10 um out, is subtracted."""
    left = volume.solid
    for part, way in zip(parts, outward_of(volume, parts), strict=True):
        left -= manifold3d.Manifold.hull_points(part.corners + 1e-5 * way)
    mesh = left.to_mesh64()
    runs = np.diff(np.asarray(mesh.run_index).astype(int)) // 3
    ours = np.repeat(np.asarray(mesh.run_original_id) == volume.solid.original_id(), runs)
    a, b, c = np.moveaxis(np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts, int)[ours]], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def outward_of(volume, parts):
    unit = volume.normals / np.linalg.norm(volume.normals, axis=1, keepdims=True)
    return -unit[[part.facets[0] for part in parts]]


def test_planes_clear_every_part_that_booleans_find_in_the_rock_and_no_part_that_is_moved_into_the_drift(drift):
    volume, parts = drift
    outward = outward_of(volume, parts)
    assert len(parts_not_cleared(volume, parts_of([part.corners for part in parts]), outward)) == 0
    moved = [part.corners + 0.01 * way for part, way in zip(parts, outward, strict=True)]
    assert (shared_of(volume, moved) > 1e-4).all()
    assert parts_not_cleared(volume, parts_of(moved), outward).tolist() == list(range(len(parts)))


def test_a_part_in_the_middle_of_the_drift_that_touches_no_facet_intrudes_with_its_whole_volume(drift):
    volume, parts = drift
    cube = np.array(np.meshgrid(*[[-0.1, 0.1]] * 3)).reshape(3, -1).T
    floating = dataclasses.replace(parts[0], corners=volume.vertices.mean(axis=0) + cube)
    found = measure_enclosure(volume, [*parts, floating])
    corners = volume.vertices.mean(axis=0) + cube
    assert found.intrusion.depth_m == pytest.approx(volume.inside.distance_m(corners).max(), abs=2e-4)
    assert len(found.unbacked) == 1


def test_half_a_part_covers_half_of_its_facets(drift):
    volume, parts = drift
    largest = max(parts, key=lambda part: part.area_m2)
    corners = largest.corners
    middle = corners[:, 0].mean()
    near, far = corners[corners[:, 0] < middle], corners[corners[:, 0] > middle]
    halfway = [(a * (b[0] - middle) + b * (middle - a[0])) / (b[0] - a[0]) for a in near for b in far]
    half = dataclasses.replace(largest, corners=np.concatenate([near, halfway]))
    some = [half if part is largest else part for part in parts]
    found = faces_on_facets(volume, parts_of([part.corners for part in some]))
    bare = found.uncovered_m2(np.linalg.norm(volume.normals, axis=1) / 2)
    assert bare.sum() == pytest.approx(largest.area_m2 / 2, rel=0.05)
    assert bare.sum() == pytest.approx(bare_by_booleans(volume, some), rel=1e-3)


def test_a_facet_that_two_parts_cover_in_halves_is_covered(drift):
    volume, parts = drift
    x = volume.vertices[:, 0].mean()
    halves = []
    for part in parts:
        solid = manifold3d.Manifold.hull_points(part.corners)
        halves += [
            np.asarray(half.to_mesh64().vert_properties)[:, :3]
            for half in solid.split_by_plane([1, 0, 0], x)
            if not half.is_empty()
        ]
    assert len(halves) > len(parts)
    bare = faces_on_facets(volume, parts_of(halves)).uncovered_m2(np.linalg.norm(volume.normals, axis=1) / 2)
    assert bare.sum() < 1e-6


@pytest.mark.parametrize("kind", ["moved", "cut"])
def test_rays_block_deep_parts_between_two_drifts_and_none_that_fits(beside, kind):
    count = {0.3: 0, 0.08: 0}
    for depth in count:
        for polygons in RockSurfaces(beside, polygons_of(beside)).polygons():
            bodies = shaped(polygons, kind, depth)
            found = blocked(beside.inside, polygons, kind, depth)
            count[depth] += found.sum()
            assert (shared_of(beside, list(bodies.corners[found])) > 0).all()
    assert count[0.3] > 0
    assert count[0.08] == 0


def test_the_boxes_about_a_place_hold_all_of_the_free_space_there(beside):
    root, middle = Tile.of(beside.solid), beside.vertices.mean(axis=0)
    whole = list(root.about(root.low, root.high))
    assert sum(tile.solid.volume() for tile in whole) == pytest.approx(beside.solid.volume(), rel=1e-9)
    box = manifold3d.Manifold.cube([2, 2, 2], True).translate(middle.tolist())
    about = sum((tile.solid ^ box).volume() for tile in root.about(middle - 1, middle + 1))
    assert about == pytest.approx((beside.solid ^ box).volume(), rel=1e-9)


def test_a_sliver_whose_plane_is_off_a_little_is_covered_by_the_part_behind_its_neighbours(drift):
    volume, parts = drift
    largest = max(parts, key=lambda part: part.area_m2)
    k = largest.facets[0]
    a, b, c = volume.faces[k]
    vertices = np.vstack([volume.vertices, (volume.vertices[b] + volume.vertices[c]) / 2])
    way = volume.vertices[a] - vertices[-1]
    vertices[-1] += 1e-3 * way / np.linalg.norm(way)  # the facet from b to c becomes a sliver of 1 mm ...
    normal = volume.normals[k] / np.linalg.norm(volume.normals[k])
    vertices[-1] += 1e-6 * normal  # ... whose plane leans by a milliradian
    m = len(volume.vertices)
    faces = np.vstack([np.delete(volume.faces, k, axis=0), [[a, b, m], [a, m, c], [m, b, c]]])
    label = np.append(np.delete(volume.label, k), [volume.label[k]] * 3)
    spoilt = dataclasses.replace(volume, vertices=vertices, faces=faces, label=label)
    found = faces_on_facets(spoilt, parts_of([part.corners for part in parts]))
    bare = found.uncovered_m2(np.linalg.norm(spoilt.normals, axis=1) / 2)
    assert bare[-3:] == pytest.approx(0, abs=1e-7)
    without = [part.corners for part in parts if part is not largest]
    assert (
        faces_on_facets(spoilt, parts_of(without)).uncovered_m2(np.linalg.norm(spoilt.normals, axis=1) / 2)[-3:].min()
        > 0
    )


def test_two_faces_whose_common_edge_differs_in_the_last_digit_cover_a_facet():
    one = "POLYGON ((-23.89635680605867 2.0085910746293596, 5.812930027571039 0.4658868644443661, {}, {}))"
    two = "POLYGON (({}, 5.812930027571039 0.465886864444366, 15.115838025980343 -0.0171821306640664, {}, {}))"
    edge, last = "5.812924976847517 -1.6281436361541455", "8.780518780078332 -1.9914089439652933"
    shared = shapely.from_wkt([one.format(edge, "-23.89635680605867 2.0085910746293596"), two.format(edge, last, edge)])
    both, none = np.array([0, 1]), np.zeros(2)
    faces = PartFaces(both, np.zeros(2, int), shapely.area(shared), none, shared)
    area = float(shapely.area(shared).sum())
    assert faces.uncovered_m2(np.array([area]))[0] < 1e-6


def test_a_face_whose_side_lies_on_a_facets_side_but_for_the_last_digit_shares_its_area():
    corner = (-19.09757310772768, -2.6482075865761723)
    face = shapely.Polygon(
        [corner, (-7.070262403782666, -0.4851904865847516), (-7.069572558657299, -1.4306596385153392)]
    )
    facet = shapely.Polygon([(10.909317962655086, 0.38927387190722973), (8.188255145072603, 2.258933714668942), corner])
    shared = polygons_shared(np.array([face, facet]), np.array([facet, shapely.Point(30, 30).buffer(1)]))
    assert shapely.area(shared) == pytest.approx([face.area, 0.0])


def test_parts_that_differ_from_their_facets_in_the_last_digit_cover_them(drift):
    volume, parts = drift
    rng, area = np.random.default_rng(0), np.linalg.norm(volume.normals, axis=1) / 2
    for _ in range(20):
        moved = [part.corners * (1 + rng.integers(-2, 3, part.corners.shape) * 1.1e-16) for part in parts]
        assert faces_on_facets(volume, parts_of(moved)).uncovered_m2(area).sum() < 1e-4


def test_parts_behind_facets_that_are_a_micrometre_off_one_plane_have_nothing_in_the_free_space(drift):
    volume, _ = drift
    off = 1e-7 * np.random.default_rng(0).integers(0, 4, volume.vertices.shape) * [0, 0, 1.0]
    vertices = volume.vertices + off
    uneven = dataclasses.replace(volume, vertices=vertices)
    parts = build_shell(uneven)
    assert any(len(part.facets) > 1 for part in parts)
    assert shared_of(uneven, [part.corners for part in parts]).sum() < 1e-10
    assert measure_enclosure(uneven, parts).gap.width_m < 1e-3


def test_a_facet_that_one_face_covers_shares_nothing_with_others(drift):
    volume, parts = drift
    area = np.linalg.norm(volume.normals, axis=1) / 2
    found = faces_on_facets(volume, parts_of([part.corners for part in [*parts, *parts[:3]]]))
    once = faces_on_facets(volume, parts_of([part.corners for part in parts]))
    assert np.bincount(once.facet, shapely.area(once.shared), len(area)) == pytest.approx(area, rel=1e-9)
    twice = np.isin(np.arange(len(area)), [k for part in parts[:3] for k in part.facets])
    shared = np.bincount(found.facet, shapely.area(found.shared), len(area))
    assert shared == pytest.approx(np.where(twice, 2, 1) * area, rel=1e-9)
    assert found.uncovered_m2(area).sum() < 1e-9


def test_no_part_repeats_its_last_corner(tmp_path):
    parts = build_shell(built(FORK, tmp_path))
    assert any(part.shape.startswith("cut") for part in parts)
    assert all((part.corners[:-1] != part.corners[-1]).any(axis=1).all() for part in parts)


def test_figures_are_the_same_in_pieces_of_any_size(beside, monkeypatch):
    found, twice = {}, np.concatenate([beside.vertices, beside.vertices + 0.5])
    for piece in (10_000, 5, 3):
        monkeypatch.setattr("pipeline.geometry.facets.separation._TOGETHER", piece)
        for module in ("faces", "cleared"):
            monkeypatch.setattr(f"pipeline.volume.rock.{module}._AT_ONCE", piece)
        parts = build_shell(beside)
        enclosure = measure_enclosure(beside, parts)
        figures = (enclosure.gap.width_m, enclosure.gap.place_m.tolist(), enclosure.intrusion.depth_m)
        crossing = crossing_facets(twice, np.concatenate([beside.faces, beside.faces + len(twice) // 2]), 1e-6)
        found[piece] = (figures, crossing.tolist(), [part.corners.tolist() for part in parts])
    assert len(parts) >= 20  # four pieces at least
    assert len(found[5][1]) > 20
    assert found[10_000] == found[5] == found[3]


@pytest.mark.parametrize("number", [0, 3])
def test_a_direction_of_no_length_parts_a_body_from_no_facet(drift, number):
    volume, _ = drift
    floors = np.flatnonzero(volume.label == 0)[:3]
    polygons = RockSurfaces.of_facets(volume, floors.tolist()).polygons()[0]
    bodies = shaped(polygons, "moved", 0.3)
    bodies = dataclasses.replace(bodies, corners=bodies.corners + np.array([0, 0, 0.2]), owner=np.full(len(bodies), -1))
    facets = Facets(volume.vertices, volume.faces)
    wanted = facets.crossing(bodies)
    directions = bodies.directions.copy()
    directions[:, number] = 0.0
    found = facets.crossing(dataclasses.replace(bodies, directions=directions))
    assert set(wanted.body.tolist()) == set(range(len(bodies)))
    assert set(zip(wanted.body, wanted.facet, strict=True)) <= set(zip(found.body, found.facet, strict=True))


@pytest.mark.parametrize("depth_m", [0.0, 0.0005, 0.0009, 0.0012, 0.002, 0.05])
def test_whether_a_part_is_deeper_than_a_millimetre_is_known(drift, depth_m):
    volume, _ = drift
    roof = volume.vertices[:, 2].max()
    part = np.array([[x, y, z] for x in (9, 11) for y in (-1, 1) for z in (roof - depth_m, roof + 0.3)])
    corners, inside, tile = volume.vertices[volume.faces], volume.inside, Tile.of(volume.solid)
    assert is_deeper(part, 0.001, tile, inside, corners) == (depth_m > 0.001)


def test_a_part_in_the_free_space_is_deep_though_a_boolean_gives_nothing_of_it(drift):
    volume, _ = drift
    middle = volume.vertices.mean(axis=0)
    needle = middle + np.array([[0, 0, 0], [0, 3e-4, 0], [0, 0, 3e-3], [0.04, 0, 0]])
    corners, lost = volume.vertices[volume.faces], Tile.of(volume.solid.translate([1000.0, 0, 0]))
    assert is_deeper(needle, 0.001, lost, volume.inside, corners)
    assert deepest([needle], lost, volume.inside, corners).depth_m > 1.0
