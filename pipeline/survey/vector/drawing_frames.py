"""Notice vector drawings that show more than walls: its lines are no walls, and layers separate them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import LineString

from minesurveys.errors import InputError, one_line
from minesurveys.frames import METRES
from minesurveys.remarks import warn_user
from minesurveys.vector.shapes import Shapes

_FRAME = 0.9  # of the drawing's extent, both ways: a rectangle this large round other lines is a frame
_GRID, _GRID_LINES = 0.6, 3  # of the extent: a straight level or upright line this long is one of a grid; their number
_OF_HULL = 0.5  # of the convex hull of other shapes, that an area round them covers; _FRAME of their points lie in it
_LEVEL = 1e-3  # of the extent
_LISTED = 12  # layers that a message names


def require_walls_alone(path: Path, content: Shapes, snap_m: float, widths_m: tuple[float, float]) -> None:
    """Refuse a drawing with a frame or a grid, whose layers the user did not choose. Ends within `snap_m` are joined.

    A rectangle round all else counts as a frame if other lines lie on other layers, a second frame lies in it, or one
    closed line lies in it that holds the rest, as a mine holds its pillars. The workings of a small mine may be a
    rectangle with pillars: several closed lines in it, apart from each other, that leave passages of a width between
    the two of `widths_m`.

    Raises
    ------
    InputError
        The message lists the layers, or says what helps if there is only one.
    """
    layers = sorted(set(content.layer_of))
    lines = [shape for shape in content.shapes if isinstance(shape, LineString)]
    if len(lines) != len(content.layer_of) or len(lines) < 2:
        return
    west, south, east, north = shapely.total_bounds(lines)
    extent = np.array([east - west, north - south])
    frames = [k for k, line in enumerate(lines) if _is_frame(line, extent)]
    metres = METRES[content.unit or "m"]
    same = max(_LEVEL * extent.max(), snap_m / metres)
    ruled = sum(_is_ruled(line, extent) for line in _with_free_ends(lines, same))
    frame_layers = sorted({content.layer_of[k] for k in frames})
    elsewhere = bool(frames) and frame_layers != layers
    framed = len(frames) > 1
    if len(frames) == 1:
        inside = [line for k, line in enumerate(lines) if k not in frames]
        has_pillars = elsewhere and _has_pillars(lines[frames[0]], inside, metres, widths_m)
        framed = _is_round_mine(inside) or (elsewhere and not has_pillars)
        if has_pillars:
            name = one_line(frame_layers[0], 60)
            warn_user(
                f"the rectangle on layer {name!r} is read as the wall round pillars",
                of=path.name,
                option="--layer",
                advice="--layer chooses",
            )
    if not framed and ruled < _GRID_LINES:
        return
    frame = f"a frame on layer {one_line(', '.join(frame_layers), 60)!r}" if elsewhere else "a frame"
    shown = " and ".join(
        text for text, is_shown in ((frame, framed), (f"{ruled} lines of a grid", ruled >= _GRID_LINES)) if is_shown
    )
    if len(layers) > 1:
        advice = _choice(layers)
    else:
        advice = (
            f"all its lines are on one layer: save the walls alone, or give a PDF or a picture of the drawing; "
            f"--layer {one_line(layers[0], 60)!r} reads them all as walls"
        )
    raise InputError(f"{path}: looks like a drawing with {shown}; {advice}")


def require_no_ruled_layer(path: Path, content: Shapes, snap_m: float) -> None:
    """Refuse centrelines a layer of which is a grid: lines across the drawing that none of another layer meets.

    Drifts of other layers end at a drift, within `snap_m`. A layer of one line is none.

    Raises
    ------
    InputError
        The message names the grid's layer and lists the layers.
    """
    layers = sorted(set(content.layer_of))
    west, south, east, north = shapely.total_bounds(content.shapes)
    extent, same = np.array([east - west, north - south]), snap_m / METRES[content.unit or "m"]
    lines = {
        name: [s for s, layer in zip(content.shapes, content.layer_of, strict=True) if layer == name] for name in layers
    }
    ruled = [name for name in layers if len(lines[name]) > 1 and all(_is_ruled(line, extent) for line in lines[name])]
    for name in ruled if len(ruled) < len(layers) else ():
        ends = [_places(shape) for other in layers if other not in ruled for shape in lines[other]]
        if not any((_apart(np.concatenate(ends), _places(line)) <= same).any() for line in lines[name]):
            raise InputError(
                f"{path}: looks like a drawing with a grid: {len(lines[name])} straight lines across it on layer "
                f"{one_line(name, 60)!r}, which no line of another layer meets; {_choice(layers)}"
            )


def require_no_boundary(path: Path, content: Shapes) -> None:
    """Refuse layers the largest area of which encloses what the others hold, as the boundary of a lease does.

    Such an area also covers most of the convex hull of the others: drifts that hold the areas of shafts do not. Areas
    at different heights are levels, which may enclose each other in plan.

    Raises
    ------
    InputError
        The message names the area's layer and lists the layers.
    """
    layers = sorted(set(content.layer_of))
    areas = np.where(shapely.get_dimensions(content.shapes) == 2, shapely.area(content.shapes), 0.0)
    heights = shapely.get_coordinates(content.shapes, include_z=True)[:, 2]
    if len(layers) < 2 or not areas.any() or len(np.unique(heights[np.isfinite(heights)])) > 1:
        return
    outer = int(areas.argmax())
    others = [
        shape for shape, layer in zip(content.shapes, content.layer_of, strict=True) if layer != content.layer_of[outer]
    ]
    area, points = content.shapes[outer], shapely.get_coordinates(others)
    shapely.prepare(area)
    if shapely.intersects_xy(area, *points.T).mean() < _FRAME:
        return
    hull = shapely.MultiPoint(points).convex_hull
    if shapely.make_valid(area).intersection(hull).area < _OF_HULL * hull.area:
        return
    raise InputError(
        f"{path}: an area of layer {one_line(content.layer_of[outer], 60)!r} encloses the shapes of other layers, as a "
        f"frame or a boundary does; {_choice(layers)}"
    )


def _choice(layers: list[str]) -> str:
    names = one_line(", ".join(layers[:_LISTED]) + (", ..." if len(layers) > _LISTED else ""), 200)
    return f"--layer NAME, once for each layer with walls, chooses from its layers: {names}"


def _places(shape: shapely.Geometry) -> np.ndarray:
    """Return a shape's points (n, 3); those without an elevation lie at 0."""
    return np.nan_to_num(shapely.get_coordinates(shape, include_z=True))


def _apart(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the distances of points (n, 3) from the straight line between a line's first and last point."""
    step = line[-1] - line[0]
    along = np.clip((points - line[0]) @ step / max(step @ step, np.finfo(float).tiny), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - line[0] - along[:, None] * step, axis=1))


def _with_free_ends(lines: list[LineString], same: float) -> list[LineString]:
    """Return the lines neither of whose ends is that of another line: a wall goes on in the next wall, a grid ends."""
    ends = np.array([[line.coords[0][:2], line.coords[-1][:2]] for line in lines])
    tree = cKDTree(ends.reshape(-1, 2))
    near = tree.query_ball_point(ends.reshape(-1, 2), same, return_length=True).reshape(-1, 2)
    return [line for line, others in zip(lines, near, strict=True) if not line.is_closed and (others == 1).all()]


def _is_round_mine(inside: list[LineString]) -> bool:
    """Return whether one of the closed lines in a frame holds all others: walls that hold pillars."""
    areas = _areas_of(inside)
    if len(areas) < 2:
        return False
    outer = max(areas, key=lambda area: area.area)
    shapely.prepare(outer)
    return all(outer.contains_properly(area) for area in areas if area is not outer)


def _has_pillars(
    frame: LineString, inside: list[LineString], metres_per_unit: float, widths_m: tuple[float, float]
) -> bool:
    """Return whether a rectangle is the wall round pillars: closed lines, apart, with passages between them."""
    pillars, rock = _areas_of(inside), shapely.Polygon(frame)
    if len(pillars) < 2 or len(pillars) != len(inside):
        return False
    together = shapely.union_all(pillars)
    if len(shapely.get_parts(together)) != len(pillars) or not rock.contains_properly(together):
        return False
    free = rock.difference(together)
    return bool(widths_m[0] <= 2 * free.area / free.length * metres_per_unit <= widths_m[1])


def _areas_of(lines: list[LineString]) -> list[shapely.Polygon]:
    return [area for line in lines if line.is_closed and (area := shapely.Polygon(line)).is_valid and area.area > 0]


def _is_frame(line: LineString, extent: np.ndarray) -> bool:
    """Return whether a line is a level rectangle nearly as large as the drawing."""
    west, south, east, north = line.bounds
    size = np.array([east - west, north - south])
    if not line.is_closed or (size < _FRAME * extent).any():
        return False
    return bool(shapely.Polygon(line).area > (1 - _LEVEL) * size.prod())


def _is_ruled(line: LineString, extent: np.ndarray) -> bool:
    """Return whether a line is straight, level or upright, and nearly as long as the drawing."""
    west, south, east, north = line.bounds
    size = np.array([east - west, north - south])
    return bool(((size >= _GRID * extent) & (size[::-1] <= _LEVEL * extent.max())).any())
