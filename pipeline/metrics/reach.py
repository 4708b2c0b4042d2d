"""Where a robot can get: the reached cells of two clearance fields, and whether their drift networks are one graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from networkx.utils import UnionFind
from scipy.ndimage import binary_dilation, label
from scipy.optimize import linear_sum_assignment

from pipeline.errors import GeometryError
from pipeline.geometry.outline import trace_outline
from pipeline.geometry.skeleton import trace_alike
from pipeline.types import DriftNetwork, Frame, Mask

_STATIONS_M = 3.0
_NEVER = 1e6


@dataclass(frozen=True)
class ReachMatch:
    """What a robot reaches in the world against the plan.

    Areas, m2, that only one of them lets it reach; whether the two drift networks are the same graph (nodes matched
    within `node_m`); the greatest difference of matched legs' lengths, m, none unless it is; and both networks' loops
    and dead ends.
    """

    reached_m2: float
    only_world_m2: float
    only_plan_m2: float
    same_graph: bool
    largest_chainage_difference_m: float | None
    loops_plan: int
    loops_world: int
    dead_ends_plan: int
    dead_ends_world: int


def reached_cells(clearance_m: np.ndarray, radius_m: float, start: tuple[int, int]) -> Mask:
    """Return the cells that hang together (by edges) with a start cell where a robot of a radius fits; none if not."""
    parts, _ = label(clearance_m >= radius_m)
    return np.asarray((parts == parts[start]) & (parts[start] > 0), dtype=bool)


def compare_reach(
    plan: Mask, world: Mask, frame: Frame, radius_m: float, cell_m: float, min_leg_m: float
) -> ReachMatch:
    """Compare reached cells (rows from the north, as in a plan's pixels) of plan and world, and their networks.

    Parameters
    ----------
    plan, world : (rows, cols) bool
    frame : Frame
        The cells as pixels.
    radius_m : float
        The robot's; cells within it of a reached cell count to the traced workings.
    cell_m, min_leg_m : float
        See `trace_network`.
    """
    area = 1 / frame.px_per_m**2
    one, two = _networks(plan, world, frame, radius_m, cell_m, min_leg_m)
    same, difference = _same_graph(one, two, node_m=2 * radius_m + 1.0)
    return ReachMatch(
        reached_m2=round(float(world.sum()) * area, 3),
        only_world_m2=round(float((world & ~plan).sum()) * area, 3),
        only_plan_m2=round(float((plan & ~world).sum()) * area, 3),
        same_graph=same,
        largest_chainage_difference_m=None if difference is None else round(difference, 4),
        loops_plan=one.loops,
        loops_world=two.loops,
        dead_ends_plan=len(one.dead_ends),
        dead_ends_world=len(two.dead_ends),
    )


def _networks(
    plan: Mask, world: Mask, frame: Frame, radius_m: float, cell_m: float, min_leg_m: float
) -> tuple[DriftNetwork, DriftNetwork]:
    steps = max(1, round(radius_m * frame.px_per_m))
    y, x = np.ogrid[-steps : steps + 1, -steps : steps + 1]
    disc = x * x + y * y <= steps * steps
    outlines = [trace_outline(binary_dilation(mask, disc), frame) for mask in (plan, world)]
    one, two = trace_alike(outlines, cell_m, min_leg_m, _STATIONS_M)
    return one, two


def _same_graph(one: DriftNetwork, two: DriftNetwork, node_m: float) -> tuple[bool, float | None]:
    """Say whether matched nodes are joined by the same legs, and if so how far the legs' lengths differ, m."""
    (nodes, legs), (others, their_legs) = (_joined_crossings(network, node_m) for network in (one, two))
    if len(nodes) != len(others) or len(legs) != len(their_legs):
        return False, None
    names, twins = list(nodes), list(others)
    apart = np.linalg.norm(
        np.array([nodes[n] for n in names]).reshape(-1, 1, 2) - np.array([others[n] for n in twins]).reshape(1, -1, 2),
        axis=2,
    )
    rows, columns = linear_sum_assignment(np.where(apart <= node_m, apart, _NEVER))
    if len(rows) and apart[rows, columns].max() > node_m:
        return False, None
    twin = {names[r]: twins[c] for r, c in zip(rows, columns, strict=True)}
    ours = _lengths([(twin[start], twin[end], length) for start, end, length in legs])
    theirs = _lengths(their_legs)
    if {k: len(v) for k, v in ours.items()} != {k: len(v) for k, v in theirs.items()}:
        return False, None
    return True, max((abs(a - b) for k in ours for a, b in zip(ours[k], theirs[k], strict=True)), default=0.0)


def _joined_crossings(
    network: DriftNetwork, node_m: float
) -> tuple[dict[str, np.ndarray], list[tuple[str, str, float]]]:
    """Return nodes and legs, each group of junctions that short legs join made one node at their middle.

    A skeleton has a crossing as one junction or as two beside each other, by a hair of its walls; loops stay.
    """
    groups: UnionFind = UnionFind(network.nodes_m)
    junctions, kept = set(network.junctions), []
    for leg in network.legs:
        if {leg.start, leg.end} <= junctions and leg.length_m < node_m and groups[leg.start] != groups[leg.end]:
            groups.union(leg.start, leg.end)
        else:
            kept.append(leg)
    nodes = {groups[min(g)]: np.mean([network.nodes_m[n] for n in g], axis=0) for g in groups.to_sets()}
    return nodes, [(groups[leg.start], groups[leg.end], leg.length_m) for leg in kept]


def _lengths(legs: list[tuple[str, str, float]]) -> dict[tuple[str, ...], list[float]]:
    """Return the sorted lengths, m, of the legs between each pair of nodes."""
    found: dict[tuple[str, ...], list[float]] = {}
    for start, end, length in legs:
        found.setdefault(tuple(sorted((start, end))), []).append(length)
    return {k: sorted(v) for k, v in found.items()}


def start_cell(place_m: tuple[float, float], frame: Frame) -> tuple[int, int]:
    """Return the row and column of a place.

    Raises
    ------
    GeometryError
        If it lies outside the frame.
    """
    col, row = np.floor(frame.to_image(np.array([place_m]))[0]).astype(int).tolist()
    if not (0 <= row < frame.height_px and 0 <= col < frame.width_px):
        raise GeometryError(f"reach: ({place_m[0]:g}, {place_m[1]:g}) m lies outside the grid")
    return row, col
