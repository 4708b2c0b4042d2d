"""Parts that become one: as few as the shape allows, exactly at the surface, and nothing in the free space."""

import manifold3d
import numpy as np
import pytest
import shapely

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import GeometryError
from pipeline.volume.areas import slab_of_outline
from pipeline.volume.enclosure import measure_enclosure
from pipeline.volume.merged import LONGEST_M, merge_parts
from pipeline.volume.shell import build_shell
from pipeline.volume.world.solid import volume_of_solid

STEEPEST = 0.364
SQUARE = shapely.box(0, 0, 20, 20)
HEXAGON = shapely.Point(10, 10).buffer(3, quad_segs=2)
ROOM_WITH_PILLAR = SQUARE.difference(HEXAGON)
LETTER_L = shapely.box(0, 0, 30, 4).union(shapely.box(0, 0, 4, 30))


def merged(outline, lean=(0.0, 0.0), longest_m=LONGEST_M):
    """Return the volume of a slab, its parts, and what they have become."""
    volume = volume_of_solid(slab_of_outline(outline, 0.0, 3.0, lean), STEEPEST)
    parts = build_shell(volume)
    return volume, parts, merge_parts(volume, parts, longest_m)


def counts(volume, parts):
    """Return the numbers of floors, walls and roofs."""
    return np.bincount([volume.label[part.facets[0]] for part in parts], minlength=3).tolist()


@pytest.mark.parametrize("lean", [(0.0, 0.0), (-0.0875, 0.02)])
def test_a_pillar_is_one_prism_and_a_floor_and_a_roof_are_one_slab_each(lean):
    volume, parts, found = merged(ROOM_WITH_PILLAR, lean)
    walls = len(ROOM_WITH_PILLAR.exterior.coords) - 1 + len(HEXAGON.exterior.coords) - 1
    assert counts(volume, parts)[FacetLabel.WALL] == walls
    assert counts(volume, found) == [1, 4 + 1, 1]


def test_the_two_walls_of_a_nose_of_rock_are_one_part_and_those_of_a_hollow_are_two():
    volume, _, found = merged(LETTER_L)
    assert counts(volume, found) == [1, 5, 1]


@pytest.mark.parametrize("outline", [ROOM_WITH_PILLAR, LETTER_L])
@pytest.mark.parametrize("lean", [(0.0, 0.0), (-0.0875, 0.02)])
def test_all_of_the_surface_has_rock_behind_it_and_none_is_before_it(outline, lean):
    volume, _, found = merged(outline, lean)
    enclosure = measure_enclosure(volume, found)
    assert (enclosure.intrusion.depth_m, enclosure.gap.width_m, len(enclosure.unbacked)) == (0.0, 0.0, 0)
    assert enclosure.thinnest_m > 0.2


def test_each_facet_is_in_one_part_before_and_after():
    volume, parts, found = merged(ROOM_WITH_PILLAR)
    for some in (parts, found):
        assert sorted(facet for part in some for facet in part.facets) == [*range(len(volume.faces))]


def test_walls_across_thin_rock_are_one_prism_and_not_where_a_drift_is_between_them():
    drifts = [shapely.box(0, y, 30, y + 3) for y in (0, 5, 10)]
    ends = shapely.box(-3, 0, 0, 13)
    volume, parts, found = merged(shapely.union_all([*drifts, ends]))
    normals = volume.normals / np.linalg.norm(volume.normals, axis=1)[:, None]
    ways = [{tuple(way) for way in normals[part.facets].round(6).tolist()} for part in found]
    assert ways.count({(0, 1, 0), (0, -1, 0), (1, 0, 0)}) == 2  # the pillars, each with three walls
    assert len(found) < len(parts)
    shared = [(manifold3d.Manifold.hull_points(part.corners) ^ volume.solid).volume() for part in found]
    assert max(shared) < 1e-9


def test_no_part_is_longer_than_asked_for():
    _, _, found = merged(ROOM_WITH_PILLAR, longest_m=12.0)
    small = [part for part in found if part.shape == "merged"]
    assert small
    assert max(np.ptp(part.corners, axis=0).max() for part in small) <= 12.0


def test_a_slab_has_the_area_of_its_outline_times_its_height_and_leans_as_asked_for():
    mesh = slab_of_outline(ROOM_WITH_PILLAR, 1.0, 4.0, (0.1, -0.05))
    volume = volume_of_solid(mesh, STEEPEST)
    assert volume.solid.volume() == pytest.approx(3 * ROOM_WITH_PILLAR.area)
    floor = volume.vertices[np.unique(volume.faces[volume.label == FacetLabel.FLOOR])]
    assert np.allclose(floor[:, 2], 1 + 0.1 * floor[:, 0] - 0.05 * floor[:, 1])


@pytest.mark.parametrize(("outline", "roof"), [(shapely.Polygon(), 3.0), (SQUARE, 0.0)])
def test_a_slab_without_an_outline_or_a_height_is_refused(outline, roof):
    with pytest.raises(GeometryError, match="slab: "):
        slab_of_outline(outline, 0.0, roof)
