"""Rock that is thinner than a body sinks in is made thicker, at the cost of the free space behind it."""

from __future__ import annotations

from contextlib import suppress

import manifold3d
import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import GeometryError
from pipeline.geometry.facets.crossings import CROSSING_M, crosses_more
from pipeline.volume.labelled_solid import KeyedSolid, Neighbourhood, keyed, near_facets, volume_of
from pipeline.volume.shell import facets_without_part
from pipeline.volume.slivers import without_slivers
from pipeline.volume.union import Volume, without_crumbs

# Half of the rock that is put before a facet in each round, m: parts of 2 cm fit into it; and the facets that are worth
# it, m2: the rock before one makes others at its rim, so that smaller ones would never end.
_ROUNDS = ((0.027, 1e-4), (0.03, 1e-5), (0.033, 1e-5), (0.036, 1e-5), (0.04, 1e-5), (0.045, 1e-5))
# Prisms differ in size by up to so much of it: of those that share planes manifold3d makes facets that cross by metres.
_UNLIKE, _TURN = (1e-3, 3e-3, 1e-2), (np.sqrt(5) - 1) / 2
_ALWAYS = 2  # rounds; others if there is more left than this, m2
_LEFT_M2 = 0.02
_BEHIND_M = 0.002  # a place that is so far behind a facet may be before it
_BESIDE = 1.5  # of half of the rock, from a facet to a place: at its corners the rock is wider by 1.41 of it
NARROW_M = 0.06  # of a circle: no body that is thrown is narrower, so that none sinks in there
_POCKET_M3 = 1e-3  # of free space that becomes rock
_ROOF_NZ = 0.7  # of a facet's normal, which points out of the free space


def without_thin_rock(volume: Volume, ways: np.ndarray, floating_m3: float = np.inf, narrow_m: float = 0.0) -> Volume:
    """Return the volume with at least 2 cm of rock behind its facets.

    In front of each facet behind which no part of 2 cm is in the rock, 5 cm or more become rock: two passages with less
    between them stay two, and rock without a thickness gets one. Nothing is put on floors, so that they keep their
    heights: what a part below them reaches gets the rock. Nor is it put on places (n, 3) m of surveyed ways, which may
    run on a wall. Rock that floats stays if it is larger than `floating_m3`. Each round looks about the rock of the one
    before.

    Nothing is put before thin facets that hold no circle wider than `narrow_m`, m, together with those that they touch:
    the rock before a facet has some twenty, and where rock tapers a scan's mesh has many thin ones.
    """
    some: np.ndarray | None = None
    tree = cKDTree(ways)
    for number, (half_m, least_m2) in enumerate(_ROUNDS):
        facets, thin_m2 = _to_thicken(volume, some, least_m2, narrow_m)
        facets = facets[~_on_ways(volume, facets, tree, half_m)]
        if not len(facets) or (number >= _ALWAYS and thin_m2 < _LEFT_M2):
            break
        changed = volume.vertices[volume.faces[facets]]
        volume = _with_rock(volume, facets, half_m, floating_m3)
        some = near_facets(volume.vertices[volume.faces], changed, 4 * half_m)
    one = keyed(volume, volume.vertices, volume.label)
    return volume_of(KeyedSolid(without_crumbs(one.solid, floating_m3=floating_m3), one.keys), volume)


def _with_rock(volume: Volume, facets: np.ndarray, half_m: float, floating_m3: float) -> Volume:
    """Return the volume with rock before some facets.

    Only their neighbourhood is changed; all is where manifold3d merges vertices across its border.
    """
    about = Neighbourhood(volume, volume.vertices[volume.faces[facets]], 3 * half_m)
    thick = _thickened(about.volume, about.numbers(facets), half_m, floating_m3, about.border)
    with suppress(GeometryError):
        return about.put_back(without_slivers(thick, kept=about.at_border(thick)))
    return without_slivers(_thickened(volume, facets, half_m, floating_m3))


def _to_thicken(volume: Volume, some: np.ndarray | None, least_m2: float, narrow_m: float) -> tuple[np.ndarray, float]:
    """Return the facets in front of which rock is put, and the area of those with thin rock, m2."""
    area = np.linalg.norm(volume.normals, axis=1) / 2
    is_floor = volume.label == FacetLabel.FLOOR
    thin = facets_without_part(volume, some, least_m2)
    wide = _wide(volume, np.array(list(thin), int), narrow_m)
    facets = {below for k in wide.tolist() for below in (thin[k] if is_floor[k] else [k])}
    found = np.array(sorted(facets), int)
    return found[~is_floor[found]], float(area[wide].sum())


def _wide(volume: Volume, facets: np.ndarray, narrow_m: float) -> np.ndarray:
    """Return those of some facets (n,) that may hold a circle wider than `narrow_m` with others that they touch.

    It is at most as wide as the circles in all of these together, as in `widest_gap`.
    """
    own = volume.faces[facets]
    corners = volume.vertices[own]
    around = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).sum(axis=1)
    width = 2 * np.linalg.norm(volume.normals[facets], axis=1) / np.maximum(around, 1e-30)
    pairs = np.concatenate([own[:, :2], own[:, 1:]])
    touching = coo_matrix((np.ones(len(pairs), bool), pairs.T), (len(volume.vertices),) * 2)
    group = connected_components(touching, directed=False)[1][own[:, 0]]
    found: np.ndarray = facets[np.bincount(group, width)[group] > narrow_m]
    return found


def _on_ways(volume: Volume, facets: np.ndarray, ways: cKDTree, half_m: float) -> np.ndarray:
    """Return before which facets (n,) the rock would be on a place of a way."""
    corners = volume.vertices[volume.faces[facets]]
    normals, along, across = _frames(volume, facets)
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1) + 3 * half_m
    near = ways.query_ball_point(middle, reach)
    row = np.repeat(np.arange(len(facets)), [len(some) for some in near])
    step = ways.data[np.array([place for some in near for place in some], int)] - middle[row]
    depth = np.sum(step * normals[row], axis=1)
    plane = np.stack([along, across], axis=1)
    triangles = shapely.polygons(np.einsum("nik,nck->nci", plane, corners - middle[:, None]))
    beside = shapely.distance(triangles[row], shapely.points(np.einsum("nik,nk->ni", plane[row], step)))
    found = np.zeros(len(facets), bool)
    found[row[(depth > -_BEHIND_M) & (depth < 2 * half_m) & (beside < _BESIDE * half_m)]] = True
    return found


def _frames(volume: Volume, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit vectors (n, 3) of facets: into the free space, and two square to it."""
    normal = -volume.normals[facets]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True).clip(1e-30)
    return normal, along, np.cross(normal, along)


def _thickened(
    volume: Volume, facets: np.ndarray, half_m: float, floating_m3: float, border_of: int | None = None
) -> Volume:
    """Return a volume without what is before some of its facets: prisms with bevelled edges, wider than the facet.

    They are twice as deep as `half_m`, and so much wider on each side. Pockets that they cut off become rock, but those
    at facets with the source `border_of`. Where facets cross then, prisms of other sizes are tried.
    """
    for unlike in _UNLIKE:
        size_m = half_m * (1 + unlike * np.modf(_TURN * np.arange(len(facets)))[0])
        found = _cut(volume, facets, size_m, floating_m3, border_of)
        if not len(crosses_more(found.vertices, found.faces, (volume.vertices, volume.faces), CROSSING_M)):
            break
    up = found.normals[:, 2] > _ROOF_NZ * np.linalg.norm(found.normals, axis=1)
    found.label[up & (found.label == FacetLabel.WALL)] = FacetLabel.ROOF
    return found


def _cut(volume: Volume, facets: np.ndarray, size_m: np.ndarray, floating_m3: float, border_of: int | None) -> Volume:
    """Return a volume without prisms before some of its facets (n,), of half a depth (n,) m, as `_thickened` does."""
    one = keyed(volume, volume.vertices, volume.label)
    border = [number for number, key in one.keys.items() if key // len(FacetLabel) == border_of]
    corners = volume.vertices[volume.faces[facets]]
    normal, along, across = _frames(volume, facets)
    ring = np.stack([along + across, across - along, -along - across, along - across], axis=1)
    ball = np.concatenate([0 * ring[:, :1], ring + normal[:, None], ring + 2 * normal[:, None]], axis=1)
    keys, bodies = dict(one.keys), []
    for k, points, spread in zip(facets.tolist(), corners, size_m[:, None, None] * ball, strict=True):
        body = manifold3d.Manifold.hull_points((points[:, None] + spread).reshape(-1, 3)).as_original()
        keys[body.original_id()] = len(FacetLabel) * int(volume.source[k]) + FacetLabel.WALL
        bodies.append(body)
    cut = manifold3d.Manifold.batch_boolean([one.solid, *bodies], manifold3d.OpType.Subtract)
    solid = without_crumbs(cut, _POCKET_M3, [body.original_id() for body in bodies], border, floating_m3)
    return volume_of(KeyedSolid(solid, keys), volume)
