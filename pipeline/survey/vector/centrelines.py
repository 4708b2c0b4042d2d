"""Centrelines in vector files: lines in plan or in three dimensions, which a stated half width makes passages.

Ends that lie on another line join it. Warnings name the place of what nearly meets, or has no elevation.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from networkx.utils import UnionFind
from shapely.geometry.base import BaseGeometry

from minesurveys.coordinates.stray_heights import require_elevations
from minesurveys.errors import NAMED, InputError, one_line
from minesurveys.frames import Georeference
from minesurveys.guard.plain_file import require_at_most
from minesurveys.remarks import warn_user
from minesurveys.solved.model import LegFlag, LegStyle, SolvedSurvey, StationFlag
from minesurveys.vector.level_fields import by_levels
from minesurveys.vector.shapes import REACH_M, Shapes, locate
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules

_NEAR_M = 3.0  # warns of an end so near to another line, and not joined

Line = np.ndarray  # (k, 3) m


def read_centrelines(
    path: Path,
    content: Shapes,
    unit: str | None,
    origin: tuple[float, float] | None,
    snap_m: float,
    elevations_m: dict[str, float] | None = None,
    is_checked: bool = True,
    rules: FloorRules = FLOOR_RULES,
) -> tuple[SolvedSurvey, Georeference]:
    """Return the lines of a file as the legs of a survey, and the georeference of the mine frame that they are in.

    A line's points are its stations. An end within `snap_m` of another line joins it, and lines that cross at one
    height, to `snap_m`, meet there. Elevations have the unit of the coordinates, or are metres if these are degrees.

    Parameters
    ----------
    path : Path
    content : Shapes
        In the file's coordinates; lines without z lie at 0.
    unit : str or None
        As of `locate`.
    origin : (float, float) or None
        As of `locate`.
    snap_m : float
    elevations_m : dict of str to float, or None
        Of the lines of layers. Lines of other layers are left out, with a warning, if they have no elevations.
    is_checked : bool
        Whether an elevation of 0 may be a missing one.

    Raises
    ------
    InputError
        If the file holds polygons or no lines, an elevation is missing or beyond 10 km, all lines fall on one place,
        or a limit is exceeded; the message names the place.
    """
    lines, flags, georeference = _lines(path, content, unit, origin, elevations_m or {})
    if is_checked:
        require_elevations(path, np.concatenate(lines), "lines")
    lines = _crossed(path, lines, [] if elevations_m else content.fields, rules)
    drawn_m = np.ptp(np.concatenate(lines)[:, :2], axis=0).max()
    lines, kept = _joined(path, lines, snap_m)
    if not lines:
        raise InputError(
            f"{path}: nothing is left of its lines, which span {drawn_m:.2f} m, read in {georeference.unit}: ends "
            f"nearer than {snap_m:g} m are one place; --unit states another unit, --snap M another distance"
        )
    require_at_most(path, sum(map(len, lines)), "stations", "points of lines")
    places = np.concatenate(lines)
    starts = np.cumsum([0, *map(len, lines)])
    pairs = np.array([(k, k + 1) for a, b in pairwise(starts.tolist()) for k in range(a, b - 1)], np.int64)
    leg_flags = np.repeat(np.array([flags[k] for k in kept], np.uint8), [len(line) - 1 for line in lines])
    names = tuple(f"{number}.{k}" for number, line in enumerate(lines, 1) for k in range(1, len(line) + 1))
    return SolvedSurvey(
        names,
        places,
        np.full(len(places), StationFlag.UNDERGROUND, np.uint8),
        pairs.reshape(-1, 2),
        leg_flags,
        np.full(len(pairs), LegStyle.CARTESIAN, np.uint8),
        title=path.stem,
        is_named=False,
    ), georeference


def _lines(
    path: Path,
    content: Shapes,
    unit: str | None,
    origin: tuple[float, float] | None,
    elevations_m: dict[str, float],
) -> tuple[list[Line], list[LegFlag], Georeference]:
    """Return the lines in metres of the mine frame, with their elevations, and the flags of their legs."""
    parts, layers, flags = _parts(path, content, elevations_m)
    moved, georeference = locate(path, replace(content, shapes=parts), unit, origin)
    lines = []
    for line, part, layer in zip(moved, parts, layers, strict=True):
        points = shapely.get_coordinates(part, include_z=True)
        z = points[:, 2] * georeference.metres_per_unit if part.has_z else np.zeros(len(points))
        if layer in elevations_m:
            z = np.full(len(points), elevations_m[layer])
        if np.isnan(z).any():
            x, y, _ = points[np.isnan(z)][0]
            raise InputError(
                f"{path}: {np.isnan(z).sum()} points of lines have no elevation (z is not a number), the first at "
                f"({x:.1f}, {y:.1f}); --no-elevation 0 takes heights from the rest of the lines"
            )
        lines.append(np.column_stack([shapely.get_coordinates(line), z]))
    far = max(float(np.abs(line[:, 2]).max()) for line in lines)
    if not far <= REACH_M:
        raise InputError(
            f"{path}: an elevation of {far:g} m, at most {REACH_M:g} m; --unit states the unit of the file"
        )
    return lines, flags, georeference


def _parts(
    path: Path, content: Shapes, elevations_m: dict[str, float]
) -> tuple[list[BaseGeometry], list[str], list[LegFlag]]:
    """Return the single lines of a file with their layers and flags; with stated elevations, those that have one."""
    parts, of = shapely.get_parts(content.shapes, return_index=True)
    dimension = shapely.get_dimensions(parts)
    drawn = ~shapely.is_empty(parts)
    if (dimension[drawn] == 2).any():
        raise InputError(f"{path}: holds polygons; centrelines are lines (without --half-width, it is read as walls)")
    of_shape = content.layer_of or [""] * len(content.shapes)
    unknown = sorted(set(elevations_m) - set(of_shape))
    if unknown:
        there = ", ".join(one_line(name, 40) for name in dict.fromkeys(of_shape) if name) or "no layers"
        raise InputError(f"{path}: no layer {', '.join(unknown)} to be at an elevation; there are {there}")
    numbers = np.flatnonzero(drawn & (dimension == 1)).tolist()
    if not numbers:
        raise InputError(f"{path}: holds no lines")
    kept = [k for k in numbers if not elevations_m or of_shape[of[k]] in elevations_m or parts[k].has_z]
    if len(kept) < len(numbers):
        left_out = sorted({of_shape[of[k]] for k in set(numbers) - set(kept)})
        names = ", ".join(one_line(name, 40) or "no name" for name in left_out[:NAMED])
        warn_user(
            f"lines of {len(left_out)} layers without an elevation are left out: {names}",
            of=path.name,
            count=len(numbers) - len(kept),
            option="--elevation",
            advice="--elevation LAYER=M states one",
        )
    twice = content.is_duplicate or [False] * len(content.shapes)
    flags = [LegFlag.DUPLICATE if twice[of[k]] else LegFlag(0) for k in kept]
    return [parts[k] for k in kept], [of_shape[of[k]] for k in kept], flags


def _crossed(path: Path, lines: list[Line], fields: list[str], rules: FloorRules) -> list[Line]:
    """Return the lines with a common point wherever two cross in plan at one height, with a warning of the places."""
    segments, most = _Segments(lines), rules.flat_step_m
    points: dict[int, list[tuple[float, np.ndarray]]] = defaultdict(list)
    one, two = segments.tree.query(segments.shapes, predicate="crosses")
    for a, b in np.column_stack([one, two])[one < two].tolist():
        place = shapely.get_coordinates(segments.shapes[a].intersection(segments.shapes[b]))[0]
        (share_a, z_a), (share_b, z_b) = segments.at(a, place), segments.at(b, place)
        if abs(z_a - z_b) <= most:
            meeting = np.array([*place, (z_a + z_b) / 2])
            points[a].append((share_a, meeting))
            points[b].append((share_b, meeting))
    if not points:
        return lines
    x, y, z = next(iter(points.values()))[0][1]
    warn_user(
        f"lines cross at {sum(map(len, points.values())) // 2} places without a common point and less than {most:g} m "
        f"over each other; they meet there, the first at ({x:.1f}, {y:.1f}, {z:.1f})",
        of=path.name,
        **by_levels(fields),
    )
    made, number = [], 0
    for line in lines:
        rows = []
        for point in line[:-1]:
            rows += [point, *(meeting for _, meeting in sorted(points.get(number, []), key=lambda row: row[0]))]
            number += 1
        made.append(np.array([*rows, line[-1]]))
    return made


def _joined(path: Path, lines: list[Line], snap_m: float) -> tuple[list[Line], list[int]]:
    """Return the lines with ends moved to the points that they join, and with points where others join them.

    The last value are the numbers of the lines that are left.
    """
    segments = _Segments(lines)
    same: UnionFind = UnionFind()  # points, as line and number
    added: dict[tuple[int, int], list[tuple[float, tuple[int, int]]]] = defaultdict(list)
    near: list[tuple[np.ndarray, float]] = []
    for number, line in enumerate(lines):
        for at in (0, len(line) - 1):
            joins, apart = segments.near(number, at, line[at], snap_m)
            for other, index, share in joins:
                if share in (0.0, 1.0):
                    same.union((other, index + int(share)), (number, at))
                else:
                    added[other, index].append((share, (number, at)))
            if not joins and apart < _NEAR_M:
                near.append((line[at], apart))
    if near:
        (x, y, z), apart = near[0]
        warn_user(
            f"ends are less than {_NEAR_M:g} m from another line and do not join it, the first at ({x:.1f}, "
            f"{y:.1f}, {z:.1f}), {apart:.2f} m away; --snap M joins ends nearer than M (survey.snap_m = "
            f"{snap_m:g})",
            of=path.name,
            count=len(near),
            option="--snap, survey.snap_m",
        )

    def place(point: tuple[int, int]) -> np.ndarray:
        of, at = same[point]
        return np.asarray(lines[of][at])

    made, numbers = [], []
    for number, line in enumerate(lines):
        points = []
        for index in range(len(line)):
            points += [place((number, index)), *(place(end) for _, end in sorted(added.get((number, index), [])))]
        kept = [points[0], *(b for a, b in pairwise(points) if (a != b).any())]
        if len(kept) > 1:
            made.append(np.array(kept))
            numbers.append(number)
    return made, numbers


class _Segments:
    """The segments of lines, found by their place in plan."""

    def __init__(self, lines: list[Line]) -> None:
        """Take the lines' segments in the order of the lines."""
        self.last = np.array([len(line) - 2 for line in lines])
        self.of = np.concatenate([np.full(len(line) - 1, k) for k, line in enumerate(lines)])
        self.index = np.concatenate([np.arange(len(line) - 1) for line in lines])
        self.start = np.concatenate([line[:-1] for line in lines])
        ends = np.concatenate([line[1:] for line in lines])  # start + along would round, and then neighbours cross
        self.along = ends - self.start
        self.way = np.concatenate([np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)) for line in lines])
        self.shapes = shapely.linestrings(np.stack([self.start, ends], axis=1)[:, :, :2])
        self.tree = shapely.STRtree(self.shapes)

    def at(self, number: int, place_m: np.ndarray) -> tuple[float, float]:
        """Return how far along a segment, as a share, a place (2,) m on it is, and how high the segment is there, m."""
        along = self.along[number]
        share = float(np.dot(place_m - self.start[number, :2], along[:2]) / np.dot(along[:2], along[:2]))
        return share, float(self.start[number, 2] + share * along[2])

    def near(
        self, line: int, at: int, point_m: np.ndarray, snap_m: float
    ) -> tuple[list[tuple[int, int, float]], float]:
        """Return what the end `at` of a line joins, and how far (m) it is from the nearest other line.

        Its own line counts where it comes back to the end. What it joins are lines, with the number of a segment and
        the share of it, 0 and 1 at its ends.
        """
        reach = max(_NEAR_M, snap_m)
        found = self.tree.query(shapely.Point(point_m[:2]), predicate="dwithin", distance=reach)
        before = self.way[found] - np.linalg.norm(self.along[found], axis=1)
        whole = self.way[(self.of == line) & (self.index == self.last[line])]
        way = before if at == 0 else whole - self.way[found]  # along its own line
        found = found[(self.of[found] != line) | (way > 2 * reach)]
        start, along = self.start[found], self.along[found]
        share = np.clip(((point_m - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
        for end in (0.0, 1.0):
            share[np.linalg.norm(start + end * along - point_m, axis=1) <= snap_m] = end
        apart = np.linalg.norm(start + share[:, None] * along - point_m, axis=1)
        joins = np.flatnonzero(apart <= snap_m).tolist()
        ends = [(int(self.of[found[k]]), int(self.index[found[k]]), float(share[k])) for k in joins]
        return ends, float(apart.min(initial=np.inf))
