"""ROS Nav2 maps: an occupancy grid as a picture and the file that places it."""

from __future__ import annotations

import numpy as np

from pipeline.types import Mask


def nav2_files(free: Mask, origin_m: np.ndarray, cell_m: float, picture: str) -> tuple[np.ndarray, str]:
    """Return the pixels (rows, cols) uint8 and the YAML text of a map of free cells.

    Parameters
    ----------
    free : (rows, cols) bool
        Row 0 is in the south.
    origin_m : (2,), m
        South-west corner.
    cell_m : float
    picture : str
        Name of the map's picture.
    """
    pixels = free[::-1] * np.uint8(254)
    west, south = origin_m
    yaml = (
        f"image: {picture}\nmode: trinary\nresolution: {cell_m:.6g}\norigin: [{west:.6f}, {south:.6f}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    return pixels, yaml
