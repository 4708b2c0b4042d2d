"""Notice drawings that are no plan of workings: a vertical section, or the contours of a surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from pipeline.errors import InputError
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.vector.shapes import Shapes

_FLAT = 1e-3  # of a section's length, that its points lie beside its plane
_LEAST_CONTOURS = 5  # closed lines within each other, each lower or each higher than the last


def require_plan(path: Path, content: Shapes) -> None:
    """Refuse walls that lie in one vertical plane, and contours of an open pit or of the ground.

    Contours are closed lines, each at one height, five of which lie within each other and fall or rise all the way.

    Raises
    ------
    InputError
        The message says what the drawing looks like, and the option that reads it all the same.
    """
    lines = [shape for shape in content.shapes if shape.has_z and shapely.get_dimensions(shape) == 1]
    if not lines or len(lines) != len(content.shapes):
        return
    points = shapely.get_coordinates(lines, include_z=True)
    if not np.isfinite(points).all():
        return
    advice = f"--layer NAME reads them all the same{_layers(content)}"
    length, across = _extents(points[:, :2])
    fall = float(np.ptp(points[:, 2]))
    if across <= _FLAT * length and fall > _FLAT * length:
        raise InputError(
            f"{path}: its {len(lines)} lines lie in one vertical plane, {length:g} long and {fall:g} high in the unit "
            f"of the file; --half-width M reads them as centrelines of drifts; if it is a section, give the plan; "
            f"{advice}"
        )
    nested = _nested_contours(lines)
    if nested >= _LEAST_CONTOURS:
        raise InputError(
            f"{path}: {nested} of its closed lines lie within each other, each at a height of its own: contours of an "
            f"open pit or of the ground, and no underground workings; --heights FILE reads contours as heights of the "
            f"floor of a plan; {advice}"
        )


def _layers(content: Shapes) -> str:
    names = list(dict.fromkeys(content.layer_of))
    return f" ({names[0]!r:.60})" if len(names) == 1 else ""


def _extents(places: np.ndarray) -> tuple[float, float]:
    """Return the length of places (n, 2) along their main direction, and across it."""
    around = places - places.mean(axis=0)
    _, axes = np.linalg.eigh(around.T @ around)
    across, along = np.ptp(around @ axes, axis=0)
    return float(along), float(across)


def _nested_contours(lines: list[shapely.Geometry]) -> int:
    """Return how many closed lines at one height each lie within each other, falling or rising all the way."""
    step = floor_rules().flat_step_m
    closed = [line for line in lines if line.is_closed and len(line.coords) > 3 and line.coords[0][2] is not None]
    level = [line for line in closed if np.ptp(shapely.get_coordinates(line, include_z=True)[:, 2]) < step]
    if len(level) < _LEAST_CONTOURS:
        return 0
    areas = np.array([shapely.Polygon(line.coords) for line in level], object)
    heights = np.array([line.coords[0][2] for line in level])
    places = shapely.points([line.coords[0][:2] for line in level])
    outer, inner = shapely.STRtree(places).query(areas, predicate="contains")
    order = np.argsort([area.area for area in areas], kind="stable")
    longest = 0
    for sign in (1, -1):
        depth = np.ones(len(level), int)
        for number in order.tolist():  # from the innermost outwards
            within = inner[outer == number]
            within = within[(within != number) & (sign * (heights[within] - heights[number]) > step)]
            depth[number] += depth[within].max(initial=0)
        longest = max(longest, int(depth.max()))
    return longest
