"""The nearest of many straight edges, for each of many places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.geometry.cells import PlanCells, plan_cells

_CELLS_M = (0.5, 1.0, 2.0)  # the first that places are dense in counts; drifts are a few metres wide
# A search in the tree takes 2 us, a comparison with one edge 0.05 us. Each cell takes two searches.
_DENSE = 4


@dataclass(frozen=True)
class NearestEdges:
    """For each place the index of its nearest edge, and how far it is, m; (n,) each."""

    edge: np.ndarray
    distance_m: np.ndarray


def nearest_edges(edges: np.ndarray, places: np.ndarray) -> NearestEdges:
    """Return the nearest edge of each place.

    Where many places lie close together, as points of a surface do, the edges that may be nearest in a cell are found
    once. The distances have the same bits as those that GEOS computes one by one.

    Parameters
    ----------
    edges : (m, 2, 2) m
        Two ends each; m is at least 1.
    places : (n, 2) m

    Returns
    -------
    NearestEdges
        Of edges that are equally near, any.
    """
    tree = shapely.STRtree(shapely.linestrings(edges))
    for size_m in _CELLS_M:
        cells = plan_cells(places, size_m)
        if len(places) >= _DENSE * len(cells.at):
            cell, edge = _candidates(tree, cells, size_m)
            return _compare(edges, places, cells, edge[np.lexsort((edge, cell))], np.bincount(cell))
    return _search(tree, places)


def _search(tree: shapely.STRtree, places: np.ndarray) -> NearestEdges:
    (place, found), apart = tree.query_nearest(shapely.points(places), return_distance=True, all_matches=False)
    edge, distance_m = np.empty(len(places), dtype=np.int64), np.empty(len(places))
    edge[place], distance_m[place] = found, apart
    return NearestEdges(edge, distance_m)


def _candidates(tree: shapely.STRtree, cells: PlanCells, size_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of cells and the edges that may be nearest to a place in them.

    A place is at most half a diagonal from the centre. So its nearest edge is at most a diagonal farther from the
    centre than the centre's nearest edge.
    """
    centre = (cells.at + 0.5) * size_m
    reach_m = _search(tree, centre).distance_m + 1.0001 * np.sqrt(2) * size_m  # and for rounding
    cell, edge = tree.query(shapely.points(centre), predicate="dwithin", distance=reach_m)
    return cell, edge


def _compare(
    edges: np.ndarray, places: np.ndarray, cells: PlanCells, candidates: np.ndarray, count: np.ndarray
) -> NearestEdges:
    """Return the nearest of the `count` (k,) candidates of each place's cell, which stand one after another."""
    first, many = (np.cumsum(count) - count)[cells.of_place], count[cells.of_place]
    edge = candidates[first]
    distance_m = distances_to_edges(places, edges[edge])
    left, turn = np.flatnonzero(many > 1), 1
    while len(left):
        other = candidates[first[left] + turn]
        apart = distances_to_edges(places[left], edges[other])
        is_nearer = apart < distance_m[left]
        edge[left[is_nearer]], distance_m[left[is_nearer]] = other[is_nearer], apart[is_nearer]
        turn += 1
        left = left[many[left] > turn]
    return NearestEdges(edge, distance_m)


def distances_to_edges(places: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return how far each place (n, 2) is from its edge (n, 2, 2), m, by the terms of GEOS in their order."""
    (px, py), (ax, ay), (bx, by) = places.T, edges[:, 0].T, edges[:, 1].T
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    with np.errstate(invalid="ignore", divide="ignore"):  # of an edge without length, whose first end counts
        share = ((px - ax) * dx + (py - ay) * dy) / squared
        across = np.abs(((ay - py) * dx - (ax - px) * dy) / squared) * np.sqrt(squared)
    from_start = np.sqrt((px - ax) * (px - ax) + (py - ay) * (py - ay))
    from_end = np.sqrt((px - bx) * (px - bx) + (py - by) * (py - by))
    at_end = np.where(share >= 1, from_end, across)
    return np.where((share <= 0) | (squared == 0), from_start, at_end)
