"""The occupancy of a map's cells by its picture, as Nav2's map_server computes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Mode = Literal["trinary", "scale", "raw"]
_STRIP_ROWS = 512  # so that a map of 100 megapixels needs little memory beside its picture
_RAW_WHITE = 255  # the scale of cells in the mode raw
_FREE, _OCCUPIED, _UNKNOWN = 0, 100, -1


@dataclass(frozen=True)
class CellRules:
    """How a map's file says that shades are read."""

    mode: Mode
    negate: bool
    free_thresh: float
    occupied_thresh: float


def occupancy_of(pixels: np.ndarray, rules: CellRules) -> np.ndarray:
    """Return the occupancy of each pixel: 0 free to 100 occupied, -1 unknown.

    A shade is the mean of the colours. Opacity counts as a fourth colour in the mode trinary; in the mode scale a cell
    that is not opaque is unknown; the mode raw does not look at it.

    Parameters
    ----------
    pixels : (rows, cols) or (rows, cols, 3 or 4) uint8 or uint16
        Grey, or colours and opacity.
    rules : CellRules

    Returns
    -------
    (rows, cols) int8

    References
    ----------
    Nav2 map_server, `loadMapFromFile` in `map_io.cpp`
    """
    found = np.empty(pixels.shape[:2], np.int8)
    for row in range(0, len(found), _STRIP_ROWS):
        strip = pixels[row : row + _STRIP_ROWS]
        strip = strip[..., None] if strip.ndim == 2 else strip
        colours = strip if rules.mode == "trinary" else strip[..., :3]
        white = int(np.iinfo(strip.dtype).max)
        cells = _by_level(rules, colours.shape[2] * white)[colours.sum(axis=2, dtype=np.uint32)]
        if rules.mode == "scale" and strip.shape[2] == 4:
            cells[strip[..., 3] < white] = _UNKNOWN
        found[row : row + _STRIP_ROWS] = cells
    return found


def _by_level(rules: CellRules, most: int) -> np.ndarray:
    """Return the occupancy (most + 1,) of each sum of colours up to `most`, which is white."""
    shade = np.arange(most + 1) / most
    if rules.mode == "raw":
        value = np.rint(shade * _RAW_WHITE)
        return np.where(value <= _OCCUPIED, value, _UNKNOWN).astype(np.int8)
    share = shade if rules.negate else 1.0 - shade
    between = np.full(most + 1, float(_UNKNOWN))
    if rules.mode == "scale" and rules.free_thresh < rules.occupied_thresh:
        between = np.rint((share - rules.free_thresh) / (rules.occupied_thresh - rules.free_thresh) * _OCCUPIED)
    cells = np.where(share > rules.occupied_thresh, _OCCUPIED, np.where(share < rules.free_thresh, _FREE, between))
    return cells.astype(np.int8)
