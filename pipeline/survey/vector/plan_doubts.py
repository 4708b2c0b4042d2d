"""Notice drawings that are no plan of walls: a vertical section, contours of a surface, or centrelines of drifts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError, first_few, one_line
from minesurveys.remarks import warn_user
from minesurveys.vector.level_fields import by_levels
from minesurveys.vector.shapes import Shapes
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.vector.enclosed import workings_of

_FLAT = 1e-3  # of a section's length, that its points lie beside its plane
_LEAST_CONTOURS = 5  # closed lines within each other, each lower or each higher than the last
_OWN_HEIGHTS = 0.8  # of the lines; a level of a mine has many lines at its height
_MOUTH_M = 10.0  # the most that --snap joins: ends of walls so near are a drift's end
_TRIED = 40  # layers


def require_plan(path: Path, content: Shapes, rules: FloorRules = FLOOR_RULES) -> None:
    """Refuse walls that lie in one vertical plane, and contours of an open pit or of the ground.

    Contours are closed lines, five of which lie within each other. If they have heights, each is at one height, and
    they fall or rise all the way.

    Raises
    ------
    InputError
        The message says what the drawing looks like, and the option that reads it all the same.
    """
    lines = _single_lines(content)
    has_heights = bool(lines) and all(line.has_z for line in lines)
    if not lines or len(lines) != len(content.shapes) or any(line.has_z for line in lines) != has_heights:
        return
    points = shapely.get_coordinates(lines, include_z=has_heights)
    if not np.isfinite(points).all():
        return
    length, across = _extents(points[:, :2])
    fall = float(np.ptp(points[:, 2])) if has_heights else 0.0
    if across <= _FLAT * length and fall > _FLAT * length:
        raise InputError(
            f"{path}: its {len(lines)} lines lie in one vertical plane, {length:g} long and {fall:g} high in the unit "
            f"of the file; --half-width M reads them as centrelines of drifts; if it is a section, give the plan"
        )
    nested = _nested_contours(lines, rules)
    if nested >= _LEAST_CONTOURS:
        raise InputError(
            f"{path}: {nested} of its closed lines lie within each other"
            f"{', each at a height of its own' if has_heights else ''}: contours of an open pit or of the ground, no "
            f"underground workings; --heights FILE reads contours as heights of the floor of a plan; --layer "
            f"NAME reads them all the same{_layers(content)}"
        )


def contours_hint(content: Shapes, rules: FloorRules = FLOOR_RULES) -> str:
    """Return what to say of lines that bound nothing if they look like contours: level, each at a height of its own."""
    step = rules.flat_step_m
    lines = [line for line in _single_lines(content) if line.has_z]
    heights = [shapely.get_coordinates(line, include_z=True)[:, 2] for line in lines]
    level = {round(float(z[0]) / step) for z in heights if np.isfinite(z).all() and np.ptp(z) < step}
    if len(level) < _LEAST_CONTOURS or len(level) < _OWN_HEIGHTS * len(content.shapes):
        return ""
    return (
        f"; its lines are level, at {len(level)} heights, as contours of an open pit or of the ground are, and no "
        "workings; --heights FILE reads them as heights of the floor of a plan"
    )


def warn_of_crossings(path: Path, content: Shapes) -> None:
    """Warn of lines that cross each other and were read as walls: they may be centrelines, of several levels too."""
    lines = np.array(_single_lines(content), object)
    if len(lines) != len(content.shapes) or len(lines) < 2:
        return
    crossings = shapely.STRtree(lines).query(lines, predicate="crosses").shape[1] // 2
    if crossings:
        warn_user(
            "pairs of its lines cross each other, as centrelines do; they are read as walls",
            of=path.name,
            count=crossings,
            **by_levels(content.fields, "--half-width M reads them as centrelines"),
        )


def warn_of_layers(path: Path, content: Shapes) -> None:
    """Warn that several layers are read, with the share of each of the length of all lines: some may be no drifts."""
    lengths = shapely.length(content.shapes)
    sums: dict[str, float] = {}
    for name, length in zip(content.layer_of, lengths.tolist(), strict=False):
        sums[name] = sums.get(name, 0.0) + length
    if len(sums) < 2:
        return
    percent = 100 / (sum(sums.values()) or 1.0)
    order = sorted(sums, key=lambda name: -sums[name])
    listed = [f"{one_line(name, 40) or 'no name'} {percent * sums[name]:.0f} %" for name in order]
    warn_user(
        f"layers are read as one plan (of the length of their lines: {first_few(listed)})",
        of=path.name,
        count=len(sums),
        option="--layer",
        advice="--layer chooses",
    )


def _single_lines(content: Shapes) -> list[shapely.Geometry]:
    return [line for line in content.shapes if shapely.get_dimensions(line) == 1]


def _layers(content: Shapes) -> str:
    names = list(dict.fromkeys(content.layer_of))
    return f" ({names[0]!r:.60})" if len(names) == 1 else ""


def _extents(places: np.ndarray) -> tuple[float, float]:
    """Return the length of places (n, 2) along their main direction, and across it."""
    around = places - places.mean(axis=0)
    _, axes = np.linalg.eigh(around.T @ around)
    across, along = np.ptp(around @ axes, axis=0)
    return float(along), float(across)


def _nested_contours(lines: list[shapely.Geometry], rules: FloorRules) -> int:
    """Return how many closed lines at one height each lie within each other, falling or rising all the way.

    Lines without heights need neither.
    """
    step = rules.flat_step_m
    closed = [line for line in lines if line.is_closed and len(line.coords) > 3]
    has_heights = all(line.has_z for line in lines)
    level = [
        line for line in closed if not has_heights or np.ptp(shapely.get_coordinates(line, include_z=True)[:, 2]) < step
    ]
    if len(level) < _LEAST_CONTOURS:
        return 0
    areas = np.array([shapely.Polygon(line.coords) for line in level], object)
    heights = np.array([line.coords[0][2] if has_heights else 0.0 for line in level])
    places = shapely.points([line.coords[0][:2] for line in level])
    outer, inner = shapely.STRtree(places).query(areas, predicate="contains")
    order = np.argsort([area.area for area in areas], kind="stable")
    longest = 0
    for sign in (1, -1):
        depth = np.ones(len(level), int)
        for number in order.tolist():  # from the innermost outwards
            within = inner[outer == number]
            beyond = sign * (heights[within] - heights[number]) > step
            within = within[(within != number) & (beyond | (not has_heights))]
            depth[number] += depth[within].max(initial=0)
        longest = max(longest, int(depth.max()))
    return longest


def refusal_of_layers(
    path: Path, content: Shapes, shapes: list[BaseGeometry], snap_m: float, error: InputError
) -> InputError:
    """Return the refusal of a drawing whose layers enclose nothing as one plan; it names layers that do alone.

    Parameters
    ----------
    path : Path
    content : Shapes
        With the layer of each shape.
    shapes : list of shapely geometry, m
        The same shapes, as `locate` returns them.
    snap_m : float
    error : InputError
        Why the layers together are refused; it is kept if there is one layer.
    """
    layers = list(dict.fromkeys(content.layer_of))
    if len(layers) < 2:
        return error
    named = first_few([one_line(name, 40) or "no name" for name in layers])
    ways = []
    for layer in layers[:_TRIED]:
        own = [shape for shape, name in zip(shapes, content.layer_of, strict=True) if name == layer]
        for snap in (snap_m, _MOUTH_M):
            try:
                area_m2 = workings_of(path, own, snap, []).area
            except InputError:
                continue
            option = f" --snap {snap:g}" if snap != snap_m else ""
            ways.append(f"--layer {one_line(layer, 40)!r}{option} reads {area_m2:.0f} m2")
            break
    if ways:
        return InputError(f"{path}: its {len(layers)} layers ({named}) enclose nothing as one plan; {first_few(ways)}")
    lengths = shapely.length(shapes)
    sums = {layer: float(lengths[np.array([name == layer for name in content.layer_of])].sum()) for layer in layers}
    listed = [f"{one_line(name, 40)!r} with {sums[name]:.0f} m" for name in sorted(sums, key=lambda k: -sums[k])]
    return InputError(
        f"{path}: none of its {len(layers)} layers encloses an area; --half-width M reads lines as centrelines of "
        "drifts, M metres from the line to either wall, and --layer NAME those of one layer: "
        f"{first_few(listed)}"
    )
