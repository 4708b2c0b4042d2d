"""Thin a polygon on a grid; the skeleton is a graph of pixels."""

from __future__ import annotations

import networkx as nx
import numpy as np
import shapely
from shapely import Polygon
from skimage.morphology import skeletonize

from pipeline.geometry.rasterize import fill_polygon
from pipeline.geometry.runs import connected_runs
from pipeline.types import Frame, Mask


def thin_polygon(free: Polygon, cell_m: float) -> tuple[nx.Graph, Frame]:
    """Rasterise and thin a polygon, m; return the skeleton's pixels (row, column) as a graph, and the grid.

    References
    ----------
    Lee, Kashyap & Chu 1994, doi:10.1006/cgip.1994.1042 (by scikit-image; it keeps holes and components, which the
    method of Zhang and Suen does not always)
    """
    west, south, east, north = free.bounds
    width, height = (int(np.ceil(size / cell_m)) + 4 for size in (east - west, north - south))
    frame = Frame(1.0 / cell_m, 2.0 - west / cell_m, height - 2.0 + south / cell_m, width, height)
    cells = _without_tips(fill_polygon(free, frame), free, frame)
    return _pixel_graph(_with_neighbour(skeletonize(cells, method="lee") > 0, cells)), frame


def _with_neighbour(skeleton: Mask, cells: Mask) -> Mask:
    """Add a free neighbour to a skeleton of one cell: a square or round room then has a leg, one cell long."""
    if np.count_nonzero(skeleton) != 1:
        return skeleton
    row, col = np.argwhere(skeleton)[0]
    sides = [(row, col + 1), (row + 1, col), (row, col - 1), (row - 1, col)]
    skeleton[next((side for side in sides if cells[side]), (row, col))] = True
    return skeleton


def _without_tips(cells: Mask, free: Polygon, frame: Frame) -> Mask:
    """Mark as free the cells of rock cut off from their pillar: its sharp tip is not a second island."""
    rock = connected_runs(~cells)
    if rock.parts == len(free.interiors) + 1:
        return cells
    places = frame.to_mine(np.column_stack([rock.start, rock.row])[rock.first] + 0.5)
    part, pillar = shapely.STRtree([Polygon(ring) for ring in free.interiors]).query(shapely.points(places), "within")
    pillar_of = np.zeros(rock.parts, int)  # 0 is the rock outside
    pillar_of[part] = pillar + 1
    by_size, whole = np.argsort(rock.sizes, kind="stable"), np.full(len(free.interiors) + 1, -1)
    whole[pillar_of[by_size]] = by_size  # the largest piece of each stays
    for run in np.flatnonzero(~np.isin(rock.part, whole)).tolist():
        cells[rock.row[run], rock.start[run] : rock.stop[run]] = True
    return cells


def _pixel_graph(skeleton: Mask) -> nx.Graph:
    """Connect neighbouring skeleton pixels; diagonally only if no two orthogonal steps connect them.

    Thinning can leave a square of four pixels where drifts cross. It is no loop, so one of its four edges is left out.
    """
    graph: nx.Graph = nx.Graph()
    cells = {(int(r), int(c)) for r, c in np.argwhere(skeleton)}
    graph.add_nodes_from(sorted(cells))
    for r, c in sorted(cells):
        for dr, dc in ((0, 1), (1, 0)):
            if (r + dr, c + dc) in cells and not (dc and {(r - 1, c), (r - 1, c + 1)} <= cells):
                graph.add_edge((r, c), (r + dr, c + dc))
        for dc in (-1, 1):
            if (r + 1, c + dc) in cells and (r + 1, c) not in cells and (r, c + dc) not in cells:
                graph.add_edge((r, c), (r + 1, c + dc))
    return graph
