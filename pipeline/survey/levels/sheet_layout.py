"""Which pieces of a mine with heights are one sheet, and where its sheets lie in the plan."""

from __future__ import annotations

from collections import deque

import networkx as nx
import numpy as np
from shapely import Polygon

APART_M = 2.3  # workings of different heights that are nearer than this in plan belong to different sheets
_GRID_M, _GAP_M = 10.0, 12.0  # offsets are whole numbers of cells of any grid; between sheets in plan
_ROW_M = 2000.0  # sheets lie in one row if it is no longer


def assign_sheets(graph: nx.Graph, units: dict[str, str], conflicts: dict[str, set[str]]) -> dict[str, int]:
    """Return the sheet of each cell; a sheet grows along the legs while nothing in it conflicts."""
    joined: nx.Graph = nx.Graph()
    joined.add_nodes_from(dict.fromkeys(units.values()))
    joined.add_edges_from((units[a], units[b]) for a, b in graph.edges if units[a] != units[b])
    sheet: dict[str, int] = {}
    starts = deque([next(iter(joined))])
    while starts:
        start = starts.popleft()
        if start in sheet:
            continue
        number = len(set(sheet.values()))
        sheet[start], barred, edge = number, set(conflicts[start]), deque([start])
        while edge:
            for unit in joined[edge.popleft()]:
                if unit in sheet:
                    continue
                if unit in barred:
                    starts.append(unit)
                    continue
                sheet[unit] = number
                barred |= conflicts[unit]
                edge.append(unit)
    return {node: sheet[unit] for node, unit in units.items()}


def lay_apart(polygons: list[Polygon]) -> np.ndarray:
    """Return how far (sheets, 2) m each sheet is moved aside, so that all lie side by side, in rows if there are many.

    The first row has the sheets at their northings; rows lie from the south, and in a row sheets lie from the west.
    """
    boxes = np.array([polygon.bounds for polygon in polygons])
    wide, high = (boxes[:, 2:] - boxes[:, :2] + _GAP_M).T
    longest = max(_ROW_M, float(wide.max()), float(np.sqrt((wide * high).sum())))
    offsets = np.zeros((len(polygons), 2))
    start, base, east, north = boxes[0, 0], -np.inf, boxes[0, 2], boxes[0, 3]
    for k, (west, south, own_east, own_north) in enumerate(boxes[1:].tolist(), start=1):
        if east + wide[k] - start > longest:
            base, east = north + _GAP_M, start - _GAP_M
        offsets[k, 0] = np.ceil((east + _GAP_M - west) / _GRID_M) * _GRID_M
        offsets[k, 1] = np.ceil((base - south) / _GRID_M) * _GRID_M if np.isfinite(base) else 0.0
        east = own_east + offsets[k, 0]
        north = max(north, own_north + offsets[k, 1])
    return offsets
