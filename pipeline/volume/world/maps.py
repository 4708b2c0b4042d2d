"""Maps of a volume world: an octree of all free space, and a Nav2 map of each storey."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minexplore.bundle import storey_map
from pipeline.geometry.maps.nav2 import nav2_files
from pipeline.geometry.maps.octree import build_octree, to_bt
from pipeline.store.codecs import Bundle, encode
from pipeline.volume.world.content import Cells

_LEAST_M2 = 4.0  # of a storey that gets a map: a coverage cell's area
_MOST = 100  # maps


def octree_of(cells: Cells) -> bytes:
    """Return the octree of all spans as OctoMap's `.bt`: the columns' layers are built side by side and moved back."""
    order = np.lexsort((cells.floor_m, cells.row, cells.column))
    column, row = cells.column[order].astype(np.int64), cells.row[order].astype(np.int64)
    begins = np.append(True, (np.diff(column) != 0) | (np.diff(row) != 0))
    starts = np.flatnonzero(begins)
    layer = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    width, height = int(column.max()) + 1, int(row.max()) + 1
    shape = (height, width * (int(layer.max()) + 1))
    free, floor, tall = np.zeros(shape, bool), np.zeros(shape), np.zeros(shape)
    moved = np.zeros((*shape, 2), np.int64)
    at = (row, column + layer * width)
    free[at], floor[at], tall[at] = True, cells.floor_m[order], cells.headroom_m[order]
    moved[at] = np.column_stack([layer * width, np.zeros(len(layer), np.int64)])
    return to_bt(build_octree(free, cells.origin_m, cells.cell_m, tall, floor, moved))


def storey_maps(cells: Cells) -> Bundle:
    """Return the files of a Nav2 map of each storey of 4 m2 and more, at most 100, the largest first.

    A remark in a map's YAML file states the lowest and the highest place of the storey's floor.
    """
    files: Bundle = {}
    counts = np.bincount(cells.storey[cells.storey >= 0])
    for storey in np.flatnonzero(counts * cells.cell_m**2 >= _LEAST_M2)[:_MOST].tolist():
        own = cells.storey == storey
        at = np.column_stack([cells.column[own], cells.row[own]]).astype(np.int64)
        first, end = at.min(axis=0) - 1, at.max(axis=0) + 2
        free = np.zeros((end - first)[::-1], bool)
        free[tuple((at - first)[:, ::-1].T)] = True
        name, picture = storey_map(storey)
        pixels, text = nav2_files(free, cells.origin_m + first * cells.cell_m, cells.cell_m, picture)
        low, high = cells.floor_m[own].min(), cells.floor_m[own].max()
        files[name] = f"# storey {storey}: floor {low:.3f} to {high:.3f} m high\n{text}".encode()
        files[picture] = encode(Path(picture), pixels)
    return files
