"""The cells that a robot can reach, and whether the reached workings of plan and world have the same network."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from networkx.utils import UnionFind
from scipy.ndimage import binary_dilation
from scipy.optimize import linear_sum_assignment

from pipeline.errors import GeometryError
from pipeline.geometry.network.skeleton import trace_alike
from pipeline.geometry.outline.trace import trace_outline
from pipeline.geometry.runs import connected_runs
from pipeline.types import DriftNetwork, Frame, Mask

_STATIONS_M = 3.0
_UNMATCHED_COST = 1e6


@dataclass(frozen=True)
class ReachMatch:
    """Comparison of the area that a robot reaches in the world with the area that it reaches in the plan.

    `only_world_m2` and `only_plan_m2` are the areas that are reached in one of them only. `same_graph` is true when
    both drift networks are the same graph. The difference is the largest between the lengths of matched legs; it is
    None when the graphs differ.
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


def reached_cells(fits: Mask, start: tuple[int, int]) -> Mask:
    """Return the cells connected by edges to the start cell; no cell if the robot does not fit at the start."""
    runs = connected_runs(fits)
    at = np.flatnonzero((runs.row == start[0]) & (runs.start <= start[1]) & (start[1] < runs.stop))
    reached = np.zeros_like(fits)
    for run in np.flatnonzero(np.isin(runs.part, runs.part[at])).tolist():
        reached[runs.row[run], runs.start[run] : runs.stop[run]] = True
    return reached


def compare_reach(
    plan: Mask, world: Mask, frame: Frame, radius_m: float, cell_m: float, min_leg_m: float
) -> ReachMatch:
    """Compare the reached cells of plan and world, and the networks traced from them; rows run from the north.

    Parameters
    ----------
    plan, world : (rows, cols) bool
    frame : Frame
        The grid of the cells.
    radius_m : float
        The robot's radius; reached cells are dilated by it before a network is traced.
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
    if (plan == world).all():  # the same cells have the same network
        (one,) = trace_alike([trace_outline(binary_dilation(plan, disc), frame)], cell_m, min_leg_m, _STATIONS_M)
        return one, one
    outlines = [trace_outline(binary_dilation(mask, disc), frame) for mask in (plan, world)]
    one, two = trace_alike(outlines, cell_m, min_leg_m, _STATIONS_M)
    return one, two


def _same_graph(one: DriftNetwork, two: DriftNetwork, node_m: float) -> tuple[bool, float | None]:
    """Return whether legs join the same matched nodes, and if so the largest difference of leg lengths, m."""
    (nodes, legs), (other_nodes, other_legs) = (_merge_close_junctions(network, node_m) for network in (one, two))
    if len(nodes) != len(other_nodes) or len(legs) != len(other_legs):
        return False, None
    names, other_names = list(nodes), list(other_nodes)
    ends = np.array([nodes[n] for n in names]).reshape(-1, 1, 2)
    other_ends = np.array([other_nodes[n] for n in other_names]).reshape(1, -1, 2)
    distance = np.linalg.norm(ends - other_ends, axis=2)
    rows, columns = linear_sum_assignment(np.where(distance <= node_m, distance, _UNMATCHED_COST))
    if len(rows) and distance[rows, columns].max() > node_m:
        return False, None
    match = {names[r]: other_names[c] for r, c in zip(rows, columns, strict=True)}
    ours = _lengths([(match[start], match[end], length) for start, end, length in legs])
    theirs = _lengths(other_legs)
    if {k: len(v) for k, v in ours.items()} != {k: len(v) for k, v in theirs.items()}:
        return False, None
    return True, max((abs(a - b) for k in ours for a, b in zip(ours[k], theirs[k], strict=True)), default=0.0)


def _merge_close_junctions(
    network: DriftNetwork, node_m: float
) -> tuple[dict[str, np.ndarray], list[tuple[str, str, float]]]:
    """Return nodes and legs after merging junctions that short legs join into one node at their mean.

    A skeleton shows a crossing as one junction or as two close ones, depending on details of the walls. Loops stay.
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
    lengths: dict[tuple[str, ...], list[float]] = {}
    for start, end, length in legs:
        lengths.setdefault(tuple(sorted((start, end))), []).append(length)
    return {k: sorted(v) for k, v in lengths.items()}


def start_cell(place_m: tuple[float, float], frame: Frame) -> tuple[int, int]:
    """Return the row and column of a place.

    Raises
    ------
    GeometryError
        If the place lies outside the frame.
    """
    col, row = np.floor(frame.to_image(np.array([place_m]))[0]).astype(int).tolist()
    if not (0 <= row < frame.height_px and 0 <= col < frame.width_px):
        raise GeometryError(f"reach: ({place_m[0]:g}, {place_m[1]:g}) m lies outside the grid")
    return row, col
