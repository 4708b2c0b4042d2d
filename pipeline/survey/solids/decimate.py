"""A closed surface with fewer facets: edges collapsed by quadrics as far as a tolerance allows."""

from __future__ import annotations

import fast_simplification
import manifold3d
import numpy as np

from minesurveys.errors import InputError
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.scans.meshes.uncrossed import arrays_of

# Of 100 vertices so many move by no more than so many tolerances. The rest are those of edges, which noise rounds.
_WITHIN = ((0.8, 1.0), (0.99, 3.0))
EXACT = ((1.0, 1.0),)  # all of them by no more than one tolerance
_SHRINK = 0.7  # of facets from one try to the next
_LEAST = 200
_TRIES = 40


def decimated(
    vertices: np.ndarray,
    faces: np.ndarray,
    tolerance_m: float,
    most_facets: int,
    within: tuple[tuple[float, float], ...] = _WITHIN,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return a closed mesh with as few facets as a tolerance allows, at most `most_facets`, and more only if they fold.

    The third is within how far of it the first share of `within` of vertices is, m: more than the tolerance where
    `most_facets` are few.

    Parameters
    ----------
    vertices, faces : (n, 3) float64 m, (m, 3) int
    tolerance_m : float
        Of ten vertices eight are nearer to the surface that is returned; of a hundred 99 are three times as near.
    most_facets : int
    within : pairs of a share of the vertices and how many tolerances they move by at most

    Raises
    ------
    InputError
        If no mesh that encloses a space comes out.
    """
    middle = vertices.mean(axis=0)
    about = (vertices - middle).astype(np.float32)
    best: manifold3d.Manifold | None = None
    moved_m = 0.0
    wanted = min(len(faces), most_facets)
    for _ in range(_TRIES):
        found = _closed(*fast_simplification.simplify(about, faces.astype(np.int32), target_count=wanted))
        if found is not None:
            off = distances(about, *arrays_of(found))
            if best is not None and any(np.quantile(off, share) > most * tolerance_m for share, most in within):
                break
            best, moved_m = found, float(np.quantile(off, within[0][0]))
        elif best is not None:
            break
        wanted = int(wanted * _SHRINK)
        if wanted < _LEAST:
            break
    if best is None:
        raise InputError("its surface cannot be simplified to a closed mesh; --voxel states a larger size")
    found_vertices, found_faces = arrays_of(best)
    return found_vertices + middle, found_faces, moved_m


def _closed(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold | None:
    """Return a mesh without facets that lie on each other, None if it encloses nothing."""
    mesh = manifold3d.Mesh64(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.uint64))
    solid = manifold3d.Manifold(mesh)
    return solid if solid.status() == manifold3d.Error.NoError and solid.volume() > 0 else None


def distances(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the distance (k,) of points (k, 3) from a mesh."""
    return NearestFacets(vertices, faces).query(points).distance_m
