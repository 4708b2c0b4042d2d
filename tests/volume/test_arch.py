"""Roofs of drawn areas arch between the walls under them; what is not drawn has none, and the certificate knows."""

import numpy as np
import pytest
import shapely
import trimesh

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.errors import ArtifactError
from pipeline.surface.mesh.mesh_checks import find_crossings
from pipeline.types import ClosedMesh, DrawnFloors, FloorMesh
from pipeline.volume.areas import slab_of_outline
from pipeline.volume.passages.arch import Arch, arched
from pipeline.volume.world.content import closed_volume
from pipeline.volume.world.proof.certificate import open_volume, seen_volume
from pipeline.volume.world.proof.derived_content import require_remade
from pipeline.volume.world.solid import labels_of
from pipeline.volume.world.surface.proof import measure_rock
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
    require_remade(folder / "rocky", world, proof(), None, shape)
    mine = ClosedMesh(world.mine.vertices, world.mine.faces, world.record.volume.datum_m)
    with pytest.raises(ArtifactError, match=r"is_drawn = True, want False"):
        require_remade(folder / "rocky", world, proof(), None, mine)
