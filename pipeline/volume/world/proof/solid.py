"""How a volume follows the solid that was read: by booleans, by points on the solid, and by what of it is missing."""

from __future__ import annotations

from typing import Any

import manifold3d
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.types import ClosedMesh
from pipeline.volume.enclosure import describe_place
from pipeline.volume.union import Volume

_MM = 1e3
_SAMPLES = 100_000  # points on the surface of a solid
_THICK_M = 0.2  # of a lump, on average: rock that is made thicker is 9 cm at most


def measure_solid(volume: Volume, solid: ClosedMesh, rng: np.random.Generator) -> dict[str, Any]:
    """Return the figures `solid`: IoU, distances between both surfaces, and the largest lump that differs.

    A lump is a connected space that is free in one of both, and thicker than 20 cm on average: a pillar that is
    missing, however large the mine is.
    """
    wanted = manifold3d.Manifold(
        manifold3d.Mesh64(np.array(solid.vertices, order="C"), solid.faces.astype(np.uint64, order="C"))
    )
    both, either = (wanted ^ volume.solid).volume(), (wanted + volume.solid).volume()
    a, b, c = np.moveaxis(solid.vertices[solid.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    facet = rng.choice(len(area), _SAMPLES, p=area / area.sum())
    share = rng.dirichlet(np.ones(3), _SAMPLES)
    points = np.einsum("ki,kij->kj", share, solid.vertices[solid.faces[facet]])
    off = np.abs(volume.inside.distance_m(points))
    beyond_m, beyond_at = _farthest(volume, solid, rng)
    lumps = [_largest_lump(wanted - volume.solid, "rock"), _largest_lump(volume.solid - wanted, "free")]
    lump_m3, at = max(lumps, key=lambda lump: lump[0])
    return {
        "iou": round(both / either, 6),
        "median_mm": round(_MM * float(np.median(off)), 3),
        "largest_mm": round(_MM * float(off.max()), 3),
        "within_5cm": round(float((off <= 0.05).mean()), 6),
        "within_10cm": round(float((off <= 0.1).mean()), 6),
        "lump_m3": round(lump_m3, 6),
        **({"lump_at": at} if lump_m3 else {}),
        "surface_mm": round(_MM * beyond_m, 3),
        "surface_at": describe_place(beyond_at),
        "area_m2": round(float(area.sum()) / 2, 3),
    }


def _farthest(volume: Volume, solid: ClosedMesh, rng: np.random.Generator) -> tuple[float, np.ndarray]:
    """Return how far, m, the surface of a volume is from that of a solid at most, and where (3,) m.

    It is measured at all corners, in the middles of all facets, and at places that are drawn by area.
    """
    corners, area = volume.vertices[volume.faces], np.linalg.norm(volume.normals, axis=1)
    facet = rng.choice(len(area), _SAMPLES, p=area / area.sum())
    drawn = np.einsum("ki,kij->kj", rng.dirichlet(np.ones(3), _SAMPLES), corners[facet])
    places = np.concatenate([volume.vertices[np.unique(volume.faces)], corners.mean(axis=1), drawn])
    off = NearestFacets(solid.vertices, solid.faces, 1).query(places).distance_m
    return float(off.max()), places[off.argmax()]


def _largest_lump(differs: manifold3d.Manifold, built: str) -> tuple[float, str]:
    """Return the volume, m3, of the largest lump of a space, and what is built where in its stead."""
    found = differs.to_mesh64()
    vertices, faces = np.array(found.vert_properties)[:, :3], np.asarray(found.tri_verts).astype(np.int64)
    if not len(faces):
        return 0.0, ""
    ends = (np.ones(2 * len(faces)), (faces[:, [0, 0]].reshape(-1), faces[:, [1, 2]].reshape(-1)))
    part = connected_components(coo_matrix(ends, (len(vertices),) * 2), directed=False)[1][faces[:, 0]]
    middle = vertices.mean(axis=0)
    a, b, c = np.moveaxis(vertices[faces] - middle, 1, 0)
    normal = np.cross(b - a, c - a)
    m3 = np.bincount(part, np.einsum("ij,ij->i", a, normal) / 6)
    m2 = np.bincount(part, np.linalg.norm(normal, axis=1) / 2)
    m3[2 * m3 <= _THICK_M * m2] = 0.0
    largest = int(m3.argmax())
    corners = vertices[faces[part == largest].reshape(-1)]
    x, y, z = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return float(m3[largest]), f"{built} at {x:.1f}, {y:.1f}, {z:.1f}"
