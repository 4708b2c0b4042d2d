"""The floor's mesh of a world with heights: `floor.npz` holds sheets of triangles that fit together edge to edge."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from minexplore.bundle import FLOOR, RECORD, BundleError, has_heights
from minexplore.floors.floor import Floor
from minexplore.floors.stretch import KNEE_M, MOST_ROOF_M, least_roof_m, raise_m, stretch_of
from minexplore.schema.model import REACH_M
from minexplore.schema.openings import check_openings
from minexplore.schema.readers.arrays import read_arrays

MOST_FACES = 1_000_000
_ARRAYS = {"vertices": ("<f8", 2), "faces": ("<i4", 2), "sheet": ("<i4", 1), "offset_m": ("<f8", 2)}
_STRETCH = {"stretch": ("<f8", 1)}  # only where the roof has heights of its own
_LEAST_M2 = 1e-10  # twice a face's area; the thinnest faces of surveyed mines have 1e-7
_ROUND = 1e-9
_ROOF_M = 1.5e-6  # the record has six decimals
_STEEP_DEG = 0.01  # the record has three decimals, and thin faces are rounded differently on another machine


def read_floor(record: Mapping[str, Any], files: Mapping[str, bytes]) -> Floor:
    """Return the floor of a world, one without triangles where the record states no heights.

    Raises
    ------
    BundleError
        If the file is missing or not expected, or no floor that a builder writes.
    """
    if has_heights(record) != (FLOOR in files):
        raise BundleError(f"{FLOOR}: {'missing' if has_heights(record) else f'{RECORD} states no heights'}")
    if not has_heights(record):
        return Floor()
    arrays = read_arrays(FLOOR, files[FLOOR], _ARRAYS | _STRETCH, 3 * MOST_FACES, frozenset(_STRETCH))
    floor = Floor(**arrays)
    _check_arrays(floor, record)
    _check_edges(floor)
    _check_sheets(floor)
    _check_figures(floor, record)
    _check_roof(floor, record, "stretch" in arrays)
    check_openings(record, floor)
    return floor


def _check_arrays(floor: Floor, record: Mapping[str, Any]) -> None:
    west, south, east, north = record["world_m"]
    vertices, faces, sheet, offset = floor.vertices, floor.faces, floor.sheet, floor.offset_m
    if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,) or offset.shape != (record["heights"]["sheets"], 2):
        raise BundleError(
            f"{FLOOR}: shapes {vertices.shape}, {faces.shape} and {offset.shape}: want 3, 3 and sheets x 2"
        )
    if not len(faces) or len(sheet) != len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        raise BundleError(f"{FLOOR}: no faces, a face of a vertex that is not there, or one without its sheet")
    if not (np.abs(offset) <= REACH_M).all() or offset[0].any():
        raise BundleError(f"{FLOOR}: an offset that is not finite, beyond {REACH_M:g} m, or of the first sheet")
    low, high = np.array([west, south, -REACH_M]), np.array([east, north, REACH_M])
    if not ((vertices >= low) & (vertices <= high)).all():
        raise BundleError(f"{FLOOR}: a corner outside world_m = {record['world_m']}")
    u, v = (vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2))
    if not (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] >= _LEAST_M2).all():
        raise BundleError(f"{FLOOR}: a face that is not counter-clockwise in plan, or has no area")


def _check_edges(floor: Floor) -> None:
    """Check that an edge has one face on a side, and that each corner has faces and is on one ring of the boundary."""
    faces, count = floor.faces.astype(np.int64), len(floor.vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    own, turned = (edges[:, k] * count + edges[:, 1 - k] for k in (0, 1))
    if len(np.unique(own)) != len(own):
        raise BundleError(f"{FLOOR}: an edge with two faces on one side")
    alone = edges[~np.isin(own, turned), 0]
    if len(np.unique(alone)) != len(alone):
        raise BundleError(f"{FLOOR}: a corner at which the boundary meets itself")
    if len(np.unique(faces)) != count:
        raise BundleError(f"{FLOOR}: a corner without a face")


def _check_sheets(floor: Floor) -> None:
    """Check that all sheets have faces, and lie side by side in plan: in rows from the south, each from the west."""
    sheets = len(floor.offset_m)
    if not np.array_equal(np.unique(floor.sheet), np.arange(sheets)):
        raise BundleError(f"{FLOOR}: a sheet that is not there, or has no faces; {RECORD} states {sheets}")
    low, high = floor.boxes_m
    for one, two in pairwise(floor.rows):
        if not low[list(two), 1].min() > high[list(one), 1].max():
            raise BundleError(f"{FLOOR}: a sheet that is neither east of the one before it nor north of its row")


def _check_figures(floor: Floor, record: Mapping[str, Any]) -> None:
    heights = record["heights"]
    found = float(floor.vertices[:, 2].min()), float(floor.vertices[:, 2].max())
    if np.abs(np.subtract(found, (heights["low_m"], heights["high_m"]))).max() > 1e-9:
        raise BundleError(
            f"{RECORD}: heights.low_m, high_m = {heights['low_m']}, {heights['high_m']}: {FLOOR} has {found}"
        )
    steepest = float(floor.steepness_deg().max())
    if not abs(steepest - heights["steepest_deg"]) <= _STEEP_DEG:
        raise BundleError(f"{RECORD}: heights.steepest_deg = {heights['steepest_deg']}: {FLOOR} has {steepest:.3f}")


def _check_roof(floor: Floor, record: Mapping[str, Any], has_roof: bool) -> None:
    """Check that the roof has heights of its own where the record states them, in range, and no step at seams."""
    stated, height_m = record["heights"].get("roof_m"), record["height_m"]
    if (stated is not None) != has_roof:
        raise BundleError(
            f"{RECORD}: heights.roof_m {'missing' if has_roof else f'= {stated}'}: {FLOOR} has "
            f"{'a' if has_roof else 'no'} stretch"
        )
    if stated is None:
        return
    if height_m <= KNEE_M or floor.stretch.shape != (len(floor.vertices),):
        raise BundleError(
            f"{FLOOR}: stretch has shape {floor.stretch.shape} for {len(floor.vertices)} vertices; want one a vertex, "
            f"and height_m = {height_m:g} above {KNEE_M:g}"
        )
    least, most = stretch_of(np.array([least_roof_m(height_m), MOST_ROOF_M]), height_m).tolist()
    if not ((floor.stretch >= least - _ROUND) & (floor.stretch <= most + _ROUND)).all():
        raise BundleError(f"{FLOOR}: a stretch that is no number from {least:g} to {most:g}")
    order = np.argsort(floor._joined, kind="stable")
    same = np.diff(floor._joined[order]) == 0
    if np.abs(np.diff(floor.stretch[order]))[same].max(initial=0.0) > _ROUND:
        raise BundleError(f"{FLOOR}: two stretches at one place of a seam: the roof would have a step")
    roof_m = raise_m(height_m, floor.stretch)
    found = round(float(roof_m.min()), 6), round(float(roof_m.max()), 6)
    if np.abs(np.subtract(stated, found)).max() > _ROOF_M:
        raise BundleError(f"{RECORD}: heights.roof_m = {stated}: {FLOOR} has {list(found)}")
