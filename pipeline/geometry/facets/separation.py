"""Which convex bodies a facet reaches into, by separating planes, for all pairs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

ROUNDING_M = 1e-9  # a facet that is so deep in a body only touches it
_CELL_M = 1.0  # of the grid by which boxes are found, at least; it has a million cells at most
_CELLS = 1e6
_PLACES = 50_000  # of corners along directions at once: they stay in the processor's cache
_TOGETHER = 1000  # bodies: their pairs with facets take some 10 MB where facets are small


@dataclass(frozen=True)
class ConvexBodies:
    """Convex bodies with equally many corners; shorter lists repeat an entry.

    Attributes
    ----------
    corners : (n, c, 3) float64, m
    directions : (n, d, 3) float64
        Unit normals of the bodies' faces, outward, the one with most facets beyond it first; zeros of a face without an
        area. Any direction is sound.
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

    def counts(self) -> np.ndarray:
        """Return how many corners (n,) each body has without the repeated ones at the end of its list."""
        same = (self.corners == self.corners[:, -1:]).all(axis=2)
        found: np.ndarray = self.corners.shape[1] - np.maximum(np.argmin(same[:, ::-1], axis=1) - 1, 0)
        return found

    def some(self, chosen: slice | np.ndarray) -> ConvexBodies:
        """Return those that are chosen."""
        return ConvexBodies(self.corners[chosen], self.directions[chosen], self.edges[chosen], self.owner[chosen])


@dataclass(frozen=True)
class Contacts:
    """Pairs of a body and a facet that no plane separates, and how deep, m, the facet is in the body at most."""

    body: np.ndarray
    facet: np.ndarray
    depth_m: np.ndarray

    @classmethod
    def joined(cls, found: list[Contacts]) -> Contacts:
        """Return the pairs of some lists as one."""
        columns = zip(*(vars(one).values() for one in [NO_CONTACTS, *found]), strict=True)
        return cls(*map(np.concatenate, columns))

    def some(self, chosen: np.ndarray) -> Contacts:
        """Return those that are chosen."""
        return Contacts(self.body[chosen], self.facet[chosen], self.depth_m[chosen])

    def within(self, depth_m: np.ndarray) -> Contacts:
        """Return the pairs that touch no more than a depth (n,) m, without those that a plane separates."""
        depth = np.minimum(self.depth_m, depth_m)
        deep = depth > ROUNDING_M
        return Contacts(self.body[deep], self.facet[deep], depth[deep])


NO_CONTACTS = Contacts(np.zeros(0, int), np.zeros(0, int), np.zeros(0))


def boxes_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest coordinates (n, 3) m of triangles (n, 3, 3); NumPy is slow along short axes."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def boxes_near(low: np.ndarray, high: np.ndarray, least: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return the numbers of boxes (n, 3) m that meet one of some others (k, 3) m, and of some that are not far from it.

    A grid finds them, seen from above: an index of all boxes would take longer where the others are few.
    """
    if not len(least):
        return np.zeros(0, int)
    start, end = low[:, :2].min(axis=0), high[:, :2].max(axis=0)
    size = max(_CELL_M, float(np.sqrt(np.prod(end - start) / _CELLS)))
    shape = ((end - start) // size).astype(int) + 1
    ours, theirs = (
        [np.clip((corner[:, :2] - start) // size, 0, shape - 1).astype(int) for corner in both]
        for both in ((low, high), (least, most))
    )
    (west, south), (east, north) = theirs[0].T, theirs[1].T + 1
    change = np.zeros(shape + 1, int)
    for x, y, by in ((west, south, 1), (east, north, 1), (west, north, -1), (east, south, -1)):
        np.add.at(change, (x, y), by)
    taken = change.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0
    count = np.zeros(shape + 1, int)
    count[1:, 1:] = taken.cumsum(axis=0).cumsum(axis=1)
    (west, south), (east, north) = ours[0].T, ours[1].T + 1
    found: np.ndarray = np.flatnonzero(
        count[east, north] - count[west, north] - count[east, south] + count[west, south]
    )
    return found


class Facets:
    """The facets of a closed mesh, indexed by their boxes."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Index the facets (f, 3) of vertices (v, 3) m."""
        self.corners = vertices[faces]
        a, b, c = np.moveaxis(self.corners, 1, 0)
        normals = np.cross(b - a, c - a)
        self.normals, self.areas_m2 = _units(normals), np.linalg.norm(normals, axis=1) / 2
        self.owner = np.arange(len(faces))
        self._low, self._high = boxes_of(self.corners)
        self._tree = shapely.STRtree(shapely.box(*self._low[:, :2].T, *self._high[:, :2].T))
        self._points, self._ways = _apart(self.corners), _apart(self.normals[:, None])[0]

    def crossing(
        self,
        bodies: ConvexBodies,
        enough_m: float = np.inf,
        tried: np.ndarray | None = None,
        of: np.ndarray | None = None,
    ) -> Contacts:
        """Return the facets that reach into each body; those of its owner are not tried.

        Of a body in which a corner of a facet is deeper than `enough_m`, m, that facet alone is returned. Facets of
        `tried`, a mask (f,), are bodies themselves: a pair of two is tried once. With numbers `of` (f,), only facets of
        the owner's number are tried.

        Tried are a body's directions, the facets' planes and the products of edges, which is all there is of planes
        that can separate two convex bodies.
        """
        ends = ((start, min(start + _TOGETHER, len(bodies))) for start in range(0, len(bodies), _TOGETHER))
        return Contacts.joined([self._crossing(bodies, *some, enough_m, tried, of) for some in ends])

    def _crossing(
        self,
        bodies: ConvexBodies,
        start: int,
        end: int,
        enough_m: float,
        tried: np.ndarray | None,
        of: np.ndarray | None,
    ) -> Contacts:
        some = bodies.some(slice(start, end))
        body, facet = self.near(some.corners.min(axis=1), some.corners.max(axis=1))
        other = self.owner[facet] != some.owner[body]
        if tried is not None:
            other &= ~tried[facet] | (facet > some.owner[body])
        if of is not None:
            other &= of[facet] == of[some.owner[body]]
        pairs = self.crossing_pairs(some, body[other], facet[other], enough_m)
        return Contacts(pairs.body + start, pairs.facet, pairs.depth_m)

    def crossing_pairs(
        self, some: ConvexBodies, body: np.ndarray, facet: np.ndarray, enough_m: float = np.inf
    ) -> Contacts:
        """Return those pairs of a body and a facet (n,) that `crossing` would return."""
        bodies, pairs = _Apart(some), Contacts(body, facet, np.full(len(body), np.inf))
        number = 0
        while number < len(bodies.directions):
            rows = bodies.next_of(number, pairs)
            pairs = pairs.within(self._over(bodies, rows, pairs).max(axis=1).min(axis=0))
            if number == 0:
                pairs = pairs.within(self._past_planes(bodies, pairs))
            number = rows.stop
        clear = NO_CONTACTS
        if np.isfinite(enough_m):
            inside = self._deepest_corner(bodies, pairs) > enough_m
            first = np.flatnonzero(inside)[np.unique(pairs.body[inside], return_index=True)[1]]
            left = ~np.isin(pairs.body, pairs.body[first])
            clear, pairs = pairs.some(first), pairs.some(left)
        number = 0
        while number < len(bodies.edges):
            rows = bodies.next_of(number, pairs)
            pairs = pairs.within(self._between_edges(bodies, rows, pairs))
            number = rows.stop
        return Contacts.joined([clear, pairs])

    def near(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs of a box, from `low` to `high` (n, 3) m, and a facet whose own box meets it, by box."""
        box, facet = self._tree.query(shapely.box(*low[:, :2].T, *high[:, :2].T))
        meets = (self._low[facet, 2] <= high[box, 2]) & (self._high[facet, 2] >= low[box, 2])
        return box[meets], facet[meets]

    def _over(self, bodies: _Apart, rows: slice, pairs: Contacts) -> np.ndarray:
        """Return how far (d, 3, n) m the facets' corners are behind some faces of their bodies."""
        at = _dots(self._points.take(pairs.facet, 2), bodies.directions[rows].take(pairs.body, 2))
        return bodies.reach[rows].take(pairs.body, 1)[:, None] - at

    def _past_planes(self, bodies: _Apart, pairs: Contacts) -> np.ndarray:
        """Return how far (n,) m bodies reach over both sides of their facets' planes; inf for one without an area."""
        normal = self._ways.take(pairs.facet, 1)
        over = _dots(bodies.points.take(pairs.body, 2), normal)
        over -= _dots(self._points[:1].take(pairs.facet, 2), normal)
        both = np.minimum(over.max(axis=0), -over.min(axis=0))
        return np.where(np.abs(normal).max(axis=0) > 0, both, np.inf)

    def _deepest_corner(self, bodies: _Apart, pairs: Contacts) -> np.ndarray:
        """Return how deep (n,) m the deepest of the facets' corners is behind all faces of their bodies."""
        least, number = np.full((3, len(pairs.body)), np.inf), 0
        while number < len(bodies.directions):
            rows = bodies.next_of(number, pairs)
            np.minimum(least, self._over(bodies, rows, pairs).min(axis=0), out=least)
            number = rows.stop
        found: np.ndarray = least.max(axis=0)
        return found

    def _between_edges(self, bodies: _Apart, rows: slice, pairs: Contacts) -> np.ndarray:
        """Return how far (n,) m bodies and facets overlap across some edges of the bodies and sides of the facets."""
        ours, theirs = bodies.points.take(pairs.body, 2), self._points.take(pairs.facet, 2)
        edges = bodies.edges[rows].take(pairs.body, 2)
        sides = np.roll(theirs, -1, axis=0) - theirs
        scale = np.sqrt((sides**2).sum(axis=1).max(axis=0)) * bodies.longest.take(pairs.body)
        found = np.full(len(pairs.body), np.inf)
        for side in sides:
            across = _cross(edges, side)
            size = np.sqrt((across**2).sum(axis=1))
            across /= np.maximum(size, 1e-30)[:, None]
            one, other = _dots(ours, across), _dots(theirs, across)
            inside = np.minimum(one.max(axis=1) - other.min(axis=1), other.max(axis=1) - one.min(axis=1))
            np.minimum(found, np.where(size > 1e-9 * scale, inside, np.inf).min(axis=0), out=found)
        return found


class _Apart:
    """Bodies with their components apart, `(k, 3, n)`: NumPy is slow along short axes."""

    def __init__(self, bodies: ConvexBodies) -> None:
        """Take bodies, and how far each reaches in its directions; one of no length parts nothing."""
        self.points, self.directions, self.edges = map(_apart, (bodies.corners, bodies.directions, bodies.edges))
        reach = np.array([_dots(self.points, one).max(axis=0) for one in self.directions])
        self.reach = np.where(self.directions.any(axis=1), reach, np.inf)
        self.longest = np.sqrt((self.edges**2).sum(axis=1).max(axis=0, initial=0.0))

    def next_of(self, first: int, pairs: Contacts) -> slice:
        """Return which directions or edges, from the first one left, are tried at once: one where pairs are many."""
        return slice(first, first + max(1, _PLACES // max(1, len(self.points) * len(pairs.body))))


def _apart(points: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(points.transpose(1, 2, 0))


def _dots(points: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return the places (..., k, n) of points (k, 3, n) along ways (..., 3, n)."""
    x, y, z = (ways[..., axis, None, :] for axis in range(3))
    found = points[:, 0] * x
    found += points[:, 1] * y
    found += points[:, 2] * z
    return found


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products (d, 3, n) of vectors (d, 3, n) and others (3, n)."""
    x, y, z = np.moveaxis(a, 1, 0)
    return np.stack([y * b[2] - z * b[1], z * b[0] - x * b[2], x * b[1] - y * b[0]], axis=1)


def _units(vectors: np.ndarray) -> np.ndarray:
    found: np.ndarray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)
    return found
