"""Walls of a vector file in three dimensions, with their layers."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.params.reader_limits import reader_limits
from pipeline.survey.child import one_line
from pipeline.survey.shapes import Shapes
from pipeline.survey.stray_heights import require_elevations
from pipeline.types import Georeference

_PLUMB_M = 0.05  # a line no longer than this in plan is a shaft
_STEP_M = 0.5  # of the points at which a wall's height is looked up
Wall = np.ndarray  # (k, 3) m


def walls_in_space(
    path: Path,
    content: Shapes,
    moved: list[BaseGeometry],
    georeference: Georeference,
    elevations_m: dict[str, float] | None,
) -> tuple[list[tuple[Wall, str]], list[str]]:
    """Return the walls of a vector file with their layers, and the layers left out; no walls if all are at one height.

    Parameters
    ----------
    path : Path
    content : Shapes
        As `read_shapes` returns them.
    moved : list of shapely geometry, m, mine frame
        The same shapes in plan, as `locate` returns them.
    georeference : Georeference
    elevations_m : dict of str to float, or None
        Of the floors of layers. Other layers are read if their lines have different elevations, as those of ramps.

    Raises
    ------
    InputError
        If a layer is stated that the file does not have, or an elevation of 0 is a missing one.
    """
    stated, step = elevations_m or {}, reader_limits().flat_step_m
    unknown = sorted(set(stated) - set(content.layer_of))
    if unknown:
        there = ", ".join(one_line(name, 40) for name in dict.fromkeys(content.layer_of)) or "no layers"
        raise InputError(f"{path}: no layer {', '.join(unknown)} to be at an elevation; there are {there}")
    layers = content.layer_of or [""] * len(content.shapes)
    heights = [
        shapely.get_coordinates(shape, include_z=True)[:, 2] * georeference.metres_per_unit for shape in content.shapes
    ]
    of_layer: dict[str, list[np.ndarray]] = defaultdict(list)
    for z, layer in zip(heights, layers, strict=True):
        of_layer[layer].append(z[np.isfinite(z)])
    pooled = {layer: np.concatenate(found) for layer, found in of_layer.items()}
    sloping = {layer for layer, z in pooled.items() if len(z) and np.ptp(z) > step}
    found, left_out = [], set()
    for flat, z, layer in zip(moved, heights, layers, strict=True):
        if layer in stated:
            z = np.full(len(z), stated[layer])
        elif not np.isfinite(z).all() or (stated and layer not in sloping):
            left_out.add(layer)
            continue
        points = np.column_stack([shapely.get_coordinates(flat), z])
        lines = shapely.get_parts(flat.boundary) if flat.geom_type == "Polygon" else shapely.get_parts(flat)
        at = np.cumsum([0, *(shapely.get_num_coordinates(line) for line in lines)]).tolist()
        found += [(points[a:b], layer) for a, b in pairwise(at) if b - a > 1]
    if not found or np.ptp(np.concatenate([wall[:, 2] for wall, _ in found])) <= step:
        return [], []
    require_elevations(path, np.concatenate([wall for wall, _ in found]), "walls")
    return found, sorted(left_out)


def lie_over(walls: list[tuple[Wall, str]]) -> bool:
    """Return whether a wall lies over another: in a square of a metre, heights differ by more than `flat_step_m`."""
    points = np.concatenate([sampled(wall) for wall, _ in walls])
    _, cell = np.unique(np.floor(points[:, :2]), axis=0, return_inverse=True)
    low, high = np.full(cell.max() + 1, np.inf), np.full(cell.max() + 1, -np.inf)
    np.minimum.at(low, cell.ravel(), points[:, 2])
    np.maximum.at(high, cell.ravel(), points[:, 2])
    return bool((high - low > reader_limits().flat_step_m).any())


def sampled(wall: Wall) -> np.ndarray:
    """Return points (k, 3) m along a wall, no more than half a metre apart."""
    return np.asarray(shapely.get_coordinates(shapely.segmentize(LineString(wall), _STEP_M), include_z=True))


def split_plumb(walls: list[tuple[Wall, str]]) -> tuple[list[tuple[Wall, str]], list[Wall]]:
    """Return the walls of layers, and apart from them the lines that are plumb: shafts, their upper end first."""
    rest = []
    plumb: dict[tuple[float, ...], Wall] = {}  # drawings often hold a line twice
    for wall, layer in walls:
        if np.ptp(wall[:, :2], axis=0).max() <= _PLUMB_M:
            ends = wall[[wall[:, 2].argmax(), wall[:, 2].argmin()]]
            plumb.setdefault(tuple(ends.round(1).ravel().tolist()), ends)
        else:
            rest.append((wall, layer))
    return rest, list(plumb.values())
