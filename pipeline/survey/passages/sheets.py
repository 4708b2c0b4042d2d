"""Cut a survey in three dimensions into sheets: pieces that are single-valued in plan, drawn side by side."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import shapely
from networkx.utils import UnionFind
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.floors.stretch import LEAST_ROOF_M, MOST_ROOF_M
from pipeline.errors import InputError
from pipeline.guard.reading_process import warn_user
from pipeline.params.floor_rules import floor_rules
from pipeline.survey.passages.built_cells import Built
from pipeline.survey.passages.legs import SurveyLeg, without_shots
from pipeline.survey.passages.pieces import choose_piece, find_station
from pipeline.survey.passages.relief import floor_of
from pipeline.survey.passages.shafts import find_shafts, steep_shots
from pipeline.survey.passages.sheet_cells import UNIT_M, Cell, Way, survey_cells
from pipeline.survey.passages.sheet_layout import APART_M, assign_sheets, lay_apart
from pipeline.survey.passages.thin_pillars import without_thin_pillars
from pipeline.types import Heights, Piece, Seam

_OVERLAP_M2, _INTO_M = 0.01, 0.1  # half a disc of this radius is larger than that
_TOUCH_M = 1e-3  # two shapes that overlap by less touch
_DIGITS = 4  # of the outlines' coordinates, m
_SPECK_M2 = 0.05  # smaller holes come from rounding


def lay_out_sheets(
    path: Path, legs: list[SurveyLeg], apart_m: float | None = None, piece: Piece | None = None, named: bool = True
) -> tuple[MultiPolygon, Heights]:
    """Return the workings of each sheet in plan, moved aside but for the first, and the heights of their floors.

    Legs steeper than `steepest_grade` are left out, as a fence would, and the longest connected piece is kept, or that
    of the station `piece` (`find_station`); warnings list what is left out, by place without `named` stations.
    Passages less than `apart_m` over others that they do not meet are left out, too (`without_thin_pillars`). Steep
    legs that lead down from what is built are its shafts (`find_shafts`). Where workings lie over each other, legs are
    cut half-way between two stations.

    Raises
    ------
    InputError
        If nothing remains, or workings pass over each other between two stations; the message names the stations.
    """
    kept = _gentle(path, [leg for leg in legs if not leg.is_plumb])
    station = None if piece is None else find_station(path, legs, kept, piece)
    if apart_m is not None:
        kept = without_thin_pillars(path, kept, apart_m, station)
    cells, graph, ways = survey_cells(kept)
    whole = choose_piece(path, cells, graph, station, named)
    _list_roofs(path, kept, whole)
    units = _units(whole, cells)
    conflicts = _conflicts(path, cells, units, whole)
    sheet = assign_sheets(whole, units, conflicts)
    polygons = _polygons(cells, sheet)
    offsets = lay_apart(polygons)
    datum = float(np.floor(min(line[:, 2].min() for node in whole for line in cells[node].lines)))
    lines, roofs, seams = [], [], []
    for way in ways:
        for run, number in _runs(way, sheet):
            moved = np.array(run)[:, :3] + np.array([*offsets[number], -datum])
            lines.append([(float(x), float(y), float(z)) for x, y, z in moved])
            roofs.append([(float(metres), float(share)) for metres, share in np.array(run)[:, 3:]])
        seams += _seams(way, sheet, offsets)
    moved_polygons = [shapely.transform(p, lambda xy, d=offsets[k]: xy + d) for k, p in enumerate(polygons)]
    if not any(share < 1 for line in roofs for _, share in line):
        roofs = []
    shafts = find_shafts(path, legs, Built(cells, sheet, offsets, datum))
    moved_m = [(float(x), float(y)) for x, y in offsets]
    heights = Heights(lines=lines, datum_m=datum, offset_m=moved_m, seams=seams, roofs=roofs, shafts=shafts)
    return MultiPolygon(moved_polygons), heights


def _gentle(path: Path, legs: list[SurveyLeg]) -> list[SurveyLeg]:
    """Return the legs without their steep parts."""
    most, found, steep, first = floor_rules().steepest_grade, [], 0, ""
    for leg in legs:
        bad = steep_shots(leg).tolist()
        for k in bad:
            x, y = leg.positions_m[k]
            first = first or f"{leg.stations[k]} to {leg.stations[k + 1]} at ({x:.1f}, {y:.1f})"
        steep += len(bad)
        found += without_shots(leg, set(bad))
    if not found:
        raise InputError(f"{path}: every leg is steeper than {most:g} (survey.steepest_grade); nothing to drive on")
    if steep:
        warn_user(
            f"{path.name}: {steep} legs are steeper than {most:g} (survey.steepest_grade) and are fenced off, "
            f"the first {first}"
        )
    return found


def _list_roofs(path: Path, legs: list[SurveyLeg], whole: nx.Graph) -> None:
    """Warn of roofs of the piece that is built that are lower or higher than roofs can be."""
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    for leg in legs:
        assert leg.heights_m is not None
        over = leg.heights_m[:, 0] + leg.heights_m[:, 1] - floor_of(leg)
        for name, roof_m in zip(leg.stations, over.tolist(), strict=True):
            if name in whole and roof_m < LEAST_ROOF_M:
                low[name] = roof_m
            elif name in whole and roof_m > MOST_ROOF_M:
                high[name] = roof_m
    for found, limit_m, what in ((low, LEAST_ROOF_M, "low"), (high, MOST_ROOF_M, "high")):
        if found:
            name, roof_m = next(iter(found.items()))
            warn_user(
                f"{path.name}: {len(found)} stations have roofs {what}er over the floor than {limit_m:g} m; they are "
                f"clamped to {limit_m:g} m, the first {name} from {roof_m:.2f} m"
            )


def _units(graph: nx.Graph, cells: dict[str, Cell]) -> dict[str, str]:
    """Return for each cell the unit that it belongs to: cells between which no cut can be made are one."""
    groups: UnionFind = UnionFind(graph)
    shrunk = {node: [shape.buffer(-_TOUCH_M) for shape in cells[node].shapes] for node in graph}
    for a, b, way in graph.edges(data=True):
        near = nx.single_source_dijkstra_path_length(graph, a, 2 * UNIT_M, weight="length")
        if not _is_clean(way["cut"], {node: shrunk[node] for node in near}, cells):
            groups.union(a, b)
    return {node: groups[node] for node in graph}


def _is_clean(cut: np.ndarray, near: dict[str, list[BaseGeometry]], cells: dict[str, Cell]) -> bool:
    """Return whether a cut (2, 3) m reaches from wall to wall, and the workings near it at its height touch it only.

    A station's disc, or in a bend the drift before it, may reach past it.
    """
    line, (x, y, z) = shapely.LineString(cut[:, :2]), cut.mean(axis=0)
    return not any(
        shapely.intersects(shapes, line).any() and abs(cells[name].height_at(x, y) - z) < floor_rules().flat_step_m
        for name, shapes in near.items()
    )


def _conflicts(path: Path, cells: dict[str, Cell], units: dict[str, str], graph: nx.Graph) -> dict[str, set[str]]:
    """Return the units that cannot be in the same sheet: their floors overlap in plan at different heights."""
    names = sorted(units)
    shapes = np.array(
        [shapely.union_all([s for s in cells[name].shapes if not s.is_empty]).buffer(APART_M / 2) for name in names]
    )
    pairs = shapely.STRtree(shapes).query(shapes, predicate="intersects").T
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    step, is_sure = floor_rules().flat_step_m, _lie_over(shapes, cells, names, pairs)
    found: dict[str, set[str]] = {unit: set() for unit in units.values()}
    for (i, j), sure in zip(pairs.tolist(), is_sure.tolist(), strict=True):
        a, b = units[names[i]], units[names[j]]
        if b in found[a] or graph.has_edge(names[i], names[j]):
            continue
        if not sure or a == b:
            common = shapes[i].intersection(shapes[j])
            if common.area < _OVERLAP_M2:
                continue
            at = common.representative_point()
            one, two = (cells[names[k]].height_at(at.x, at.y) for k in (i, j))
            if abs(one - two) <= step:
                continue
            if a == b:
                raise InputError(
                    f"{path}: the workings about {names[i]} and {names[j]} lie over each other at "
                    f"({at.x:.1f}, {at.y:.1f}), and no leg between them is long enough for a cut"
                )
        found[a].add(b)
        found[b].add(a)
    return found


def _lie_over(shapes: np.ndarray, cells: dict[str, Cell], names: list[str], pairs: np.ndarray) -> np.ndarray:
    """Return which pairs (k, 2) of cells surely lie over each other: no need to find where they overlap.

    Their floors have no height in common, and one reaches so far into the other that they overlap by half a disc.
    """
    low, high = np.array([cells[name].span_m for name in names]).T
    apart = low[pairs].max(axis=1) - high[pairs].min(axis=1)
    inner = shapely.buffer(shapes, -_INTO_M)
    shapely.prepare(inner)
    return (apart > floor_rules().flat_step_m) & shapely.intersects(inner[pairs[:, 0]], shapes[pairs[:, 1]])


def _polygons(cells: dict[str, Cell], sheet: dict[str, int]) -> list[Polygon]:
    found = []
    for number in range(max(sheet.values()) + 1):
        shapes = [s for node, k in sheet.items() if k == number for s in cells[node].shapes if isinstance(s, Polygon)]
        whole = shapely.union_all([s for s in shapes if not s.is_empty], grid_size=10.0**-_DIGITS)
        part = max(shapely.get_parts(shapely.set_precision(whole, 0.0)), key=lambda part: part.area)
        holes = [ring for ring in part.interiors if Polygon(ring).area > _SPECK_M2]
        found.append(Polygon(part.exterior, holes))
    return found


def _runs(way: Way, sheet: dict[str, int]) -> list[tuple[list[np.ndarray], int]]:
    """Return the pieces of a leg that lie in one sheet, from cut to cut."""
    runs: list[tuple[list[np.ndarray], int]] = []
    if way[0][0] not in sheet:
        return []
    for i, (node, place, _, _) in enumerate(way):
        if node:
            if not runs or runs[-1][1] != sheet[node]:
                runs.append(([way[i - 1][1]] if i else [], sheet[node]))
            runs[-1][0].append(place)
        else:
            runs[-1][0].append(place)
    return [(run, number) for run, number in runs if len(run) > 1]


def _seams(way: Way, sheet: dict[str, int], offsets: np.ndarray) -> list[Seam]:
    """Return the cuts of a leg."""
    seams = []
    for i in range(1, len(way) - 1):
        node, _, left, right = way[i]
        if node or way[0][0] not in sheet:
            continue
        a, b = sheet[way[i - 1][0]], sheet[way[i + 1][0]]
        if a != b:
            ends = [(round(float(x), _DIGITS), round(float(y), _DIGITS)) for x, y in (left, right)]
            seams.append(Seam((a, b), (ends[0], ends[1])))
    return seams
