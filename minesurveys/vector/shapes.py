"""Shapes of a vector file, and their conversion to metres in the mine frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.coordinates.local_plan import is_projected, project, turned
from minesurveys.coordinates.map_axes import (
    axes_of,
    coordinate_system,
    require_plane,
    warn_of_heights,
    warn_of_turn,
)
from minesurveys.errors import InputError
from minesurveys.frames import METRES, Georeference
from minesurveys.guard.plain_file import require_at_most
from minesurveys.limits import FILE, reader_limits
from minesurveys.vector.crossings import count_crossings

REACH_M = 10_000.0  # larger coordinates would lose precision in the world's text and its octree
LARGEST = 1e12  # a coordinate in a file: a mine in mm at map coordinates needs 1e10


@dataclass(frozen=True)
class Shapes:
    """Polygons and lines of a file, in its own coordinates. `unit` and `crs` are None if the file names none.

    `layer_of` has the layer of each shape, and is empty if the format has no layers. `others` counts what the file
    holds beside shapes, by its kind. `fields` are the names of the shapes' properties. `is_duplicate` is whether a
    survey's shot was measured before, and is empty if no shape is flagged so.
    """

    shapes: list[BaseGeometry]
    unit: str | None = None
    crs: str | None = None
    layer_of: list[str] = field(default_factory=list)
    others: dict[str, int] = field(default_factory=dict)
    fields: list[str] = field(default_factory=list)
    is_duplicate: list[bool] = field(default_factory=list)

    def has_map_unit(self, path: Path) -> bool:
        """Return whether the file's coordinate system states the unit of its plan; degrees may be those of a format."""
        return self.crs is not None and not coordinate_system(path, self.crs).is_geographic

    def only(self, kept: list[bool]) -> Shapes:
        """Return the shapes that are to be kept, with their layers and flags."""
        if all(kept):
            return self
        shapes, layers = list(compress(self.shapes, kept)), list(compress(self.layer_of, kept))
        return replace(self, shapes=shapes, layer_of=layers, is_duplicate=list(compress(self.is_duplicate, kept)))


def require_size(path: Path, points: int) -> None:
    """Refuse a file with too many points.

    Raises
    ------
    InputError
        If there are more points than the limit. The message names the file, the count and the limit.
    """
    require_at_most(path, points, "points", "points or more")


def require_simple(path: Path, content: Shapes) -> Shapes:
    """Return a file's shapes without collections in collections; lines in three dimensions keep their elevations.

    Raises
    ------
    InputError
        If there are too many shapes or points, they are nested too deep, a coordinate is absurd or not finite, or their
        edges cross too often.
    """
    limits = reader_limits()
    require_at_most(path, len(content.shapes), "shapes", "shapes")
    parts, of = np.array(content.shapes, dtype=object), np.arange(len(content.shapes))
    for _ in range(limits.nesting):
        if not (shapely.get_type_id(parts) > 3).any():
            break
        parts, index = shapely.get_parts(parts, return_index=True)
        of = of[index]
    else:
        raise InputError(
            f"{path}: collections are nested more than {limits.nesting} deep, the limit (nesting in {FILE})"
        )
    require_at_most(path, len(parts), "shapes", "shapes")
    require_size(path, int(shapely.get_num_coordinates(parts).sum()))
    kept = ~shapely.is_empty(parts)
    shapes, rows = list(parts[kept]), of[kept].tolist()
    layers = [content.layer_of[k] for k in rows] if content.layer_of else []
    flags = [content.is_duplicate[k] for k in rows] if content.is_duplicate else []
    require_plain_coordinates(path, shapes, [f"shape {k + 1}" for k in of[kept].tolist()])
    if count_crossings([shapely.force_2d(shape) for shape in shapes], limits.crossings) > limits.crossings:
        raise InputError(f"{path}: its lines cross more than {limits.crossings} times, the limit (crossings in {FILE})")
    return replace(content, shapes=shapes, layer_of=layers, is_duplicate=flags)


def require_plain_coordinates(path: Path, shapes: list[BaseGeometry], names: list[str]) -> None:
    """Refuse shapes with a place in plan that is absurd or not finite; an elevation may stand for none.

    Parameters
    ----------
    path : Path
    shapes : list of shapely geometry
    names : list of str
        What a message calls each shape.

    Raises
    ------
    InputError
        The message names the shape and the value.
    """
    values, of = shapely.get_coordinates(shapes, return_index=True)
    rows, columns = np.nonzero(~(np.abs(values) < LARGEST))
    if len(rows):
        raise InputError(
            f"{path}: {names[of[rows[0]]]} has the coordinate {values[rows[0], columns[0]]:g}, expected numbers below "
            f"{LARGEST:g}"
        )


def locate(
    path: Path, content: Shapes, unit: str | None, origin: tuple[float, float] | None
) -> tuple[list[BaseGeometry], Georeference]:
    """Convert shapes to metres in the mine frame.

    Degrees are projected by a transverse Mercator about the middle of the shapes. So are coordinates of a system in
    which lengths differ from those on the ground, such as Web Mercator. Coordinates beyond 10 km are moved to
    an origin at the south-west corner, rounded to 10 m, unless `origin` is given. Axes that point south or west are
    turned: the origin is one of the turned coordinates.

    Returns
    -------
    list of shapely geometry, m, mine frame
    Georeference

    Raises
    ------
    InputError
        If a coordinate is not finite or more than 10 km from the origin, or the coordinate system is unknown.
    """
    shapes = [shapely.force_2d(shape) for shape in content.shapes if not shape.is_empty]
    if not shapes:
        raise InputError(f"{path}: holds no polygons and no lines")
    require_size(path, int(shapely.get_num_coordinates(shapes).sum()))
    if not np.isfinite(shapely.get_coordinates(shapes)).all():
        raise InputError(f"{path}: a coordinate is not finite")
    crs, projection = content.crs, None
    if crs is not None and unit is not None and coordinate_system(path, crs).is_geographic:
        crs = None  # a local grid in a format whose coordinate system is always in degrees
    unit_name = unit or content.unit or "m"
    metres = METRES[unit_name]
    if crs is not None:
        system = coordinate_system(path, crs)
        require_plane(path, system, shapely.get_coordinates(content.shapes[:1], include_z=True)[0])
        axes = axes_of(system)
        if unit is None and is_projected(shapes, system):
            shapes, projection = project(path, shapes, system)
            unit_name, metres = "m", 1.0
        else:
            shapes = turned(shapes, system)
            unit_name, metres = (axes.unit, axes.metres) if unit is None else (unit_name, metres)
            warn_of_turn(path, axes)
    mine_origin = origin or _origin(shapely.total_bounds(shapes).tolist(), metres)
    moved = [shapely.transform(shape, lambda p: (p - mine_origin) * metres) for shape in shapes]
    west, south, east, north = shapely.total_bounds(moved).tolist()
    if max(abs(west), abs(south), abs(east), abs(north)) > REACH_M:
        raise InputError(
            f"{path}: reaches from ({west:.0f}, {south:.0f}) to ({east:.0f}, {north:.0f}) m about survey.origin, "
            f"beyond {REACH_M:g} m; is survey.unit = {unit or unit_name} right? --unit states it"
        )
    return moved, Georeference(unit_name, metres, mine_origin, crs, projection)


def with_heights(path: Path, content: Shapes, unit: str | None) -> Shapes:
    """Return shapes whose elevations count upwards, in the unit of the plan that `locate` makes of them.

    Parameters
    ----------
    path : Path
    content : Shapes
        As a reader returns them. Elevations of a system that states no unit of heights have that of its plan; they are
        metres if the plan is in degrees.
    unit : str or None
        As of `locate`; it is that of elevations too.
    """
    if content.crs is None or not any(shape.has_z for shape in content.shapes):
        return content
    system = coordinate_system(path, content.crs)
    if system.is_geographic and unit is not None:
        return content
    axes, flat = axes_of(system), [shapely.force_2d(shape) for shape in content.shapes]
    metres = 1.0 if unit is None and is_projected(flat, system) else axes.metres
    if unit is None:
        warn_of_heights(path, axes, metres)
        scale = axes.up_scale(metres) / metres
    else:
        scale = math.copysign(1.0, axes.up_scale(1.0))
    if scale == 1.0:
        return content
    lifted = [
        shapely.transform(s, lambda p: p * [1, 1, scale], include_z=True) if s.has_z else s for s in content.shapes
    ]
    return replace(content, shapes=lifted)


def _origin(bounds: list[float], metres: float) -> tuple[float, float]:
    if max(map(abs, bounds)) * metres <= REACH_M:
        return 0.0, 0.0
    step = 10.0 / metres
    return math.floor(bounds[0] / step) * step, math.floor(bounds[1] / step) * step
