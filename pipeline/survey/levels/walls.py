"""Walls of a vector file in three dimensions, with their layers."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from networkx.utils import UnionFind
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from minesurveys.coordinates.stray_heights import require_elevations
from minesurveys.errors import InputError, one_line
from minesurveys.frames import Georeference
from minesurveys.vector.shapes import Shapes
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules

_PLUMB_M = 0.05  # a line no longer than this in plan is a shaft
_STEEPEST_FLOOR = 0.577  # 30 deg: nobody draws both walls of a steeper ramp; a vehicle climbs 20 deg at most
_BESIDE_M = 10.0  # between the open wall strings of one drift
_ALIKE = 0.5  # of the heights that two strings cover, that both must cover to be of one drift
SAME_M = 0.05  # ends so near are one
_STEP_M = 0.5  # of the points at which a wall's height is looked up
Wall = np.ndarray  # (k, 3) m


def walls_in_space(
    path: Path,
    content: Shapes,
    moved: list[BaseGeometry],
    georeference: Georeference,
    elevations_m: dict[str, float] | None,
    is_checked: bool = True,
    rules: FloorRules = FLOOR_RULES,
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
    is_checked : bool
        Whether an elevation of 0 may be a missing one.

    Raises
    ------
    InputError
        If a layer is stated that the file does not have, or an elevation of 0 is a missing one.
    """
    stated, step = elevations_m or {}, rules.flat_step_m
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
    if is_checked:
        require_elevations(path, np.concatenate([wall for wall, _ in found]), "walls")
    return found, sorted(left_out)


def lie_over(walls: list[tuple[Wall, str]], rules: FloorRules = FLOOR_RULES) -> bool:
    """Return whether a wall lies over another: in a square of a metre, heights differ by more than `flat_step_m`."""
    points = np.concatenate([sampled(wall) for wall, _ in walls])
    _, cell = np.unique(np.floor(points[:, :2]), axis=0, return_inverse=True)
    low, high = np.full(cell.max() + 1, np.inf), np.full(cell.max() + 1, -np.inf)
    np.minimum.at(low, cell.ravel(), points[:, 2])
    np.maximum.at(high, cell.ravel(), points[:, 2])
    return bool((high - low > rules.flat_step_m).any())


def sampled(wall: Wall) -> np.ndarray:
    """Return points (k, 3) m along a wall, no more than half a metre apart."""
    return np.asarray(shapely.get_coordinates(shapely.segmentize(LineString(wall), _STEP_M), include_z=True))


def split_steep(
    walls: list[tuple[Wall, str]], rules: FloorRules = FLOOR_RULES
) -> tuple[list[tuple[Wall, str]], list[Wall]]:
    """Return the walls of layers, and apart from them the axes of shafts and raises, their upper end first.

    Two lines of one layer beside each other that are less steep than a floor may be are the walls of a ramp.
    """
    rest: list[tuple[Wall, str]] = []
    axes: list[Wall] = []
    flatter: list[tuple[Wall, str]] = []
    for wall, layer in walls:
        axis = axis_of(wall, rules)
        if axis is None:
            rest.append((wall, layer))
        elif _grade(axis) < _STEEPEST_FLOOR:
            flatter.append((wall, layer))
        else:
            axes.append(axis)
    for cluster in beside_each_other(flatter, rules):
        alone = axis_of(cluster[0][0], rules) if len(cluster) == 1 else None
        if alone is None:
            rest += cluster
        else:
            axes.append(alone)
    distinct: dict[tuple[float, ...], Wall] = {}  # drawings often hold a line twice
    for axis in axes:
        distinct.setdefault(tuple(axis.round(1).ravel().tolist()), axis)
    return rest, list(distinct.values())


def axis_of(line: Wall, rules: FloorRules = FLOOR_RULES) -> Wall | None:
    """Return the way (k, 3) m of the shaft whose axis a line is, its upper end first; None if it is a wall.

    The axis of a shaft is plumb, or falls by more than `flat_step_m` and is nowhere flat enough to drive, but for what
    leads to its ends and is no longer than it.
    """
    if np.ptp(line[:, :2], axis=0).max() <= _PLUMB_M:
        return line[[line[:, 2].argmax(), line[:, 2].argmin()]]
    line = line[np.append(True, np.diff(line, axis=0).any(axis=1))]
    steps = np.diff(line, axis=0)
    steep = np.flatnonzero(_is_steep(steps, rules))
    if not len(steep):
        return None
    steps = steps[steep[0] : steep[-1] + 1]
    falls = -steps[:, 2] if steps[:, 2].sum() < 0 else steps[:, 2]
    axis = line[steep[0] : steep[-1] + 2]
    is_one = _is_steep(steps, rules).all() and (falls > 0).all() and falls.sum() > rules.flat_step_m
    if not is_one or _length(axis) < _length(line) / 2:
        return None
    return axis if axis[0, 2] > axis[-1, 2] else axis[::-1]


def is_steep_in_part(wall: Wall, rules: FloorRules = FLOOR_RULES) -> bool:
    """Return whether a line falls by more than `flat_step_m` along shots too steep to drive."""
    steps = np.diff(wall, axis=0)
    return bool(np.abs(steps[_is_steep(steps, rules), 2]).sum() > rules.flat_step_m)


def falls(wall: Wall, rules: FloorRules = FLOOR_RULES) -> bool:
    """Return whether a line is no wall of a level: its points differ by more than `flat_step_m` in height."""
    return bool(np.ptp(wall[:, 2]) > rules.flat_step_m)


def _is_steep(steps: np.ndarray, rules: FloorRules) -> np.ndarray:
    """Return whether each step (k, 3) m is too steep to drive."""
    return np.asarray(np.abs(steps[:, 2]) > rules.steepest_grade * np.hypot(*steps[:, :2].T))


def _grade(axis: Wall) -> float:
    run = np.linalg.norm(np.diff(axis[:, :2], axis=0), axis=1).sum()
    return float((axis[0, 2] - axis[-1, 2]) / max(run, 1e-9))


def _length(line: Wall) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def beside_each_other(strings: list[tuple[Wall, str]], rules: FloorRules = FLOOR_RULES) -> list[list[tuple[Wall, str]]]:
    """Return open walls by the drifts that they are of: near each other in one layer, at like heights."""
    groups: UnionFind = UnionFind(range(len(strings)))
    lines = [LineString(wall[:, :2]) for wall, _ in strings]
    margin = rules.flat_step_m / 2
    spans = [(wall[:, 2].min() - margin, wall[:, 2].max() + margin) for wall, _ in strings]
    pairs = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=_BESIDE_M).T if lines else []
    for a, b in pairs:
        if a >= b or strings[a][1] != strings[b][1]:
            continue
        (low, high), (bottom, top) = spans[a], spans[b]
        common = min(high, top) - max(low, bottom)
        ends = [strings[k][0][[0, -1]] for k in (a, b)]
        apart = np.linalg.norm(ends[0][:, None] - ends[1][None], axis=2).min()
        if common >= _ALIKE * max(high - low, top - bottom) or apart <= SAME_M:
            groups.union(int(a), int(b))
    found = defaultdict(list)
    for number, string in enumerate(strings):
        found[groups[number]].append(string)
    return list(found.values())
