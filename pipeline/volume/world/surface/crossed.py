"""Where visible rock crosses itself in the 32 bits of meshes, and whether it is the volume's own facets there."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pipeline.geometry.facets.separation import Facets
from pipeline.surface.mesh.mesh_checks import find_crossings

_CORNERS = 12  # of the rock, about a place where it crosses itself
_ON_FACETS_M = 1e-4  # of the volume's facets: rock without relief
_ROUNDED = 4.0  # or so many steps of 32 bits, far from the origin


def places_crossed(
    vertices: np.ndarray, faces: np.ndarray, volume: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (k, 3) m where rock crosses itself, and at which (k,) it is the facets of the volume.

    The sides of a thin wedge of rock may cross in 32 bits. The volume itself does not.

    Parameters
    ----------
    vertices, faces : (n, 3) float64 m, (m, 3) int
        Of the rock, without floors.
    volume : (v, 3) float64 m, (f, 3) int
        Vertices and facets.
    """
    used, numbers = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], numbers.reshape(-1, 3)
    places = find_crossings(vertices, faces)
    if not len(places):
        return places, np.zeros(0, bool)
    _, near = cKDTree(vertices).query(places, k=min(_CORNERS, len(vertices)))
    about = np.concatenate([places[:, None], vertices[near]], axis=1)
    within_m = max(_ON_FACETS_M, _ROUNDED * float(np.spacing(np.float32(np.abs(vertices).max()))))
    own = _on_facets(about.reshape(-1, 3), volume, within_m).reshape(about.shape[:2]).all(axis=1)
    return places, np.asarray(own)


def _on_facets(places: np.ndarray, volume: tuple[np.ndarray, np.ndarray], within_m: float) -> np.ndarray:
    """Return which places (n, 3) m are so near to a facet. Distances in 32 bits are 1 mm off beside narrow facets."""
    from trimesh.triangles import closest_point  # takes half a second to load

    vertices, faces = volume
    place, facet = Facets(vertices, faces).near(places - within_m, places + within_m)
    nearest = closest_point(vertices[faces[facet]], places[place]) if len(place) else np.zeros((0, 3))
    found = np.zeros(len(places), bool)
    found[place[np.linalg.norm(nearest - places[place], axis=1) < within_m]] = True
    return found
