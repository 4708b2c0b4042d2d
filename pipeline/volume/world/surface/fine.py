"""The facets of a volume refined to the spacing of visible rock, and the way into the workings at each point."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from scipy.sparse import coo_array, diags_array

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.volume.slivers import without_slivers
from pipeline.volume.world.content import closed_volume

FLOOR = 2  # beside WALL and ROOF: floors stay where they are and are not written
_ROOF_NZ = 0.7  # of a normal out of the free space, as the labels of facets have it
_MERGED_M = 1e-4  # of an edge, and of a facet's height: the 32 bits of meshes turn lower facets over
_SMOOTHED_M = 0.5  # over which the way into the workings turns at an edge


@dataclass(frozen=True)
class FineRock:
    """The closed mesh of a volume in fine triangles that face the workings, m, mine frame.

    `piece` (m,) is `WALL`, `ROOF` or `FLOOR`. `direction` (n, 3) are unit vectors into the workings; a point that only
    floors touch has none (0, 0, 0).
    """

    vertices: np.ndarray
    faces: np.ndarray
    piece: np.ndarray
    direction: np.ndarray

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


def refine(volume: VolumeFacets, spacing_m: float) -> FineRock:
    """Cut the facets of a volume until no edge is longer than a spacing.

    Facets thinner than 0.1 mm are merged before, but not across the floors' corners: rock may have no thickness there.
    What is no floor is wall or roof by its slope.
    """
    on_floor = np.zeros(len(volume.vertices), bool)
    on_floor[volume.faces[volume.label == FacetLabel.FLOOR]] = True
    merged = without_slivers(closed_volume(volume), _MERGED_M, on_floor)
    solid = _solid(merged.vertices, merged.faces, merged.label == FacetLabel.FLOOR)
    vertices, faces, of_floor = _arrays(solid.refine_to_length(spacing_m))
    faces = faces[:, ::-1].astype(np.int32)
    down = -_unit(_normals(vertices, faces))[:, 2]
    piece = np.where(of_floor, FLOOR, np.where(down > _ROOF_NZ, ROOF, WALL)).astype(np.uint8)
    return FineRock(vertices, faces, piece, _directions(vertices, faces[~of_floor], spacing_m))


def _solid(vertices: np.ndarray, faces: np.ndarray, of_floor: np.ndarray) -> manifold3d.Manifold:
    """Return a solid whose floors (m,) have the first of two numbers."""
    order = np.argsort(~of_floor, kind="stable")
    number = manifold3d.Manifold.reserve_ids(2)
    mesh = manifold3d.Mesh64(
        vertices,
        faces[order].astype(np.uint64),
        run_index=3 * np.array([0, of_floor.sum(), len(order)]),
        run_original_id=np.array([number, number + 1], np.uint32),
    )
    return manifold3d.Manifold(mesh)


def _arrays(solid: manifold3d.Manifold) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vertices, faces and floors of such a solid."""
    mesh = solid.to_mesh64()
    runs: np.ndarray = np.diff(np.asarray(mesh.run_index).astype(np.int64)) // 3
    number = np.asarray(mesh.run_original_id, np.int64)
    of_floor = np.repeat(number == number.min(), runs)
    return np.array(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64), of_floor


def _directions(vertices: np.ndarray, faces: np.ndarray, spacing_m: float) -> np.ndarray:
    """Return the mean normals (n, 3) of faces about points, smoothed along the mesh over `_SMOOTHED_M`."""
    normal, flat = _normals(vertices, faces), faces.ravel()
    at = [np.bincount(flat, np.repeat(normal[:, k], 3), len(vertices)) for k in range(3)]
    del normal
    mean = _unit(np.column_stack(at))
    beside = np.roll(faces, 1, axis=1).ravel()
    ends = np.concatenate([flat, beside]), np.concatenate([beside, flat])
    count = np.ones(2 * len(flat), np.float32)  # of small numbers the sums are exact
    links = coo_array((count, ends), shape=(len(vertices), len(vertices))).tocsr()
    del count, ends, flat, beside
    links = links + diags_array(np.maximum(links.sum(axis=1), 1.0))
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
