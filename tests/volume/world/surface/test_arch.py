"""Roofs of drawn areas arch between the walls under them; what is not drawn has none, and the certificate knows."""

import numpy as np
import pytest
import shapely
import trimesh

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.errors import ArtifactError
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.surface.mesh.mesh_checks import find_crossings
from pipeline.types import ClosedMesh, DrawnFloors, FloorMesh
from pipeline.volume.areas import slab_of_outline
from pipeline.volume.passages.arch import Arch, arched
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import open_volume, seen_volume
from pipeline.volume.world.proof.derived_content import require_remade
from pipeline.volume.world.solid import labels_of
from pipeline.volume.world.surface.fine import refine
from pipeline.volume.world.surface.proof import measure_rock
from pipeline.volume.world.surface.room import room_about
from tests.survey.levels.test_drawn_levels import closed, write
from tests.volume_worlds import WITH_ROCK, proof, survey_of_areas, with_rock

ARCH = Arch(0.9, 2.75)
ROOM = [(0, 0), (24, 0), (24, 5), (0, 5)]
PILLAR = shapely.box(0, 0, 24, 12).difference(shapely.box(9, 5, 13, 8))  # rooms 5 and 4 m wide about a pillar


def slab(outline, height_m=3.5, lean=(0.0, 0.0)):
    mesh = slab_of_outline(outline, 0.0, height_m, lean)
    label = labels_of(mesh.vertices, mesh.faces, 0.364)
    return VolumeFacets(mesh.vertices, mesh.faces, label, np.zeros(len(mesh.faces)))


def tops(volume):
    """Return the points (n, 3) m of roofs."""
    return volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.ROOF])]


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.1, -0.05)])
def test_the_roof_drops_by_the_rise_at_the_walls_and_not_at_all_beyond_half_the_span(lean):
    found = arched(slab(PILLAR, lean=lean), ARCH)
    x, y, z = tops(found).T
    from_wall = shapely.distance(PILLAR.boundary, shapely.points(x, y))
    t = np.minimum(from_wall / ARCH.half_span_m, 1)
    assert z - 3.5 - lean[0] * x - lean[1] * y == pytest.approx(-0.9 * (1 - t) ** 2, abs=0.004)
    assert (from_wall < 1e-9).sum() > 100
    assert from_wall.max() > ARCH.half_span_m


def test_the_mesh_stays_closed_keeps_its_floor_and_crosses_nowhere():
    before, found = slab(PILLAR), arched(slab(PILLAR), ARCH)
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(find_crossings(found.vertices, found.faces)) == 0
    assert 0.75 * before_m3(before) < mesh.volume < before_m3(before)
    assert np.abs(np.linalg.norm(found.normals, axis=1)[found.label == FacetLabel.FLOOR].sum() / 2 - PILLAR.area) < 1e-9


def before_m3(volume):
    return trimesh.Trimesh(volume.vertices, volume.faces, process=False).volume


def seen_finely(volume):
    return refine(volume, 0.12, 0.14, arched(volume, ARCH))


def test_visible_walls_have_the_rows_of_their_height_under_the_arch_and_no_needles():
    fine = seen_finely(slab(PILLAR))
    walls = fine.vertices[fine.faces[fine.piece == WALL]]
    wall_m2 = PILLAR.length * (3.5 - ARCH.rise_m)
    double = np.linalg.norm(np.cross(walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0]), axis=1)
    longest = np.linalg.norm(walls - np.roll(walls, 1, axis=1), axis=2).max(axis=1)
    assert double.sum() / 2 == pytest.approx(wall_m2, rel=1e-6)
    assert len(walls) == pytest.approx(2 * wall_m2 / 0.12**2, rel=0.05)
    assert (double / longest < 0.04).mean() < 0.01  # m: without needles


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.1, -0.05)])
def test_visible_roofs_lie_on_the_roofs_that_the_certificate_measures_from(lean):
    volume = slab(PILLAR, lean=lean)
    fine, seen = seen_finely(volume), arched(volume, ARCH)
    roof = fine.vertices[np.unique(fine.faces[fine.piece == ROOF])]
    off = NearestFacets(seen.vertices, seen.faces).query(roof).distance_m
    assert off.max() < 1e-5
    assert len(roof) > 10_000


def test_a_roof_has_the_whole_height_over_the_floor_for_its_relief_and_walls_share_the_width():
    volume = slab(shapely.box(0, 0, 24, 5))
    fine = seen_finely(volume)
    half = room_about(fine, arched(volume, ARCH)).half_m
    x, y, z = fine.vertices.T
    middle = np.abs(x - 12) < 3
    assert half[middle & (np.abs(y - 2.5) < 0.2) & (z > 3)].min() > 3.1  # and not half of it: the floor stays
    assert half[middle & (y == 0) & (np.abs(z - 1) < 0.3)] == pytest.approx(2.5, abs=0.1)


def test_corners_of_walls_between_floor_and_roof_go_down_by_their_share():
    one = trimesh.Trimesh(*vertices_of(slab(shapely.box(0, 0, 6, 6))), process=False)
    hole = trimesh.creation.box(bounds=[[5, 2, 1], [9, 4, 3.4]])  # a passage whose roof is a hand below the room's
    both = trimesh.boolean.union([one, hole], engine="manifold")
    label = labels_of(both.vertices, both.faces, 0.364)
    found = arched(VolumeFacets(both.vertices, both.faces, label, np.zeros(len(both.faces))), ARCH)
    assert trimesh.Trimesh(found.vertices, found.faces, process=False).is_watertight
    assert len(find_crossings(found.vertices, found.faces)) == 0


def vertices_of(volume):
    return volume.vertices, volume.faces


def test_a_low_room_keeps_two_thirds_of_its_height():
    z = tops(arched(slab(PILLAR, 1.5), ARCH))[:, 2]
    assert (z.min(), z.max()) == (pytest.approx(1.0), pytest.approx(1.5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A room of 24 x 5 m that rises, with visible rock."""
    path = write(tmp_path_factory.mktemp("drawn") / "a.dxf", {"a": [closed([(x, y, 0.05 * x) for x, y in ROOM])]})
    return with_rock(survey_of_areas(path), path.parent)


def broken_by(world, volume):
    """Return the limits on the rock that do not hold where it is measured from a volume."""
    limits = WITH_ROCK.validation.volume.applying(["rock"])
    found = measure_rock(closed_volume(volume), world.legs, world.rock, np.random.default_rng(3))
    return {name for name, limit in limits.items() if not limit.holds(found[name.removeprefix("rock.")])}


def test_the_rock_of_a_drawn_room_holds_its_limits_under_the_arch_and_not_under_the_plane(folder):
    world = open_volume(folder / "rocky")
    assert world.record.volume.is_drawn
    assert broken_by(world, seen_volume(WITH_ROCK.validation.volume, world)) == set()
    assert {"rock.gap_max_m", "rock.into_free_m"} <= broken_by(world, world.mine)
    roof = np.concatenate([mesh.vertices for name, mesh in world.rock.items() if name.startswith("roof")])
    over = roof[:, 2] - 0.05 * roof[:, 0]
    assert np.median(over[np.abs(roof[:, 1] - 2.5) < 0.3]) - np.median(over[roof[:, 1] < 0.3]) > 0.5


def test_a_record_that_calls_other_areas_drawn_is_refused(folder):
    world = open_volume(folder / "rocky")
    shape = DrawnFloors(FloorMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), world.record.volume.datum_m))
    require_remade(folder / "rocky", world, proof(), None, shape, WITH_ROCK.realism.floor)
    mine = ClosedMesh(world.mine.vertices, world.mine.faces, world.record.volume.datum_m)
    with pytest.raises(ArtifactError, match=r"is_drawn = True, want False"):
        require_remade(folder / "rocky", world, proof(), None, mine, WITH_ROCK.realism.floor)
