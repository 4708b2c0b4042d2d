"""Maps of a volume world: an octree of all free space, and a Nav2 map of each storey."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from minexplore.bundle import storey_map
from minexplore.floors.volume_arrays import FloorSpans
from pipeline.geometry.maps.nav2 import nav2_files
from pipeline.geometry.maps.octree import Columns, build_octree, to_bt
from pipeline.store.codecs import Bundle, encode

_LEAST_M2 = 4.0  # of a storey that gets a map: a coverage cell's area
_MOST = 100  # maps


def octree_of(cells: FloorSpans) -> bytes:
    """Return the octree of all spans as OctoMap's `.bt`."""
    at = np.column_stack([cells.row, cells.column]).astype(np.int64)
    columns = Columns.of_cells(at, cells.origin_m, cells.cell_m, cells.headroom_m, cells.floor_m)
    return to_bt(build_octree(columns, cells.cell_m))


def storey_maps(cells: FloorSpans) -> Bundle:
    """Return the files of a Nav2 map of each storey of 4 m2 and more, at most 100, the largest first.

    A remark in a map's YAML file states the lowest and the highest place of the storey's floor.
    """
    files: Bundle = {}
    for storey, text, pixels in drawn_maps(cells):
        name, picture = storey_map(storey)
        files |= {name: text, picture: encode(Path(picture), pixels)}
    return files


def drawn_maps(cells: FloorSpans) -> Iterator[tuple[int, bytes, np.ndarray]]:
    """Yield the number, the YAML text and the pixels (rows, cols) uint8 of each map of `storey_maps`."""
    counts = np.bincount(cells.storey[cells.storey >= 0])
    for storey in np.flatnonzero(counts * cells.cell_m**2 >= _LEAST_M2)[:_MOST].tolist():
        own = cells.storey == storey
        at = np.column_stack([cells.column[own], cells.row[own]]).astype(np.int64)
        first, end = at.min(axis=0) - 1, at.max(axis=0) + 2
        free = np.zeros((end - first)[::-1], bool)
        free[tuple((at - first)[:, ::-1].T)] = True
        picture = storey_map(storey)[1]
        pixels, text = nav2_files(free, cells.origin_m + first * cells.cell_m, cells.cell_m, picture)
        low, high = cells.floor_m[own].min(), cells.floor_m[own].max()
        yield storey, f"# storey {storey}: floor {low:.3f} to {high:.3f} m high\n{text}".encode(), pixels
