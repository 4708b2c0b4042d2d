"""Whether a survey's legs are as wide in the workings as it has them, and whether robots get along them."""

from __future__ import annotations

from dataclasses import dataclass, field

import networkx as nx
import numpy as np
import shapely
from shapely import MultiPolygon, Point, Polygon

SAMPLE_M = 0.25  # along a leg
KEPT = 0.95  # of the survey's width
BESIDE = 0.05  # of the width, by which a section may lie beside where it was surveyed
_END_M = 0.01  # from a leg's ends, where sections lie on the edges of others


@dataclass(frozen=True)
class SurveyedSections:
    """Sections along the legs of a survey, in plan, m, mine frame.

    Attributes
    ----------
    middles_m : (n, 2) float64
        Between the walls.
    across : (n, 2) float64
        Unit vectors to the left, square to the legs.
    widths_m : (n,) float64
    on_legs_m : (n, 2) float64
        The places on the legs.
    leg : (n,) int64
        The number of each one's leg.
    ends : list of (str, str)
        The stations of each leg.
    """

    middles_m: np.ndarray
    across: np.ndarray
    widths_m: np.ndarray
    on_legs_m: np.ndarray
    leg: np.ndarray
    ends: list[tuple[str, str]] = field(default_factory=list)

    def __len__(self) -> int:
        """Return the number of sections."""
        return len(self.leg)

    def describe(self, section: int) -> str:
        """Return where a section is: its leg by its stations, and the place on it."""
        one, other = self.ends[int(self.leg[section])]
        x, y = self.on_legs_m[section]
        return f"leg {one} to {other} at ({x:.1f}, {y:.1f})"


def sections_along(places_m: np.ndarray, walls_m: np.ndarray, ends: list[tuple[str, str]]) -> SurveyedSections:
    """Return sections every 0.25 m along legs, at least three a leg; legs without a length in plan have none.

    Parameters
    ----------
    places_m : (n, 2, 2) float64, m
        Both ends of each leg.
    walls_m : (n, 2, 2) float64, m
        Distances to the left and right wall at both ends; between them they vary evenly.
    ends : list of (str, str)
        The names of the stations.
    """
    step = places_m[:, 1] - places_m[:, 0]
    length = np.linalg.norm(step, axis=1)
    count = np.where(length > 2 * _END_M, np.maximum(3, np.ceil(length / SAMPLE_M).astype(int)), 0)
    leg = np.repeat(np.arange(len(length)), count)
    number = np.arange(len(leg)) - np.repeat(np.cumsum(count) - count, count)
    inner = _END_M + number / np.maximum(count[leg] - 1, 1) * (length[leg] - 2 * _END_M)
    share = (inner / np.maximum(length[leg], _END_M))[:, None]
    on_legs = places_m[leg, 0] + share * step[leg]
    walls = (1 - share) * walls_m[leg, 0] + share * walls_m[leg, 1]
    ahead = step[leg] / np.maximum(length[leg], _END_M)[:, None]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    middles = on_legs + across * (walls[:, :1] - walls[:, 1:]) / 2
    return SurveyedSections(middles, across, walls.sum(axis=1), on_legs, leg, ends)


def free_widths(free: Polygon | MultiPolygon, sections: SurveyedSections) -> np.ndarray:
    """Return the longest free stretch (n,) m of each section; it may lie beside it by 5 % of its width.

    Parameters
    ----------
    free : Polygon or MultiPolygon, m, mine frame
    sections : SurveyedSections
    """
    reach = (0.5 + BESIDE) * sections.widths_m
    lines = sections.middles_m[:, None] + reach[:, None, None] * np.stack([sections.across, -sections.across], axis=1)
    edges = _edges(free)
    section, edge = shapely.STRtree(shapely.linestrings(edges)).query(shapely.linestrings(lines))
    aside = np.einsum("ned,nd->ne", edges[edge] - lines[section, :1], _quarter(sections.across[section]))
    crosses = (aside[:, 0] >= 0) != (aside[:, 1] >= 0)  # half open: a corner on the line counts once
    section, edge, aside = section[crosses], edge[crosses], aside[crosses]
    share = (aside[:, 0] / (aside[:, 0] - aside[:, 1]))[:, None]
    places = edges[edge, 0] + share * (edges[edge, 1] - edges[edge, 0])
    way = -np.einsum("nd,nd->n", places - lines[section, 0], sections.across[section])
    inner = (way > 0) & (way < 2 * reach[section])
    count = len(sections)
    owner = np.concatenate([np.arange(count), section[inner], np.arange(count)])
    at = np.concatenate([np.zeros(count), way[inner], 2 * reach])
    order = np.lexsort([at, owner])
    owner, at = owner[order], at[order]
    same = np.flatnonzero(owner[1:] == owner[:-1])
    middle, size, owner = (at[same] + at[same + 1]) / 2, np.diff(at)[same], owner[same]
    shapely.prepare(free)
    is_free = shapely.contains_xy(free, *(lines[owner, 0] - middle[:, None] * sections.across[owner]).T)
    found = np.zeros(count)
    np.maximum.at(found, owner, np.where(is_free, size, 0.0))
    return found


def _edges(free: Polygon | MultiPolygon) -> np.ndarray:
    """Return the edges (k, 2, 2) m of all rings."""
    rings = shapely.get_rings(shapely.get_parts(free))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    edges: np.ndarray = np.stack([points[:-1], points[1:]], axis=1)[same]
    return edges


def _quarter(across: np.ndarray) -> np.ndarray:
    """Return vectors (n, 2) a quarter turn to the left."""
    return np.column_stack([-across[:, 1], across[:, 0]])


@dataclass(frozen=True)
class LegFigures:
    """How a survey's legs are built, as far as its own widths let a robot get from its start.

    Attributes
    ----------
    least_width_share : float
        Of the survey's width, at most 1, and where.
    narrowed_m : float
        By how much a leg is narrower than 95 % of the survey's width, beyond the tolerance of its walls, and where.
    reached_share : float
        Of the workings' area, what a robot's disc covers.
    cut_off_m : float
        Length of legs to which no robot gets, although the survey has all the way wide enough, and where they begin.
    """

    least_width_share: float
    least_width_at: str
    narrowed_m: float
    narrowed_at: str
    reached_share: float
    cut_off_m: float
    cut_off_at: str


def measure_legs(
    free: Polygon | MultiPolygon,
    sections: SurveyedSections,
    start_m: tuple[float, float],
    radius_m: float,
    tolerance_m: float,
) -> LegFigures:
    """Compare the legs of a survey with the workings that were built.

    Parts of the survey that its own widths part from the start do not count: they need not be built.

    Parameters
    ----------
    free : Polygon or MultiPolygon, m, mine frame
    sections : SurveyedSections
    start_m : (float, float), m
        Where robots start.
    radius_m : float
        Of the robot.
    tolerance_m : float
        By which each wall may be nearer than it was surveyed.
    """
    middles = shapely.get_parts(free.buffer(-radius_m))
    at = shapely.distance(middles, Point(start_m)) if len(middles) else np.full(1, np.inf)
    if at.min() > radius_m:
        return LegFigures(0.0, "where robots start", 0.0, "", 0.0, 0.0, "")
    reached = middles[int(at.argmin())]
    half = sections.across * sections.widths_m[:, None] / 2
    lines = shapely.linestrings(np.stack([sections.middles_m - half, sections.middles_m + half], axis=1))
    shapely.prepare(reached)
    is_reached = shapely.intersects(reached, lines)
    wide = sections.widths_m >= 2 * (radius_m + tolerance_m)
    counts = wide & _joined_to(sections, wide, is_reached)
    cut = np.flatnonzero(counts & ~is_reached)
    widths = free_widths(free, sections)
    share = np.where(counts, widths / np.maximum(sections.widths_m, radius_m), 1.0).clip(0.0, 1.0)
    narrowed = np.where(counts, KEPT * sections.widths_m - 2 * tolerance_m - widths, 0.0).clip(0.0)
    least, most = int(share.argmin()), int(narrowed.argmax())
    return LegFigures(
        float(share[least]),
        sections.describe(least),
        float(narrowed[most]),
        sections.describe(most) if narrowed[most] > 0 else "",
        float(reached.buffer(radius_m).intersection(free).area / free.area),
        float(_spacing(sections)[cut].sum()),
        sections.describe(int(cut[0])) if len(cut) else "",
    )


def _joined_to(sections: SurveyedSections, wide: np.ndarray, is_reached: np.ndarray) -> np.ndarray:
    """Return which sections (n,) are joined by wide ones along the legs to one that is wide and reached."""
    graph: nx.Graph = nx.Graph()
    graph.add_nodes_from(np.flatnonzero(wide).tolist())
    follow = np.flatnonzero((sections.leg[1:] == sections.leg[:-1]) & wide[1:] & wide[:-1])
    graph.add_edges_from(zip(follow.tolist(), (follow + 1).tolist(), strict=True))
    first = np.flatnonzero(np.append(True, sections.leg[1:] != sections.leg[:-1]))
    last = np.append(first[1:], len(sections)) - 1
    for begin, end in zip(first.tolist(), last.tolist(), strict=True):
        for section, station in zip((begin, end), sections.ends[int(sections.leg[begin])], strict=True):
            if wide[section]:
                graph.add_edge(section, station)
    found = np.zeros(len(sections), bool)
    for part in nx.connected_components(graph):
        some = np.array([one for one in part if isinstance(one, int)], int)
        found[some] = is_reached[some].any()
    return found


def _spacing(sections: SurveyedSections) -> np.ndarray:
    """Return the length (n,) m of leg that each section stands for."""
    step = np.linalg.norm(np.diff(sections.on_legs_m, axis=0), axis=1) * (np.diff(sections.leg) == 0)
    found: np.ndarray = (np.append(step, 0.0) + np.append(0.0, step)) / 2
    return found
