"""Several sheets in one plan: where they join, their network, and the area inside their outlines."""

from __future__ import annotations

import numpy as np
import shapely
from networkx.utils import UnionFind
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import GeometryError
from pipeline.geometry.network.leg_graph import OpenEnd, ends_at
from pipeline.geometry.network.skeleton import trace_network
from pipeline.types import DriftNetwork, Leg

Place = tuple[float, float]
_SAME_M = 0.001  # between a seam's end and the outline's vertex there
SeamPlaces = tuple[Place, Place]  # the middle of a seam in the plan of either sheet, m


def whole_of(polygons: MultiPolygon) -> BaseGeometry:
    """Return the only polygon of a plan, or all if there are several sheets."""
    return polygons.geoms[0] if len(polygons.geoms) == 1 else polygons


def filled(outline: BaseGeometry) -> BaseGeometry:
    """Return the area inside the outer walls, islands included."""
    rings = [Polygon(part.exterior) for part in shapely.get_parts(outline)]
    return rings[0] if len(rings) == 1 else shapely.union_all(rings)


def count_islands(outline: BaseGeometry) -> int:
    """Return the number of islands."""
    return sum(len(part.interiors) for part in shapely.get_parts(outline))


def trace_sheets(
    free: BaseGeometry, seams: list[SeamPlaces], cell_m: float, min_leg_m: float, station_spacing_m: float
) -> DriftNetwork:
    """Trace the network of each sheet, and join them: an end at a seam is no dead end, and loops may cross seams.

    A leg to a seam is kept, however short it is in its sheet.

    Raises
    ------
    GeometryError
        If a sheet has no network, or the sheets are not connected.
    """
    parts = shapely.get_parts(free)
    numbers = [_sheets_at(parts, seam) for seam in seams]
    open_m: list[list[OpenEnd]] = [[] for _ in parts]
    for seam, pair in zip(seams, numbers, strict=True):
        for place, k in zip(seam, pair, strict=True):
            open_m[k].append(_open_edge(parts[k], place))
    sheets = _trace_alike(parts, open_m, cell_m, min_leg_m, station_spacing_m)
    nodes: dict[str, Place] = {}
    junctions: list[str] = []
    ends: list[str] = []
    legs: list[Leg] = []
    of_sheet: list[dict[str, str]] = []
    for sheet in sheets:
        name = {n: f"{n[0]}{len(ends) + i:02d}" for i, n in enumerate(sheet.dead_ends)}
        others = [n for n in sheet.nodes_m if n not in name]
        name |= {n: f"J{len(nodes) - len(ends) + i:02d}" for i, n in enumerate(others)}
        nodes |= {name[n]: place for n, place in sheet.nodes_m.items()}
        junctions += [name[n] for n in sheet.junctions]
        ends += [name[n] for n in sheet.dead_ends]
        of_sheet.append(name)
        for leg in sheet.legs:
            own = f"L{len(legs):02d}"
            legs.append(Leg(own, name[leg.start], name[leg.end], *list(vars(leg).values())[3:]))
    joined: UnionFind = UnionFind(range(len(sheets)))
    for pair in numbers:
        joined.union(*pair)
    closed = {
        own[sheet.dead_ends[row]]
        for sheet, own, edges in zip(sheets, of_sheet, open_m, strict=True)
        for row in ends_at([sheet.nodes_m[end] for end in sheet.dead_ends], edges)
    }
    components = len({joined[k] for k in range(len(sheets))})
    if components > 1:
        raise GeometryError(f"sheets: {len(sheets)} sheets in {components} pieces that no seam joins")
    main = max(range(len(sheets)), key=lambda k: sheets[k].main_drift_length_m)
    return DriftNetwork(
        nodes_m=nodes,
        legs=legs,
        junctions=junctions,
        dead_ends=[n for n in ends if n not in closed],
        loops=sum(sheet.loops for sheet in sheets) + len(seams) - len(sheets) + 1,
        components=1,
        total_length_m=round(sum(sheet.total_length_m for sheet in sheets), 2),
        main_drift=[of_sheet[main][n] for n in sheets[main].main_drift],
        main_drift_m=sheets[main].main_drift_m,
        main_drift_length_m=sheets[main].main_drift_length_m,
        cell_m=sheets[0].cell_m,
    )


def _sheets_at(parts: np.ndarray, seam: SeamPlaces) -> tuple[int, int]:
    """Return the numbers of the sheets on either side of a seam."""
    one, two = (int(shapely.distance(parts, shapely.Point(place)).argmin()) for place in seam)
    return one, two


def _open_edge(part: Polygon, place: Place) -> OpenEnd:
    """Return the edge of a sheet that lies on a seam."""
    rings = [np.asarray(ring.coords)[:, :2] for ring in (part.exterior, *part.interiors)]
    edges = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    nearest = int(shapely.distance(shapely.linestrings(edges), shapely.Point(place)).argmin())
    return (*place, float(np.linalg.norm(edges[nearest] - place, axis=1).max()))


def _trace_alike(
    parts: np.ndarray, open_m: list[list[OpenEnd]], cell_m: float, min_leg_m: float, spacing_m: float
) -> list[DriftNetwork]:
    """Trace the sheets in cells of the same size, the smallest that one of them needs."""
    pairs = list(zip(parts, open_m, strict=True))
    sheets = [trace_network(part, cell_m, min_leg_m, spacing_m, edges) for part, edges in pairs]
    finest = min(sheet.cell_m for sheet in sheets)
    return [
        sheet if sheet.cell_m == finest else trace_network(part, finest, min_leg_m, spacing_m, edges)
        for sheet, (part, edges) in zip(sheets, pairs, strict=True)
    ]
