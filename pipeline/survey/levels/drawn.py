"""Levels of a drawing: walls with elevations enclose areas, which are the floors of one volume."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import NAMED, InputError, one_line
from minesurveys.frames import Georeference
from minesurveys.remarks import warn_user
from minesurveys.vector.shapes import Shapes
from pipeline.params.survey import VectorSurveyParams
from pipeline.survey.levels.areas import areas_of
from pipeline.survey.levels.floors import DrawnLevels, floors_of_areas
from pipeline.survey.levels.walls import lie_over, split_steep, walls_in_space


@dataclass(frozen=True)
class LevelReading:
    """The areas of one volume; None if the walls are those of one plan.

    Then `is_wall` is for each shape whether it is read in that plan: the axes of shafts are not.
    """

    levels: DrawnLevels | None
    is_wall: list[bool]


def read_levels(
    path: Path,
    content: Shapes,
    moved: list[BaseGeometry],
    georeference: Georeference,
    params: VectorSurveyParams,
    elevations: dict[str, float] | None,
) -> LevelReading:
    """Return the levels that walls with elevations enclose; of stated seeds, the walls are read as one plan.

    Parameters
    ----------
    path : Path
    content : Shapes
        As `read_shapes` returns them.
    moved : list of shapely geometry, m, mine frame
        The same shapes in plan, as `locate` returns them.
    georeference : Georeference
    params : VectorSurveyParams
    elevations : dict of str to float, or None
        Of the floors of layers, as `elevations_of` returns them.

    Raises
    ------
    InputError
        If levels over each other enclose no areas of their own, or cannot be joined; the message names the place.
    """
    is_checked = params.no_elevation is None
    found, left_out = walls_in_space(path, content, moved, georeference, elevations, is_checked, params)
    walls, axes = split_steep(found, params)
    if not walls:
        return LevelReading(None, [True] * len(moved))
    if params.seeds_m and lie_over(walls, params):
        raise InputError(f"{path}: survey.seeds_m is not read with levels over each other; --layer chooses walls")
    try:
        areas = [] if params.seeds_m else areas_of(path, walls, params.snap_m, params)
        levels = floors_of_areas(path, areas, axes, params.snap_m, params.piece, params) if areas else None
    except InputError:
        if elevations or lie_over(walls, params):
            raise
        levels = None
    if levels is None and lie_over(walls, params):
        raise InputError(
            f"{path}: walls lie over each other, and enclose no levels of their own; close the walls of each "
            "level, or put each level and each ramp on a layer of its own"
        )
    if left_out:
        names = ", ".join(one_line(layer, 40) or "no name" for layer in left_out[:NAMED])
        done = "are read in plan with the others" if levels is None else "are left out"
        warn_user(
            f"layers without an elevation {done}: {names}",
            of=path.name,
            count=len(left_out),
            option="--elevation",
            advice="--elevation LAYER=M states one",
        )
    if levels is not None or not axes:
        return LevelReading(levels, [True] * len(moved))
    x, y, z = axes[0][0]
    warn_user(
        f"lines too steep to drive are left out, as the walls are read as one plan; the first at ({x:.1f}, "
        f"{y:.1f}) from {z:.1f} to {axes[0][-1, 2]:.1f} m",
        of=path.name,
        count=len(axes),
    )
    steep = {wall[:, :2].tobytes() for wall, _ in found} - {wall[:, :2].tobytes() for wall, _ in walls}
    return LevelReading(None, [shapely.get_coordinates(shape).tobytes() not in steep for shape in moved])
