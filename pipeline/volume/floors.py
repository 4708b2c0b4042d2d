"""Floors to drive on: a slab over the solved floors of all legs that are flat enough, united with the passages."""

from __future__ import annotations

import manifold3d
import numpy as np

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.coarse import coarse_floors
from pipeline.volume.height_field.heights import solve_heights
from pipeline.volume.height_field.leg_lines import along_legs, way_samples
from pipeline.volume.height_field.slabs import PassageFloors, slabs_of
from pipeline.volume.labelled_solid import simplified, with_short_edges
from pipeline.volume.network import NEAR_M, SurveyNetwork
from pipeline.volume.passages.views import with_views
from pipeline.volume.rock.polygons import LONGEST_M
from pipeline.volume.slivers import without_slivers
from pipeline.volume.thin_rock import without_thin_rock
from pipeline.volume.union import Solid, Volume, mesh_of, pieces_of, solids_of, without_crumbs

_SIMPLE_M = 0.004  # of the mesh: floors keep within 1 cm of the survey
_SAMPLE_M = 0.03  # along the ways on which no rock is put
_ROOF_NZ = 0.7  # of a facet's normal, which points out of the free space
_STEEP_NZ = 0.7  # of a floor's, at least: where it is steeper, 4 mm along the normal are more in height


def solve_floors(network: SurveyNetwork) -> Volume:
    """Return the volume of a survey's legs with one continuous floor through all legs that meet.

    The floors of legs that are flat enough are solved first: a mesh seen from above, on which legs that meet share
    their floor and the heights along the legs are the survey's. A slab over it is the only floor. The passages are cut
    off within the slab, so that no two floors are near each other when all is united.
    """
    united = _united(network, pieces_of(network))
    steep = (united.label == FacetLabel.FLOOR) & (_upward(united) > -_STEEP_NZ)
    simple = simplified(united, steep, _SIMPLE_M)
    simple.label[(_upward(simple) > _ROOF_NZ) & (simple.label == FacetLabel.WALL)] = FacetLabel.ROOF
    along = along_legs(simple, network, network.near_legs(NEAR_M), simple.label == FacetLabel.FLOOR)
    coarse = coarse_floors(simple, along.facet, along.weights, along.height_m)
    thick = without_thin_rock(without_slivers(coarse), way_samples(network, _SAMPLE_M)[0])
    return with_short_edges(thick, LONGEST_M)


def _upward(volume: Volume) -> np.ndarray:
    """Return the upward part (f,) of the facets' normals, which point out of the free space."""
    found: np.ndarray = volume.normals[:, 2] / np.maximum(np.linalg.norm(volume.normals, axis=1), 1e-30)
    return found


def _united(network: SurveyNetwork, pieces: list[Solid]) -> Volume:
    """Return the union of slabs and passages; its facets are floors or walls."""
    field = solve_heights(network, pieces)
    numbers, keys, cut = dict[int, int](), dict[int, int](), []
    passages = PassageFloors(network, field, pieces, keys)
    for solid in solids_of(network, pieces, numbers):
        found = {numbers[int(number)] for number in solid.to_mesh64().run_original_id}
        cut.append(passages.cut(solid, sorted(found)))
    keys |= {number: len(FacetLabel) * piece + FacetLabel.WALL for number, piece in numbers.items()}
    # Slabs first: once a passage has cut one of two walls that are the same, rounding leaves a membrane between them.
    slabs = manifold3d.Manifold.batch_boolean(slabs_of(field, pieces, keys), manifold3d.OpType.Add)
    union = without_crumbs(manifold3d.Manifold.batch_boolean([slabs, *cut], manifold3d.OpType.Add))
    seen = dict[int, int]()
    union = with_views(union, network, [(one.sections, one.is_drivable) for one in pieces], seen)
    keys |= {number: len(FacetLabel) * piece + FacetLabel.WALL for number, piece in seen.items()}
    vertices, faces, key = mesh_of(union, keys)
    return Volume(vertices, faces, key // len(FacetLabel), key % len(FacetLabel), pieces)
