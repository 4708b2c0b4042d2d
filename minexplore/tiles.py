"""Square tiles of the plan, which models and scenes of a part of the mine are made by."""

from __future__ import annotations

import math

import numpy as np

Tile = tuple[int, ...]  # column and row, of a cube its layer too


def tiles_at(places_m: np.ndarray, size_m: float) -> np.ndarray:
    """Return the column and row (n, 2) int of the tile under each place (n, 2) m, or the cube (n, 3) about (n, 3)."""
    return np.floor(places_m / size_m).astype(int)


def tile_at(place_m: np.ndarray, size_m: float) -> Tile:
    """Return the tile under one place (2,) m, or the cube about one (3,); see `tiles_at`."""
    return tuple([math.floor(along / size_m) for along in place_m.tolist()])


def group_by_tile(tiles: np.ndarray) -> list[tuple[Tile, np.ndarray]]:
    """Return each tile among rows (n, 2 or 3) with the numbers of its rows, in the order of the tiles."""
    if len(tiles) == 1:  # one robot needs no sorting
        return [(tuple(tiles[0].tolist()), np.zeros(1, dtype=int))]
    order = np.lexsort(tiles.T[::-1])
    ordered = tiles[order]
    borders = (np.flatnonzero((ordered[1:] != ordered[:-1]).any(axis=1)) + 1).tolist()
    firsts = [0, *borders] if len(tiles) else []
    names = map(tuple, ordered[firsts].tolist())
    return [(name, order[a:b]) for name, a, b in zip(names, firsts, [*borders, len(tiles)], strict=False)]
