"""Whether the drifts of a world are connected as in its plan."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment
from shapely import Polygon

from pipeline.geometry.network.skeleton import trace_all_alike
from pipeline.geometry.outline.trace import trace_outline
from pipeline.types import DriftNetwork, Frame, Mask

_SPECK_M2 = 0.25
_CORNER = 1.5  # px: between pixels that touch by a corner, and less than a passage of two pixels
_SMALLEST_COMPONENT_M2 = 1.0
_SAME_FACE_M = 6.0  # a skeleton may end in either corner of a face; the widest drift measures 5.9 m
_REACHED = 2**0.5  # of a chamber's radius, from its middle to its corner
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
    outlines = _without_specks(trace_outline(plan, frame), trace_outline(world, frame), _CORNER / frame.px_per_m)
    shortest_m = [min_leg_m, 1.25 * min_leg_m, 0.75 * min_leg_m]
    (one, sure_one, any_one), (two, sure_two, any_two) = trace_all_alike(outlines, cell_m, shortest_m, _STATIONS_M)
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
        length_plan_m=round(one.total_length_m, 2),
        length_world_m=round(two.total_length_m, 2),
    )


def _without_specks(plan: Polygon, world: Polygon, corner_m: float) -> list[Polygon]:
    """Remove islands that the pixels of a mask do not decide, from both outlines.

    These are islands of a few pixels, and those within `corner_m` of other rock: they arise at pointed or thin rock,
    where pixels touch by a corner only. Of those that meet a sure island of the other outline, which meets no sure one
    of their own, the largest stays.
    """
    islands = [shapely.polygons(np.array(outline.interiors, dtype=object)) for outline in (plan, world)]
    is_sure = [_are_sure(outline, corner_m) for outline in (plan, world)]
    return [
        Polygon(outline.exterior, [one.exterior for one in (*own[sure], *_largest_at(own[~sure], own[sure], of_other))])
        for outline, own, sure, of_other in zip(
            (plan, world), islands, is_sure, (islands[1][is_sure[1]], islands[0][is_sure[0]]), strict=True
        )
    ]


def _largest_at(unsure: np.ndarray, sure: np.ndarray, of_other: np.ndarray) -> list[Polygon]:
    """Return the largest unsure island at each island of the other outline that meets no sure one."""
    met = shapely.STRtree(sure).query(of_other, predicate="intersects")[0]
    lone = np.delete(of_other, np.unique(met))
    at, found = shapely.STRtree(unsure).query(lone, predicate="intersects")
    area = shapely.area(unsure)
    return [unsure[max(found[at == k], key=lambda one: area[one])] for k in np.unique(at)]


def _are_sure(outline: Polygon, corner_m: float) -> np.ndarray:
    """Return which islands (n,) of an outline are larger than a speck, and apart from other rock but specks."""
    islands = shapely.polygons(np.array(outline.interiors, dtype=object))
    large = shapely.area(islands) > _SPECK_M2
    rock = shapely.STRtree([outline.exterior, *islands[large]])
    near = rock.query(islands, predicate="dwithin", distance=corner_m)[0]
    alone = np.bincount(near, minlength=len(islands)) == 1  # itself
    found: np.ndarray = large & alone
    return found


def _count_unmatched(drifts: DriftNetwork, among: DriftNetwork) -> int:
    """Count the dead ends of one network that have no match in another; the matching has the least total distance.

    Ends match within 6 m, or within the width of the chamber in which both end, if it is wider: a skeleton may end in
    the middle of a chamber or at any place of its wall.
    """
    ends = np.array([drifts.nodes_m[name] for name in drifts.dead_ends]).reshape(-1, 1, 2)
    others = np.array([among.nodes_m[name] for name in among.dead_ends]).reshape(1, -1, 2)
    distance = np.linalg.norm(ends - others, axis=2)
    same = distance <= np.maximum(_SAME_FACE_M, np.minimum(_chambers_m(drifts)[:, None], _chambers_m(among)[None, :]))
    # A pair beyond the limit costs more than all pairs within it together, so it is never preferred.
    matched = linear_sum_assignment(np.where(same, distance, 1e6))
    return len(ends) - int(same[matched].sum())


def _chambers_m(network: DriftNetwork) -> np.ndarray:
    """Return the width (n,) m of the workings at each dead end: of the widest disc on its leg that holds it."""
    widths = []
    for name in network.dead_ends:
        leg = next(leg for leg in network.legs if name in (leg.start, leg.end))
        half = np.array(leg.half_width_m)
        away = np.linalg.norm(np.array(leg.stations_m) - network.nodes_m[name], axis=1)
        widths.append(2 * half[away <= _REACHED * half].max(initial=0.0))
    return np.array(widths)


def _count_components(mask: Mask, frame: Frame) -> int:
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    return int((stats[1:, cv2.CC_STAT_AREA] > _SMALLEST_COMPONENT_M2 * frame.px_per_m**2).sum())
