"""Count the places where walls cross, before a drawing is cut into faces there."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

_BLOCK = 256  # edges compared at once


def count_crossings(shapes: list[BaseGeometry], at_most: int) -> int:
    """Return how many pairs of edges meet other than end to end; counting stops above `at_most`.

    Parameters
    ----------
    shapes : list of shapely geometry
        Lines and polygons. Edges that lie on each other count as a pair.
    at_most : int

    Returns
    -------
    int
    """
    edges, _ = edges_of(_linework(shapes))
    if len(edges) * (len(edges) - 1) // 2 <= at_most:
        return 0
    lines = shapely.linestrings(edges)
    tree, count, start, block = shapely.STRtree(lines), 0, 0, 1
    while start < len(lines):
        one, other = tree.query(lines[start : start + block], predicate="intersects")
        one += start
        start, block = start + block, min(2 * block, _BLOCK)
        later = one < other
        a, b = edges[one[later]], edges[other[later]]
        shared = [(a[:, i, None] == b).all(axis=2).any(axis=1) for i in (0, 1)]
        count += int((shared[0] == shared[1]).sum())  # neighbours in a line share one end
        if count > at_most:
            break
    return count


def edges_of(lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges (n, 2, 2) of lines or rings, without those of no length, and the line (n,) of each edge."""
    places, line = shapely.get_coordinates(lines, return_index=True)
    if len(places) < 2:
        return np.zeros((0, 2, 2)), np.zeros(0, int)
    edges = np.stack([places[:-1], places[1:]], axis=1)
    kept = (line[:-1] == line[1:]) & (edges[:, 0] != edges[:, 1]).any(axis=1)
    return edges[kept], line[:-1][kept]


def _linework(shapes: list[BaseGeometry]) -> np.ndarray:
    parts = shapely.get_parts(shapes)
    kinds = shapely.get_type_id(parts)
    return np.concatenate([parts[np.isin(kinds, (1, 2))], shapely.get_rings(parts[kinds == 3])])
