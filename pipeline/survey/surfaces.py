"""Heights of the floor from a surface: contour lines, points, labels of a drawing, a raster, walls with elevations."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pyproj
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.coordinates.local_plan import require_lengths
from minesurveys.coordinates.map_axes import MapAxes, axes_of, coordinate_system, horizontal, warn_of_heights
from minesurveys.coordinates.stray_heights import STRAY_M
from minesurveys.errors import InputError
from minesurveys.formats import FORMATS, FileKind, files_of, shape_reader, suffixes_of
from minesurveys.frames import Georeference, Heights
from minesurveys.guard.plain_file import read_text_bytes, require_at_most
from minesurveys.height_raster import RASTER_DRIVERS, HeightPoints, prj_beside, read_raster
from minesurveys.remarks import warn_user
from minesurveys.solids.landxml import LANDXML, read_landxml_floor
from minesurveys.spots import read_spots
from minesurveys.vector.shapes import REACH_M, Shapes, require_size
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.passages.relief import warn_of_level
from pipeline.types import Frame, Image

HEIGHT_SUFFIXES = (".csv", *RASTER_DRIVERS, *LANDXML, *suffixes_of(FileKind.VECTOR))
_APART_M = 1.0  # of the points that a surface is sampled at
_SAME_M, _WALL_STEP_M = 0.01, 2.0
_MOST = 50_000
_DARK = 128
_CORNERS_M2 = 8.0  # of triangles in a square metre with sides of at most a metre, cut in halves until they are
_ONE_UNIT = 1e-5  # a US survey foot is 2e-6 longer than a foot

Points = np.ndarray  # (k, 3), x and y in the file's coordinates, then m in the mine frame


def read_heights(path: Path, georeference: Georeference, plan: Image, frame: Frame) -> Heights:
    """Read the floor's heights from a file in the coordinates of the survey's file.

    Parameters
    ----------
    path : Path
        CSV of spot heights (`read_spots`); a raster (GeoTIFF, Esri ASCII grid); DXF, GeoPackage, Shapefile or GeoJSON
        with points and lines that have an elevation, such as contour lines; of a DXF, also numbers written as text,
        each the height at its insertion point; the surfaces of LandXML. Elevations have the unit that the file states
        for them, else that of the coordinates; of a CSV they are metres.
    georeference : Georeference
    plan : (rows, cols, 3) uint8
        Workings are dark; a surface counts there.
    frame : Frame
        Of the plan.

    Raises
    ------
    InputError
        If the file cannot be read, has another coordinate system, or shows no height in the workings.
    """
    suffix = path.suffix.lower()
    if suffix == ".csv":
        return read_spots(path, georeference)
    if suffix not in HEIGHT_SUFFIXES:
        raise InputError(f"{path}: survey.heights is read from {', '.join(HEIGHT_SUFFIXES)}")
    if georeference.projection is not None:
        raise InputError(f"{path}: the survey's coordinates are projected; state its heights as a CSV in metres")
    has_lines = False
    if suffix in RASTER_DRIVERS:
        surface = read_raster(path)
    elif suffix in LANDXML:
        surface = _read_landxml(path, georeference.metres_per_unit)
    else:
        surface, has_lines = _read_drawing(path, _APART_M / georeference.metres_per_unit)
    points = _in_metres(path, surface, georeference)
    shown = _is_in(frame, points[:, :2]) if has_lines else _is_dark(plan, frame, points[:, :2])
    inside, where = points[shown], "on the plan" if has_lines else "in the workings"
    if not len(inside):
        raise InputError(
            f"{path}: none of its {len(points)} heights lies {where}; --heights needs the survey's coordinates"
        )
    low, high = inside[:, 2].min(), inside[:, 2].max()
    warn_user(
        f"heights lie {where}, from {low:.1f} to {high:.1f} m", of=path.name, count=f"{len(inside)} of {len(points)}"
    )
    _require_no_stray_zero(path, inside, "delete them in the file, or write 0.001 if they lie there")
    return _thinned(path, inside, has_lines or suffix in (*RASTER_DRIVERS, *LANDXML))


def height_files(path: Path) -> list[str]:
    """Return a file of heights and its companions."""
    prj, files = prj_beside(path), files_of(path) if path.suffix.lower() in FORMATS else [path]
    return [file.as_posix() for file in (*files, *([] if prj is None else [prj]))]


def wall_heights(
    path: Path,
    content: Shapes,
    moved: list[BaseGeometry],
    georeference: Georeference,
    is_checked: bool = True,
    rules: FloorRules = FLOOR_RULES,
) -> Heights | None:
    """Return the floor's heights from walls with elevations, None if these differ by no more than `flat_step_m`.

    Parameters
    ----------
    path : Path
    content : Shapes
        As `read_shapes` returns them.
    moved : list of shapely geometry, m, mine frame
        The same shapes in plan, as `locate` returns them.
    georeference : Georeference
    is_checked : bool
        Whether an elevation of 0 may be a missing one.
    """
    shapes = [shape for shape in content.shapes if not shape.is_empty]
    z = shapely.get_coordinates(shapes, include_z=True)[:, 2] * georeference.metres_per_unit
    known = np.isfinite(z)
    if not known.any() or np.ptp(z[known]) <= rules.flat_step_m:
        warn_of_level(path, z, rules)
        return None
    lines = [line for shape in moved for line in _lines_of(shape)]
    points = np.column_stack([shapely.get_coordinates(lines), z])
    starts = np.cumsum([0, *map(shapely.get_num_coordinates, lines)])
    rings = [points[a:b] for a, b in itertools.pairwise(starts.tolist())]
    walls = [shapely.LineString(ring) for ring in rings if np.ptp(ring[:, :2], axis=0).max(initial=0.0) > 0]
    dense = shapely.get_coordinates(shapely.segmentize(walls, _WALL_STEP_M), include_z=True)
    known_points = dense[np.isfinite(dense).all(axis=1)]
    if is_checked:
        advice = "--no-elevation 0 takes heights from the rest of the walls, and --no-elevation -9999 keeps 0"
        _require_no_stray_zero(path, known_points, advice)
    return _thinned(path, known_points, True)


def _lines_of(shape: BaseGeometry) -> list[BaseGeometry]:
    """Return the rings of a polygon, or the lines of a shape, in the order of its coordinates."""
    return list(shapely.get_rings(shape) if shape.geom_type == "Polygon" else shapely.get_parts(shape))


def _require_no_stray_zero(path: Path, points: Points, advice: str) -> None:
    """Refuse points in m if one has the elevation 0 and all others are far from it on one side."""
    z = points[:, 2]
    others = z[z != 0]
    if len(others) < len(z) and len(others) and (others.min() > STRAY_M or others.max() < -STRAY_M):
        x, y, _ = points[z == 0][0]
        raise InputError(
            f"{path}: {(z == 0).sum()} points have elevation 0, the first at ({x:.1f}, {y:.1f}) m in the mine frame, "
            f"but the others lie from {others.min():g} to {others.max():g} m; {advice}"
        )


def _thinned(path: Path, points: Points, sampled: bool) -> Heights:
    """Return heights from points in m; those `sampled` from a surface are thinned to one a square metre or less."""
    z = points[:, 2]
    if not np.abs(z).max() <= REACH_M:
        raise InputError(f"{path}: an elevation of {z[np.abs(z).argmax()]:g} m, at most {REACH_M:g} m")
    spacing = _APART_M if sampled else _SAME_M
    while True:
        cell, index = np.unique(np.floor(points[:, :2] / spacing), axis=0, return_inverse=True)
        if len(cell) <= _MOST:
            break
        spacing *= math.sqrt(len(cell) / _MOST) * 1.01
    count = np.bincount(index.ravel())
    mean = np.column_stack([np.bincount(index.ravel(), column) / count for column in points.T])
    datum = float(np.floor(mean[:, 2].min()))
    mean[:, 2] -= datum
    spots = [(float(x), float(y), float(z)) for x, y, z in mean.round(4)]
    return Heights(spots=spots, datum_m=datum, sampled=sampled)


def _is_in(frame: Frame, places_m: np.ndarray) -> np.ndarray:
    """Return whether places (k, 2) m are on a plan."""
    west, south, east, north = frame.extent_m
    return np.asarray(((places_m >= [west, south]) & (places_m <= [east, north])).all(axis=1))


def _is_dark(plan: Image, frame: Frame, places_m: np.ndarray) -> np.ndarray:
    """Return whether places (k, 2) m are in the workings that a plan shows."""
    col, row = np.floor(frame.to_image(places_m)).astype(int).T
    within = (col >= 0) & (row >= 0) & (col < plan.shape[1]) & (row < plan.shape[0])
    dark = np.zeros(len(places_m), bool)
    dark[within] = plan[row[within], col[within]].max(axis=1) < _DARK
    return dark


def _in_metres(path: Path, surface: HeightPoints, georeference: Georeference) -> Points:
    """Return the points of a surface in the mine frame, m, each axis by its own unit.

    Raises
    ------
    InputError
        If its coordinate system is not the survey's, whatever their vertical systems, or is in degrees.
    """
    plan_m, axes = georeference.metres_per_unit, MapAxes()
    if surface.crs is not None:
        system = coordinate_system(path, surface.crs)
        _require_same_system(path, system, georeference.crs)
        axes = axes_of(system)
        plan_m = axes.metres if georeference.crs is None else plan_m
        if georeference.crs is None:
            require_lengths(path, system, surface.points[0], "heights")
    up_m = axes.up_scale(plan_m)
    if surface.up_m is None or axes.states_heights:
        warn_of_heights(path, axes, plan_m)
    if surface.up_m is not None:
        if axes.states_heights and not math.isclose(abs(up_m), surface.up_m, rel_tol=_ONE_UNIT):
            warn_user(
                f"its band states {surface.up_m:g} m a unit of height, its coordinate system {abs(up_m):g} m "
                f"({axes.up_unit}); the band's is used",
                of=path.name,
            )
        up_m = math.copysign(surface.up_m, up_m)
    plan = axes.plan_of(surface.points[:, :2]) * plan_m
    origin_m = np.array(georeference.origin) * georeference.metres_per_unit
    return np.column_stack([plan - origin_m, surface.points[:, 2] * up_m])


def _require_same_system(path: Path, system: pyproj.CRS, of_survey: str | None) -> None:
    """Refuse a plan in another system than the survey's; heights over a geoid are no other system."""
    if of_survey is None:
        return
    one, two = horizontal(system), horizontal(coordinate_system(path, of_survey))
    if not one.equals(two, ignore_axis_order=True):
        raise InputError(
            f"{path}: its coordinate system is {one.name}, the survey's is {two.name}; transform it to the survey's "
            "by `gdalwarp -t_srs` (a raster) or `ogr2ogr -t_srs`"
        )


def _read_landxml(path: Path, plan_m: float) -> HeightPoints:
    """Return points of LandXML surfaces, at most a metre apart, in the survey's unit of `plan_m` metres."""
    vertices, faces, metres = read_landxml_floor(path, read_text_bytes(path, "file_bytes"))
    places = vertices * (metres or plan_m)
    sides = np.cross(places[faces[:, 1]] - places[faces[:, 0]], places[faces[:, 2]] - places[faces[:, 0]])
    require_size(path, int(min(_CORNERS_M2 * np.linalg.norm(sides, axis=1).sum() / 2.0 / _APART_M**2, 1e12)))
    import trimesh  # takes half a second to load, and other surveys do without

    points, _ = trimesh.remesh.subdivide_to_size(places, faces, _APART_M, max_iter=30)
    return HeightPoints(np.unique(points, axis=0) / plan_m, None, plan_m)


def _read_drawing(path: Path, step: float) -> tuple[HeightPoints, bool]:
    """Return the points of a drawing that have an elevation: points, labels, and points a step apart along lines.

    The last value is whether there are lines.
    """
    if path.suffix.lower() == ".dxf":
        from minesurveys.vector.dxf import read_dxf  # see minesurveys/formats.py

        content = read_dxf(path, None, with_heights=True)
    else:
        content = shape_reader(path)(path, None)
    require_at_most(path, len(content.shapes), "shapes", "shapes")
    parts = [part for shape in content.shapes for part in shapely.get_parts(shape) if part.has_z]
    lines = [part for part in parts if shapely.get_dimensions(part) == 1]
    length = sum(line.length for line in lines)
    require_size(path, int(min(length / step, 1e12)))
    found = [shapely.get_coordinates(shapely.segmentize(lines, step), include_z=True)] if lines else []
    found += [shapely.get_coordinates([p for p in parts if shapely.get_dimensions(p) == 0], include_z=True)]
    points = np.concatenate([np.zeros((0, 3)), *(f for f in found if len(f))])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise InputError(f"{path}: no point, line or label with an elevation")
    return HeightPoints(points, content.crs), bool(lines)
