"""The facets of a volume refined to the spacing of visible rock, and the way into the workings at each point."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from scipy.sparse import coo_array, diags_array

from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.volume.union import Label
from pipeline.volume.world.content import MineVolume

FLOOR = 2  # beside WALL and ROOF: floors stay where they are and are not written
_PIECES = {Label.FLOOR: FLOOR, Label.WALL: WALL, Label.ROOF: ROOF}
_SMOOTHED_M = 0.5  # over which the way into the workings turns at an edge


@dataclass(frozen=True)
class FineRock:
    """The closed mesh of a volume in fine triangles that face the workings, m, mine frame.

    `piece` (m,) is `WALL`, `ROOF` or `FLOOR`, `leg` (m,) the number of the survey's leg. `direction` (n, 3) are unit
    vectors into the workings; a point that only floors touch has none (0, 0, 0).
    """

    vertices: np.ndarray
    faces: np.ndarray
    piece: np.ndarray
    leg: np.ndarray
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


def refine(volume: MineVolume, spacing_m: float) -> FineRock:
    """Cut the facets of a volume until no edge is longer than a spacing."""
    key = len(Label) * volume.leg.astype(np.int64) + volume.label
    order = np.argsort(key, kind="stable")
    found, starts = np.unique(key[order], return_index=True)
    first = manifold3d.Manifold.reserve_ids(len(found))
    mesh = manifold3d.Mesh64(
        volume.vertices,
        volume.faces[order].astype(np.uint64),
        run_index=3 * np.append(starts, len(order)),
        run_original_id=first + np.arange(len(found)),
    )
    fine = manifold3d.Manifold(mesh).refine_to_length(spacing_m).to_mesh64()
    runs = np.diff(np.asarray(fine.run_index).astype(np.int64)) // 3
    number = np.repeat(found[np.asarray(fine.run_original_id, np.int64) - first], runs)
    vertices = np.array(fine.vert_properties)[:, :3]
    faces = np.asarray(fine.tri_verts, np.int64)[:, ::-1].astype(np.int32)
    piece = np.array([_PIECES[label] for label in Label], np.uint8)[number % len(Label)]
    direction = _directions(vertices, faces[piece != FLOOR], spacing_m)
    return FineRock(vertices, faces, piece, (number // len(Label)).astype(np.int32), direction)


def _directions(vertices: np.ndarray, faces: np.ndarray, spacing_m: float) -> np.ndarray:
    """Return the mean normals (n, 3) of faces about points, smoothed along the mesh over `_SMOOTHED_M`."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = faces.ravel()
    at = [np.bincount(flat, np.repeat(normal[:, k], 3), len(vertices)) for k in range(3)]
    mean = _unit(np.column_stack(at))
    beside = np.roll(faces, 1, axis=1).ravel()
    ends = np.concatenate([flat, beside]), np.concatenate([beside, flat])
    links = coo_array((np.ones(2 * len(flat)), ends), shape=(len(vertices), len(vertices))).tocsr()
    links = links + diags_array(np.maximum(links.sum(axis=1), 1.0))
    for _ in range(max(1, round((_SMOOTHED_M / spacing_m) ** 2 / 4))):  # a walk of n steps reaches sqrt(n) of them
        mean = _unit(links @ mean)
    return mean


def _unit(vectors: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    found: np.ndarray = np.where(size > 1e-12, vectors / np.maximum(size, 1e-12), 0.0)
    return found
