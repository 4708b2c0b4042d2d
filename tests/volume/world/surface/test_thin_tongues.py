"""The visible rock about tongues of rock that are thinner than a millimetre at their ends."""

import dataclasses

import manifold3d
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.surface.mesh.displacement import Room
from pipeline.surface.mesh.mesh_checks import find_crossings, find_shared_edges, join_meshes
from pipeline.surface.mesh.simplify import Simplification
from pipeline.surface.relief_source import bounds_of
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.surface.build import displaced_rock
from pipeline.volume.world.surface.chunks import cut_rock
from pipeline.volume.world.surface.crossed import _on_facets, places_crossed
from pipeline.volume.world.surface.displace import displace_rock
from pipeline.volume.world.surface.fine import FLOOR, refine
from pipeline.volume.world.surface.narrow import Balls, Narrowest
from pipeline.volume.world.surface.proof import _borders_m
from pipeline.volume.world.surface.scanned import ScanColours
from tests.composed import compose

SURFACE = compose(["+mine=heights"]).surface
EAST = 500.0  # m: 32 bits have 0.03 mm there


def room(outline):
    """Return the room of 3 m height over an outline, as a volume."""
    mesh = manifold3d.CrossSection([outline]).extrude(3.0).to_mesh64()
    vertices, faces = np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int32)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    up = normal[:, 2] / np.linalg.norm(normal, axis=1)
    label = np.select([up < -0.9, up > 0.9], [FacetLabel.FLOOR, FacetLabel.ROOF], FacetLabel.WALL).astype(np.int32)
    return VolumeFacets(vertices, faces, label, np.zeros(len(faces), np.int32))


def straight_tongue(end_m):
    """Return a room of 8 m with a tongue of rock, 0.2 m thick at the wall."""
    tongue = [(EAST + 8, 303.4), (EAST + 3, 303.5 - end_m / 2), (EAST + 3, 303.5 + end_m / 2), (EAST + 8, 303.6)]
    return room([(EAST, 300), (EAST + 8, 300), *tongue, (EAST + 8, 307), (EAST, 307)])


def curved_tongue(end_m):
    """Return a room with a curved tongue of rock whose two sides have their corners at different places."""
    sides = []
    for count, side in ((30, 1), (37, -1)):
        angle, half_m = np.linspace(np.pi, 1.5 * np.pi, count), np.linspace(0.1, end_m, count) / 2
        ring_m = 3.0 + side * half_m
        sides.append(np.column_stack([EAST + 6 + ring_m * np.cos(angle), 308 + ring_m * np.sin(angle)]))
    tongue = np.concatenate([sides[0], sides[1][::-1]]).tolist()
    return room([(EAST, 308), *tongue, (EAST + 12, 308), (EAST + 12, 301), (EAST, 301)][::-1])


def test_fine_rock_keeps_every_corner_of_the_floor_where_rock_is_thinner_than_a_millimetre():
    volume = straight_tongue(6e-4)
    fine = refine(volume, 0.14, 0.14)
    corners = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR])]
    away_m, _ = cKDTree(fine.vertices[np.unique(fine.faces[fine.piece == FLOOR])]).query(corners)
    assert away_m.max() < 1e-6


@pytest.mark.parametrize("thickness_m", [1e-5, 1e-8])
def test_a_wall_that_has_no_thickness_in_32_bits_stands_on_the_floor_on_both_its_sides(thickness_m):
    ends = [(EAST + x, 303 + side * thickness_m / 2) for side, x in ((-1, 8), (-1, 3), (1, 3), (1, 8))]
    volume = room([(EAST, 300), (EAST + 8, 300), *ends, (EAST + 8, 307), (EAST, 307)])
    fine = refine(volume, 0.5, 0.5)
    corners, number = np.unique(fine.vertices.astype(np.float32), axis=0, return_inverse=True)  # as files have them
    faces = number.reshape(-1)[fine.faces]
    rock = faces[(fine.piece != FLOOR) & (faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    floors = volume.faces[volume.label == FacetLabel.FLOOR]
    assert _borders_m(corners.astype(float), rock, volume.vertices, floors) == (0.0, 0.0)
    wall = np.abs(corners[rock][:, :, 1] - 303).max(axis=1) < 1e-3
    assert _borders_m(corners.astype(float), rock[~wall], volume.vertices, floors)[1] == pytest.approx(10.0, abs=0.5)


def test_rock_has_at_most_the_stated_faces_where_facets_are_narrower_than_the_spacing():
    rough = SURFACE.rough.model_copy(update={"spacing_m": 0.2, "most_faces": 12_000})
    fine = displaced_rock(SURFACE.model_copy(update={"rough": rough}), curved_tongue(1e-2)).fine
    assert 8_000 < (fine.piece != FLOOR).sum() <= 12_000


def test_places_on_narrow_facets_are_on_the_volume_s_facets_which_32_bits_deny():
    whole = room([(EAST, 300), (EAST + 20, 300), (EAST + 20, 303), (EAST, 303)])
    is_foot = (whole.vertices[whole.faces][:, :, 1:] == [300, 0]).all(axis=2)
    wall = int(np.flatnonzero((is_foot.sum(axis=1) == 2) & (whole.label == FacetLabel.WALL))[0])
    a, b, c = np.roll(whole.faces[wall], -int(np.argmin(is_foot[wall])) - 1)
    new = len(whole.vertices)  # 8 mm over the foot of the wall of 20 m
    more = np.array([[a, b, new], [b, c, new], [c, a, new]], np.int32)
    volume = VolumeFacets(
        np.vstack([whole.vertices, [EAST + 10, 300, 0.008]]),
        np.concatenate([np.delete(whole.faces, wall, axis=0), more]),
        np.concatenate([np.delete(whole.label, wall), np.full(3, FacetLabel.WALL, np.int32)]),
        np.zeros(len(whole.faces) + 2, np.int32),
    )
    closed = closed_volume(volume)
    places = np.random.default_rng(0).dirichlet([1, 1, 1], 200) @ volume.vertices[[a, b, new]]
    assert np.abs(closed.inside.distance_m(places)).max() < 1e-9  # Open3D's own: over 0.2 mm
    mesh = closed.vertices, closed.faces
    assert _on_facets(places, mesh, 1e-4).all()
    assert not _on_facets(places - np.array([0.0, 2e-4, 0.0]), mesh, 1e-4).any()


@pytest.mark.slow
@pytest.mark.parametrize("volume", [straight_tongue(2e-4), curved_tongue(1e-3)], ids=["straight", "curved"])
def test_rock_about_a_thin_tongue_crosses_itself_nowhere_in_its_files_and_meets_the_floor(volume):
    rock = displaced_rock(SURFACE, volume)
    assert len(rock.crossings) == 0
    assert trimesh.Trimesh(rock.mesh.vertices, rock.mesh.faces, process=False).is_watertight
    assert np.std(rock.given_m) > 0.05  # it is rough elsewhere
    no_colours = ScanColours(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    chunks, _ = cut_rock(rock, SURFACE, np.full((8, 8, 3), 255, np.uint8), no_colours)
    written = {name: dataclasses.replace(one, vertices=one.vertices.astype(np.float32)) for name, one in chunks.items()}
    vertices, faces = join_meshes(written)
    assert len(find_crossings(vertices, faces)) == 0
    assert len(find_shared_edges(vertices, faces)) == 0
    assert _borders_m(vertices, faces, volume.vertices, volume.faces[volume.label == FacetLabel.FLOOR]) == (0.0, 0.0)


@pytest.mark.parametrize("simplification", [None, Simplification(0.3, 5.0)], ids=["whole", "simplified"])
def test_relief_that_fits_nowhere_is_taken_back_until_the_rock_crosses_itself_nowhere(simplification):
    wall = [(EAST, 303.51), (EAST + 8, 303.51), (EAST + 8, 303.49), (EAST, 303.49)]  # 2 cm thick, free at one end
    volume = room([(EAST, 300), (EAST + 12, 300), (EAST + 12, 307), (EAST, 307), *wall])
    fine = refine(volume, 0.2, 0.2)
    far_m = np.full(len(fine.vertices), 100.0)
    no_bound = Room(far_m, far_m, far_m, np.zeros(len(far_m)), 100.0)
    bounds = dataclasses.replace(bounds_of(SURFACE.rough), wall_m=1.5, median_m=1.5)
    wanted_m = np.random.default_rng(0).normal(0.0, 1.5, len(far_m))
    rock = displace_rock(fine, wanted_m, no_bound, bounds, 0.3, simplification, closed_volume(volume).inside)
    assert len(rock.crossings) == len(find_crossings(rock.mesh.vertices, rock.mesh.faces)) == 0
    assert trimesh.Trimesh(rock.mesh.vertices, rock.mesh.faces, process=False).is_watertight
    assert np.std(rock.given_m) > 0.1  # it is rough elsewhere


def test_rock_leaves_the_middle_of_the_narrowest_passage_as_free_as_the_certificate_asks():
    volume = room([(EAST, 300), (EAST + 12, 300), (EAST + 12, 304), (EAST, 304)])
    fine, closed = refine(volume, 0.2, 0.2), closed_volume(volume)
    far_m = np.full(len(fine.vertices), 100.0)
    no_bound = Room(far_m, far_m, far_m, np.zeros(len(far_m)), 100.0)
    middle = np.array([EAST + 6, 302, volume.vertices[:, 2].mean()])
    narrowest = Narrowest.of(Balls(middle[None], np.ones(1)), volume)
    wanted_m = np.random.default_rng(0).normal(0.0, 0.4, len(far_m))
    kept = []
    for limit in (None, narrowest):
        args = (fine, wanted_m, no_bound, bounds_of(SURFACE.rough), 0.3, Simplification(0.3, 5.0), closed.inside)
        mesh = displace_rock(*args, narrowest=limit).mesh
        kept.append(narrowest.kept(mesh.vertices, mesh.faces[mesh.piece != FLOOR])[0])
    assert kept[0] < 0.95 < kept[1]


def test_rock_of_a_volume_that_crosses_itself_is_the_volume_there_and_its_crossings_are_returned():
    one = room([(EAST, 300), (EAST + 6, 300), (EAST + 6, 306), (EAST, 306)])
    count = len(one.vertices)
    volume = dataclasses.replace(
        one,
        vertices=np.concatenate([one.vertices, one.vertices + np.array([5.0, 4.0, 1.0])]),
        faces=np.concatenate([one.faces, one.faces + np.int32(count)]),
        label=np.tile(one.label, 2),
        leg=np.tile(one.leg, 2),
    )
    fine = refine(volume, 0.3, 0.3)
    far_m = np.full(len(fine.vertices), 100.0)
    room_m = Room(far_m, far_m, far_m, np.zeros(len(far_m)), 100.0)
    wanted_m = np.random.default_rng(0).normal(0.0, 0.2, len(far_m))
    closed = closed_volume(volume)
    rock = displace_rock(fine, wanted_m, room_m, bounds_of(SURFACE.rough), 0.3, None, closed.inside)
    assert len(rock.crossings) > 0
    near = cKDTree(rock.crossings).query(fine.vertices)[0] < 1.0
    assert near.any()
    assert not rock.given_m[near].any()
    assert np.std(rock.given_m) > 0.03
    # The proof tells these crossings from those of rock with relief.
    count = len(rock.crossings)
    mesh = closed.vertices, closed.faces
    _, own = places_crossed(rock.mesh.vertices, rock.mesh.faces, mesh)
    assert (own.all(), len(own)) == (True, count)
    moved = rock.mesh.vertices + 0.001
    assert (~places_crossed(moved, rock.mesh.faces, mesh)[1]).sum() >= count / 2
