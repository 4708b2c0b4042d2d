"""Whether the drifts of a world are connected as in its plan."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment
from shapely import Polygon

from pipeline.geometry.outline import trace_outline
from pipeline.geometry.skeleton import trace_alike
from pipeline.types import DriftNetwork, Frame, Mask

_SPECK_M2 = 0.25
_SMALLEST_COMPONENT_M2 = 1.0
_SAME_FACE_M = 6.0  # a skeleton may end in either corner of a face; the widest drift measures 5.9 m
_STATIONS_M = 3.0


@dataclass(frozen=True)
class TopologyMatch:
    """Loops, drifts (legs of the network), dead ends and components of plan and world.

    `drifts_lost` counts the plan's dead-end drifts that are missing in the world, `drifts_added` the world's that are
    missing in the plan. A stub whose length is within a quarter of the threshold may be traced in one of them only; it
    counts as neither.
    """

    loops_plan: int
    loops_world: int
    loops_difference: int
    drifts_plan: int
    drifts_world: int
    drifts_lost: int
    drifts_added: int
    components_plan: int
    components_world: int
    length_plan_m: float
    length_world_m: float


def compare_topology(plan: Mask, world: Mask, frame: Frame, cell_m: float, min_leg_m: float) -> TopologyMatch:
    """Trace the drift networks of two masks in the same way and compare them.

    Parameters
    ----------
    plan, world : (rows, cols) bool
        Free pixels of the cleaned plan and of the rendered world.
    frame : Frame
    cell_m, min_leg_m : float
        See `trace_network`.
    """
    outlines = [_without_specks(trace_outline(mask, frame)) for mask in (plan, world)]
    one, two = trace_alike(outlines, cell_m, min_leg_m, _STATIONS_M)
    sure_one, sure_two = trace_alike(outlines, one.cell_m, 1.25 * min_leg_m, _STATIONS_M)
    any_one, any_two = trace_alike(outlines, one.cell_m, 0.75 * min_leg_m, _STATIONS_M)
    return TopologyMatch(
        loops_plan=one.loops,
        loops_world=two.loops,
        loops_difference=abs(one.loops - two.loops),
        drifts_plan=len(one.legs),
        drifts_world=len(two.legs),
        drifts_lost=_count_unmatched(sure_one, any_two),
        drifts_added=_count_unmatched(sure_two, any_one),
        components_plan=_count_components(plan, frame),
        components_world=_count_components(world, frame),
        length_plan_m=one.total_length_m,
        length_world_m=two.total_length_m,
    )


def _without_specks(outline: Polygon) -> Polygon:
    """Remove islands of a few pixels; they arise at pointed rock, where pixels touch by a corner only."""
    return Polygon(outline.exterior, [ring for ring in outline.interiors if Polygon(ring).area > _SPECK_M2])


def _count_unmatched(drifts: DriftNetwork, among: DriftNetwork) -> int:
    """Count the dead ends of one network that have no match in another; the matching has the least total distance."""
    ends = np.array([drifts.nodes_m[name] for name in drifts.dead_ends]).reshape(-1, 1, 2)
    others = np.array([among.nodes_m[name] for name in among.dead_ends]).reshape(1, -1, 2)
    distance = np.linalg.norm(ends - others, axis=2)
    # A pair beyond the limit costs more than all pairs within it together, so it is never preferred.
    matched = linear_sum_assignment(np.where(distance <= _SAME_FACE_M, distance, 1e6))
    return len(ends) - int((distance[matched] <= _SAME_FACE_M).sum())


def _count_components(mask: Mask, frame: Frame) -> int:
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    return int((stats[1:, cv2.CC_STAT_AREA] > _SMALLEST_COMPONENT_M2 * frame.px_per_m**2).sum())
