"""The facets of a volume refined to the spacing of visible rock, and the way into the workings at each point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.geometry.facets.cut import cut_facets
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.volume.passages.arch import cut_as_seen
from pipeline.volume.slivers import without_slivers
from pipeline.volume.world.content import closed_volume

FLOOR = 2  # beside WALL and ROOF: floors stay where they are and are not written
_ROOF_NZ = 0.7  # of a normal out of the free space, as the labels of facets have it
_MERGED_M = 1e-4  # of an edge, and of a facet's height: the 32 bits of meshes turn lower facets over
_FLOOR_M = 1.0  # between the points of floors, which do not move
_SMOOTHED_M = 0.5  # over which the way into the workings turns at an edge


@dataclass(frozen=True)
class FineRock:
    """The closed mesh of a volume in fine triangles that face the workings, m, mine frame.

    `piece` (m,) is `WALL`, `ROOF` or `FLOOR`. `direction` (n, 3) are unit vectors into the workings; a point that only
    floors touch has none (0, 0, 0). A step of a walk on walls and roofs has the weights `links` (n, n): half of a
    point's own are its own, the others those of the points beside it.
    """

    vertices: np.ndarray
    faces: np.ndarray
    piece: np.ndarray
    direction: np.ndarray
    links: csr_array

    @property
    def is_fixed(self) -> np.ndarray:
        """Return which points (n,) a floor touches."""
        fixed = np.zeros(len(self.vertices), bool)
        fixed[self.faces[self.piece == FLOOR]] = True
        return fixed

    @property
    def roof_share(self) -> np.ndarray:
        """Return which points (n,) are of a roof alone, as 1 and 0."""
        share = np.zeros(len(self.vertices))
        share[self.faces[self.piece == ROOF]] = 1.0
        share[self.faces[self.piece != ROOF]] = 0.0
        return share


def refine(volume: VolumeFacets, spacing_m: float, roof_spacing_m: float, seen: VolumeFacets | None = None) -> FineRock:
    """Cut the walls and roofs of a volume finely at their spacings, and its floors where they meet these.

    Facets thinner than 0.1 mm are merged before, but not across the floors' corners: rock may have no thickness there.
    What is no floor is wall or roof by its slope. Roofs are as they are `seen`, if they have an arch.
    """
    on_floor = np.zeros(len(volume.vertices), bool)
    on_floor[volume.faces[volume.label == FacetLabel.FLOOR]] = True
    merged = without_slivers(closed_volume(volume), _MERGED_M, on_floor)
    down = _unit(merged.normals)[:, 2]
    piece = np.where(merged.label == FacetLabel.FLOOR, FLOOR, np.where(down > _ROOF_NZ, ROOF, WALL)).astype(np.uint8)
    apart_m = np.choose(piece, [spacing_m, roof_spacing_m, _FLOOR_M])
    mesh = merged.vertices, merged.faces
    if seen is None:
        vertices, faces, facet = cut_facets(*mesh, apart_m)
    else:
        vertices, faces, facet = cut_as_seen(mesh, piece == ROOF, apart_m, volume, seen)
    faces, piece = faces[:, ::-1].astype(np.int32), piece[facet]
    links = _links(len(vertices), faces[piece != FLOOR])
    return FineRock(vertices, faces, piece, _directions(vertices, faces[piece != FLOOR], links, spacing_m), links)


def _links(count: int, faces: np.ndarray) -> csr_array:
    """Return the weights (count, count) of a walk along the edges of faces."""
    one, other = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    ends = np.concatenate([one, other]), np.concatenate([other, one])
    found = coo_array((np.ones(len(ends[0]), np.float32), ends), shape=(count, count)).tocsr()  # sums are exact
    return found + diags_array(np.maximum(found.sum(axis=1), 1.0))


def _directions(vertices: np.ndarray, faces: np.ndarray, links: csr_array, spacing_m: float) -> np.ndarray:
    """Return the mean normals (n, 3) of faces about points, smoothed along the mesh over `_SMOOTHED_M`."""
    normal, flat = _normals(vertices, faces), faces.ravel()
    mean = _unit(np.column_stack([np.bincount(flat, np.repeat(normal[:, k], 3), len(vertices)) for k in range(3)]))
    for _ in range(max(1, round((_SMOOTHED_M / spacing_m) ** 2 / 4))):  # a walk of n steps reaches sqrt(n) of them
        mean = _unit(links @ mean)
    return mean


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return twice the area times the normal (m, 3) of faces."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _unit(vectors: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    found: np.ndarray = np.where(size > 1e-12, vectors / np.maximum(size, 1e-12), 0.0)
    return found
