"""Fit the edges of a simplified ring to the traced ring."""

from __future__ import annotations

import numpy as np
import shapely
from scipy import sparse
from scipy.sparse.linalg import spsolve

from pipeline.types import Points2

_GAUSS = 1 / np.sqrt(3.0)  # two points integrate a squared distance exactly
_ROUNDS = 3
_HELD_M = 0.02  # weight of a vertex's place before, as metres of wall; without it collinear edges leave it free


def fit_edges(traced: Points2, kept: Points2, tolerance_m: float) -> Points2:
    """Fit a line to each edge's stretch of the traced wall and move each vertex to where two lines meet.

    Douglas-Peucker keeps the extreme points of a ragged wall, so a long edge runs along the wall's fringe and not along
    its middle. A vertex moves at most by the tolerance, and only if the traced vertices of its two edges stay within
    the tolerance of those edges.

    Parameters
    ----------
    traced : (n, 2) float64, m
        Closed ring: the last point repeats the first.
    kept : (k, 2) float64, m
        Closed ring of points that Douglas-Peucker kept of `traced`, in the same order.
    tolerance_m : float

    Returns
    -------
    (k, 2) float64, m
        Closed ring.
    """
    runs = _runs(traced, kept)
    lines = [_fit_line(run) for run in runs]
    corners = kept[:-1]
    moved = np.array([_intersection(lines[i - 1], lines[i], corners[i], tolerance_m) for i in range(len(corners))])
    following = np.roll(np.arange(len(corners)), -1)
    while True:
        ends = [i for i, run in enumerate(runs) if _max_distance(run, moved[i], moved[following[i]]) > tolerance_m]
        ends += [int(following[i]) for i in ends]
        # An edge too far from its stretch gets its old vertices back.
        restored = [i for i in ends if not np.array_equal(moved[i], corners[i])]
        if not restored:
            return np.vstack([moved, moved[:1]])
        moved[restored] = corners[restored]


def _runs(traced: Points2, kept: Points2) -> list[Points2]:
    """Return the stretch of the traced ring that each edge of the kept ring replaces."""
    place = {xy.tobytes(): i for i, xy in enumerate(traced[:-1])}
    at = [place[xy.tobytes()] for xy in kept[:-1]]
    n = len(traced) - 1
    return [traced[:-1][(a + np.arange((b - a) % n + 1)) % n] for a, b in zip(at, [*at[1:], at[0]], strict=True)]


def _fit_line(run: Points2) -> tuple[np.ndarray, np.ndarray]:
    """Return a point and the unit direction of the line fitted to a polyline, weighted by length."""
    step = np.diff(run, axis=0)
    weight = np.linalg.norm(step, axis=1)
    middle = (run[:-1] + run[1:]) / 2
    centre = weight @ middle / weight.sum()
    off = middle - centre
    # Second moment of the segments, not only of their midpoints.
    moment = (
        weight[:, None, None] * (off[:, :, None] * off[:, None, :] + step[:, :, None] * step[:, None, :] / 12)
    ).sum(0)
    return centre, np.linalg.eigh(moment)[1][:, 1]


def _intersection(one: tuple, two: tuple, corner: np.ndarray, tolerance_m: float) -> np.ndarray:
    (p, u), (q, v) = one, two
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.05:  # the intersection of nearly parallel lines is ill-conditioned
        return corner
    t = ((q[0] - p[0]) * v[1] - (q[1] - p[1]) * v[0]) / cross
    place = p + t * u
    return place if np.linalg.norm(place - corner) <= tolerance_m else corner


def _max_distance(run: Points2, start: np.ndarray, end: np.ndarray) -> float:
    return float(shapely.distance(shapely.points(run), shapely.LineString([start, end])).max())


def fit_vertices(traced: Points2, at: np.ndarray, most_m: float) -> Points2:
    """Move the vertices of a ring so that the squared distance of the traced wall from its edges is least.

    Parameters
    ----------
    traced : (n, 2) float64, m
        Closed ring.
    at : (k + 1,) int
        Points of `traced` at which the vertices start: increasing, the first is 0, the last n - 1.
    most_m : float
        A vertex that would move farther stays, and so do both vertices of an edge that would be farther from the wall.

    Returns
    -------
    (k + 1, 2) float64, m
        Closed ring.
    """
    points, weight, first, last = _gauss_points(traced, at)
    start = vertices = traced[at[:-1]]
    for _ in range(_ROUNDS):
        vertices = _least_squares(points, weight, first, last, vertices)
    kept = np.linalg.norm(vertices - start, axis=1) > most_m
    while True:
        vertices = np.where(kept[:, None], start, vertices)
        ring = np.vstack([vertices, vertices[:1]])
        far = largest_distances(traced, at, ring) > most_m
        restored = ~kept & (far | np.roll(far, 1))
        if not restored.any():
            return ring
        kept |= restored


def edge_distances(traced: Points2, at: np.ndarray, ring: Points2) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances (2 (n - 1),) m of the traced wall from the edges that replace it, and the edge of each.

    They are taken at the two Gauss points of each segment of the wall.
    """
    points, _, first, _ = _gauss_points(traced, at)
    start, end = ring[first], ring[first + 1]
    _, share = _edge_frame(points, start, end)
    return np.linalg.norm(points - start - share[:, None] * (end - start), axis=1), first


def largest_distances(traced: Points2, at: np.ndarray, ring: Points2) -> np.ndarray:
    """Return the largest distance (k,) m of the traced wall from each edge of the ring (k + 1, 2)."""
    off, edge = edge_distances(traced, at, ring)
    return np.maximum.reduceat(off, np.searchsorted(edge, np.arange(len(at) - 1)))


def _gauss_points(traced: Points2, at: np.ndarray) -> tuple[Points2, np.ndarray, np.ndarray, np.ndarray]:
    """Return two points on each segment of the wall, their weights, m, and the two vertices of the edge of each."""
    middle, half = (traced[:-1] + traced[1:]) / 2, np.diff(traced, axis=0) / 2
    points = np.stack([middle - half * _GAUSS, middle + half * _GAUSS], axis=1).reshape(-1, 2)
    first = np.repeat(np.searchsorted(at, np.arange(len(middle)), side="right") - 1, 2)
    return points, np.repeat(np.linalg.norm(half, axis=1), 2), first, (first + 1) % (len(at) - 1)


def _least_squares(
    points: Points2, weight: np.ndarray, first: np.ndarray, last: np.ndarray, vertices: Points2
) -> Points2:
    """Solve for the vertices (k, 2) with the points' places along their edges and the edges' normals held."""
    normal, share = _edge_frame(points, vertices[first], vertices[last])
    root = np.sqrt(weight)[:, None]
    values = np.concatenate(
        [(root * (1 - share)[:, None] * normal).T.ravel(), (root * share[:, None] * normal).T.ravel()]
    )
    row = np.tile(np.arange(len(points)), 4)
    column = np.concatenate([2 * first, 2 * first + 1, 2 * last, 2 * last + 1])
    matrix = sparse.csr_matrix((values, (row, column)), shape=(len(points), vertices.size))
    right = root[:, 0] * (normal * points).sum(axis=1)
    held = _HELD_M * sparse.identity(vertices.size)
    return spsolve((matrix.T @ matrix + held).tocsc(), matrix.T @ right + _HELD_M * vertices.ravel()).reshape(-1, 2)


def _edge_frame(points: Points2, start: Points2, end: Points2) -> tuple[Points2, np.ndarray]:
    """Return the unit normal (n, 2) of each point's edge, and the share (n,) of the edge before the point."""
    step = end - start
    squared = np.maximum((step**2).sum(axis=1), 1e-18)
    normal = np.column_stack([-step[:, 1], step[:, 0]]) / np.sqrt(squared)[:, None]
    return normal, np.clip(((points - start) * step).sum(axis=1) / squared, 0, 1)
