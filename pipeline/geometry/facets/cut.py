"""Cut the facets of a closed mesh finely, each at a spacing of its own, so that it stays closed."""

from __future__ import annotations

import numpy as np


def cut_facets(
    vertices: np.ndarray, faces: np.ndarray, apart_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the points (k, 3) m and triangles (t, 3) of facets cut finely, and the facet (t,) that each is of.

    The points lie in rows, about `apart_m` apart in a row and from row to row: there are two triangles for a square of
    that side, as in a lattice. An edge is cut at the lesser spacing of its two facets. The first points are the
    vertices.

    Parameters
    ----------
    vertices : (n, 3) float64, m
    faces : (m, 3) int
        Closed, with one winding.
    apart_m : (m,) float64, m
        Of each facet.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)]).astype(np.int64)
    edges, edge = np.unique(ends.min(axis=0) * len(vertices) + ends.max(axis=0), return_inverse=True)
    edge = edge.reshape(-1, 3)
    least_m = np.full(len(edges), np.inf)
    np.minimum.at(least_m, edge, apart_m[:, None])
    points = _Points(vertices)
    lines = points.lay(*np.divmod(edges, len(vertices)), least_m)[edge]
    sides, facet = _parted(points, np.where((ends[0] < ends[1])[..., None], lines, _backwards(lines)), apart_m)
    triangles, of = _filled(points, sides, apart_m[facet])
    return points.places, triangles, facet[of]


class _Points:
    """Points on lines: their `places` (n, 3) m, and their numbers `along` (k,) one line after the other.

    A line is where it begins in `along`, the step to its next point there, 1 or -1, and the number of its pieces.
    """

    def __init__(self, vertices: np.ndarray) -> None:
        """Begin with some points and no line."""
        self.places, self.along = vertices, np.zeros(0, np.int64)

    def number(self, lines: np.ndarray, step: np.ndarray | int) -> np.ndarray:
        """Return the number (n,) of the point that is so many steps along each line (n, 3)."""
        found: np.ndarray = self.along[lines[..., 0] + lines[..., 1] * step]
        return found

    def lay(self, one: np.ndarray, other: np.ndarray, apart_m: np.ndarray) -> np.ndarray:
        """Return new lines (n, 3) between points (n,) in pieces of about (n,) m; none from a point to itself."""
        way = self.places[other] - self.places[one]
        pieces = np.rint(np.sqrt((way * way).sum(axis=1)) / apart_m).astype(np.int64)
        pieces = np.where(one == other, 0, np.maximum(1, pieces))
        line, step = _each(pieces + 1)
        number = np.where(step == 0, one[line], other[line])
        inner = np.flatnonzero((step > 0) & (step < pieces[line]))
        number[inner] = len(self.places) + np.arange(len(inner))
        share = step[inner] / pieces[line[inner]]
        new = self.places[one[line[inner]]] + share[:, None] * way[line[inner]]
        first = len(self.along) + np.cumsum(pieces + 1) - (pieces + 1)
        self.places, self.along = np.concatenate([self.places, new]), np.concatenate([self.along, number])
        return np.stack([first, np.ones_like(first), pieces], axis=1)


def _backwards(lines: np.ndarray) -> np.ndarray:
    """Return lines (..., 3) from their ends."""
    first, step, pieces = np.moveaxis(lines, -1, 0)
    return np.stack([first + step * pieces, -step, pieces], axis=-1)


def _from_side(sides: np.ndarray, first: np.ndarray) -> list[np.ndarray]:
    """Return the sides of triangles (m, 3, 3), in their order, from the given one (m,)."""
    return [sides[np.arange(len(sides)), (first + k) % 3] for k in range(3)]


def _parted(points: _Points, sides: np.ndarray, apart_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Part obtuse facets with sides (m, 3, 3) at the height over the longest; return all sides, and the facets."""
    long, right, left = _from_side(sides, sides[:, :, 2].argmax(axis=1))
    a, b, c = (points.places[points.number(side, 0)] for side in (long, right, left))
    foot = long[:, 2] * ((c - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
    foot = np.clip(np.rint(foot), 0, long[:, 2]).astype(np.int64)
    inner = (foot > 0) & (foot < long[:, 2])
    some = np.flatnonzero(inner & (long[:, 2] ** 2 > right[:, 2] ** 2 + left[:, 2] ** 2))
    whole = np.setdiff1d(np.arange(len(sides)), some)
    long, right, left, foot = long[some], right[some], left[some], foot[some]
    height = points.lay(points.number(long, foot), points.number(left, 0), apart_m[some])
    first, last = long.copy(), long.copy()
    first[:, 2], last[:, 0], last[:, 2] = foot, long[:, 0] + long[:, 1] * foot, long[:, 2] - foot
    parts = np.stack([first, height, left], axis=1), np.stack([last, right, _backwards(height)], axis=1)
    return np.concatenate([sides[whole], *parts]), np.concatenate([whole, some, some])


def _filled(points: _Points, sides: np.ndarray, apart_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fill triangles with sides (m, 3, 3) with rows; return fine triangles, and of which (t,) each is.

    The rows lie along the shortest side. Each joins a point of the next longer side with one of the longest. Between
    two rows, and the points of the longest side that no row ends at, triangles go from point to point of both.
    """
    base, left, right = _from_side(sides, sides[:, :, 2].argmin(axis=1))
    left = _backwards(left)
    turned = (right[:, 2] > left[:, 2])[:, None]
    base = np.where(turned, _backwards(base), base)
    short, long = np.where(turned, left, right), np.where(turned, right, left)
    count = short[:, 2]
    of, row = _each(count)
    end = (2 * row * long[of, 2] + count[of]) // (2 * count[of])
    upper = points.lay(points.number(short[of], row), points.number(long[of], end), apart_m[of])
    is_last = row == count[of] - 1
    lower = np.where(is_last[:, None], base[of], np.roll(upper, -1, axis=0))
    spare = np.where(is_last, long[of, 2], np.roll(end, -1)) - end - 1
    faces, strip = _zipped(points, lower, upper, long[of], end, spare)
    return np.where(turned[of[strip]], faces[:, ::-1], faces), of[strip]


def _zipped(
    points: _Points, lower: np.ndarray, upper: np.ndarray, side: np.ndarray, end: np.ndarray, spare: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of strips between two rows (n, 3) each, and the strip of each.

    The upper row goes on by `spare` (n,) points along the side, from its point `end` (n,). The last piece of the lower
    row then comes last: the others would have no area beside its end, which is on the side, too.
    """

    def above(strip: np.ndarray, j: np.ndarray) -> np.ndarray:
        last = upper[strip, 2]
        beyond = points.number(side[strip], end[strip] + np.maximum(j - last, 0))
        return np.where(j > last, beyond, points.number(upper[strip], np.minimum(j, last)))

    strip, i = _each(lower[:, 2])
    k, n, last = lower[strip, 2], upper[strip, 2] + spare[strip], spare[strip] > 0
    before = np.where(last & (i == k - 1), n, -((k - (2 * i + 1) * n) // (2 * k)))  # pieces by their middles
    low = np.stack([points.number(lower[strip], i), points.number(lower[strip], i + 1), above(strip, before)], axis=1)
    other, j = _each(upper[:, 2] + spare)
    k, n, last = lower[other, 2], upper[other, 2] + spare[other], spare[other] > 0
    before = np.minimum(((2 * j + 1) * k + n) // (2 * n), k - last)
    high = np.stack([above(other, j + 1), above(other, j), points.number(lower[other], before)], axis=1)
    return np.concatenate([low, high]), np.concatenate([strip, other])


def _each(count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return so many (n,) pieces of each row, one after the other: the row (k,), and which of its pieces it is."""
    row = np.repeat(np.arange(len(count)), count)
    return row, np.arange(len(row)) - (np.cumsum(count) - count)[row]
