"""Shafts and raises of a drawing as legs of a survey: from the floor at their upper end to that at their lower end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from minesurveys.errors import NAMED
from minesurveys.remarks import warn_user
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.levels.walls import Wall
from pipeline.types import FloorMesh, SurveyedLegs, text_array

_HALF_M = 0.5  # of the height of a shaft's section at its ends
_OVER_FLOOR_M = 0.1  # of that section, so that the floor stays whole under a shaft
_DRIFT_M = 3.5  # height of a drift: an end of a shaft so far over a floor is in it


def shaft_legs(path: Path, axes: list[Wall], floors: FloorMesh, rules: FloorRules = FLOOR_RULES) -> SurveyedLegs | None:
    """Return a leg for each shaft, None if there is none; those that reach no floor are left out, with a warning.

    Parameters
    ----------
    path : Path
    axes : list of (k, 3) m
        From the upper to the lower end; elevations.
    floors : FloorMesh
    """
    legs, left_out = [], []
    tree = shapely.STRtree(shapely.polygons(floors.vertices[floors.faces][:, :, :2]))
    for axis in axes:
        way = axis - np.array([0.0, 0.0, floors.datum_m])
        ends = [_floor_at(floors, tree, way[k], rules) for k in (0, -1)]
        if all(end is None for end in ends) and not _passes(floors, tree, way):
            left_out.append(f"({axis[0, 0]:.1f}, {axis[0, 1]:.1f}) from {axis[0, 2]:.1f} to {axis[-1, 2]:.1f} m")
            continue
        made = way.copy()
        for k, end in zip((0, -1), ends, strict=True):
            if end is not None:
                made[k, 2] = end + _OVER_FLOOR_M + _HALF_M
        if ends[-1] is None:
            made[-1, 2] += _HALF_M
        if made[0, 2] > made[-1, 2]:
            legs.append(made)
    if left_out:
        named = "; ".join(left_out[:NAMED])
        warn_user(f"shafts reach no floor and are left out: {named}", of=path.name, count=len(left_out))
    if not legs:
        return None
    count = [len(leg) for leg in legs]
    names = [f"shaft {k + 1} at {n}" for k, leg in enumerate(legs) for n in range(len(leg))]
    walls = np.tile([np.nan, np.nan, _HALF_M, _HALF_M], (sum(count), 1))
    return SurveyedLegs(
        positions_m=np.concatenate(legs),
        lrud_m=walls,
        first=np.cumsum([0, *count]).astype(np.int32),
        names=text_array(names),
        surveyed_m=0.0,
        datum_m=floors.datum_m,
    )


def _floor_at(floors: FloorMesh, tree: shapely.STRtree, place: np.ndarray, rules: FloorRules) -> float | None:
    """Return the height of the floor that an end of a shaft is on, or in whose drift it is; None if there is none."""
    heights = _heights_at(floors, tree, place)
    over = place[2] - heights
    near = heights[(over >= -rules.flat_step_m) & (over <= _DRIFT_M)]
    return float(near[np.abs(place[2] - near).argmin()]) if len(near) else None


def _passes(floors: FloorMesh, tree: shapely.STRtree, way: np.ndarray) -> bool:
    """Return whether a floor lies between the ends of a way, about a place of it."""
    heights = np.concatenate([_heights_at(floors, tree, place) for place in way])
    return bool(((heights < way[0, 2]) & (heights > way[-1, 2])).any())


def _heights_at(floors: FloorMesh, tree: shapely.STRtree, place: np.ndarray) -> np.ndarray:
    """Return the heights (n,) m of all floors at a place, seen from above."""
    faces = floors.faces[tree.query(shapely.Point(place[:2]), predicate="intersects")]
    a, b, c = np.moveaxis(floors.vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    slope = -normal[:, :2] / np.maximum(normal[:, 2:], 1e-12)
    return np.asarray(a[:, 2] + ((place[:2] - a[:, :2]) * slope).sum(axis=1))
