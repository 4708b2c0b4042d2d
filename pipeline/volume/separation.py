"""Which convex bodies a facet reaches into, by separating planes, for all pairs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

ROUNDING_M = 1e-9  # a facet that is so deep in a body only touches it
_PAIRS = 20_000  # tried together
_TOGETHER = 500  # bodies: their pairs with facets take some 100 MB where facets are small


@dataclass(frozen=True)
class ConvexBodies:
    """Convex bodies with equally many corners; shorter lists repeat an entry.

    Attributes
    ----------
    corners : (n, c, 3) float64, m
    directions : (n, d, 3) float64
        Unit normals of the bodies' faces, outward, the one with most facets beyond it first. Any direction is sound.
    edges : (n, e, 3) float64
        Directions of the bodies' edges.
    owner : (n,) int64
        Number of the surface that each lies behind: its facets only touch it.
    """

    corners: np.ndarray
    directions: np.ndarray
    edges: np.ndarray
    owner: np.ndarray

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.corners)

    def some(self, chosen: slice | np.ndarray) -> ConvexBodies:
        """Return those that are chosen."""
        return ConvexBodies(self.corners[chosen], self.directions[chosen], self.edges[chosen], self.owner[chosen])


@dataclass(frozen=True)
class Contacts:
    """Pairs of a body and a facet that no plane separates, and how deep, m, the facet is in the body at most."""

    body: np.ndarray
    facet: np.ndarray
    depth_m: np.ndarray


class Facets:
    """The facets of a closed mesh, indexed by their boxes."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Index the facets (f, 3) of vertices (v, 3) m."""
        self.corners = vertices[faces]
        a, b, c = np.moveaxis(self.corners, 1, 0)
        self.normals = _units(np.cross(b - a, c - a))
        self.owner = np.arange(len(faces))
        self._low, self._high = self.corners.min(axis=1), self.corners.max(axis=1)
        self._tree = shapely.STRtree(shapely.box(*self._low[:, :2].T, *self._high[:, :2].T))

    def crossing(self, bodies: ConvexBodies, enough_m: float = np.inf) -> Contacts:
        """Return the facets that reach into each body; those of its owner are not tried.

        Of a body in which a corner of a facet is deeper than `enough_m`, m, that facet alone is returned.

        Tried are a body's directions, the facets' planes and the products of edges, which is all there is of planes
        that can separate two convex bodies.
        """
        found = []
        for start in range(0, len(bodies), _TOGETHER):
            chosen = slice(start, start + _TOGETHER)
            body, facet, depth = self._crossing(bodies.some(chosen), enough_m)
            found.append((body + start, facet, depth))
        if not found:
            return Contacts(np.zeros(0, int), np.zeros(0, int), np.zeros(0))
        return Contacts(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _crossing(self, bodies: ConvexBodies, enough_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        body, facet = self._near(bodies)
        depth = np.full(len(body), np.inf)
        reach = np.einsum("ndk,nck->ndc", bodies.directions, bodies.corners).max(axis=2)
        for which in (slice(0, 1), None, slice(1, None)):
            if which is None:
                inside = self._past_planes(bodies.corners[body], facet)
            else:
                directions = bodies.directions[body, which]
                least = np.einsum("nck,ndk->ndc", self.corners[facet], directions).min(axis=2)
                inside = (reach[body, which] - least).min(axis=1, initial=np.inf)
            body, facet, depth = _deep(body, facet, np.minimum(depth, inside))
        clear = self._first_inside(bodies, reach, body, facet, enough_m) if np.isfinite(enough_m) else np.zeros(0, int)
        left = ~np.isin(body, body[clear])
        for start in range(0, int(left.sum()), _PAIRS):
            some = np.flatnonzero(left)[start : start + _PAIRS]
            depth[some] = np.minimum(depth[some], self._between_edges(bodies, body[some], facet[some]))
        left[clear] = True
        return _deep(body[left], facet[left], depth[left])

    def _first_inside(
        self, bodies: ConvexBodies, reach: np.ndarray, body: np.ndarray, facet: np.ndarray, enough_m: float
    ) -> np.ndarray:
        """Return one pair (n,) of each body in which a facet's corner is deeper than `enough_m`."""
        deep = np.zeros(len(body), bool)
        for start in range(0, len(body), _PAIRS):
            some = slice(start, start + _PAIRS)
            at = np.einsum("nck,ndk->ncd", self.corners[facet[some]], bodies.directions[body[some]])
            deep[some] = (reach[body[some], None] - at).min(axis=2).max(axis=1) > enough_m
        pairs = np.flatnonzero(deep)
        first: np.ndarray = pairs[np.unique(body[pairs], return_index=True)[1]]
        return first

    def _near(self, bodies: ConvexBodies) -> tuple[np.ndarray, np.ndarray]:
        low, high = bodies.corners.min(axis=1), bodies.corners.max(axis=1)
        body, facet = self._tree.query(shapely.box(*low[:, :2].T, *high[:, :2].T))
        meets = (self._low[facet, 2] <= high[body, 2]) & (self._high[facet, 2] >= low[body, 2])
        meets &= self.owner[facet] != bodies.owner[body]
        return body[meets], facet[meets]

    def _past_planes(self, corners: np.ndarray, facet: np.ndarray) -> np.ndarray:
        """Return how far (n,) m bodies reach over both sides of their facets' planes; inf for one without an area."""
        normal = self.normals[facet]
        over = np.einsum("nck,nk->nc", corners, normal) - np.einsum("nk,nk->n", self.corners[facet, 0], normal)[:, None]
        both = np.minimum(over.max(axis=1), -over.min(axis=1))
        return np.where(np.abs(normal).max(axis=1) > 0, both, np.inf)

    def _between_edges(self, bodies: ConvexBodies, body: np.ndarray, facet: np.ndarray) -> np.ndarray:
        corners = self.corners[facet]
        sides = np.roll(corners, -1, axis=1) - corners
        across = np.cross(bodies.edges[body][:, :, None], sides[:, None]).reshape(
            len(body), 3 * bodies.edges.shape[1], 3
        )
        size = np.linalg.norm(across, axis=2)
        scale = np.linalg.norm(sides, axis=2).max(axis=1, initial=0.0)[:, None] * _longest(bodies.edges[body])
        across /= np.maximum(size, 1e-30)[:, :, None]
        ours, theirs = (np.einsum("ndk,nck->ndc", across, x) for x in (bodies.corners[body], corners))
        inside = np.minimum(ours.max(axis=2) - theirs.min(axis=2), theirs.max(axis=2) - ours.min(axis=2))
        found: np.ndarray = np.where(size > 1e-9 * scale, inside, np.inf).min(axis=1, initial=np.inf)
        return found


def _longest(edges: np.ndarray) -> np.ndarray:
    found: np.ndarray = np.linalg.norm(edges, axis=2).max(axis=1, initial=0.0)[:, None]
    return found


def _deep(body: np.ndarray, facet: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    deep = depth > ROUNDING_M
    return body[deep], facet[deep], depth[deep]


def _units(vectors: np.ndarray) -> np.ndarray:
    found: np.ndarray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)
    return found
