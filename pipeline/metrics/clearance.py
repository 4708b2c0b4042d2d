"""Visible rock against collision walls: the gaps between them, and the clear width that remains in passages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import Polygon

from pipeline.geometry.network.skeleton import LEAST_HALF_WIDTH_M, passage_stations
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.types import DriftNetwork

_NUDGES_M = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])  # rough walls move the widest place of a section a little


@dataclass(frozen=True)
class WallGaps:
    """Distances, m, between visible rock and collision wall at one height, and the clear widths of passages.

    `narrowest_kept` and `median_kept` are the shares of the plan's clear width that the visible rock leaves, in the
    narrowest passage and at the median station. Of a room without a passage they are 1, and the widths 0.
    """

    gap_median_m: float
    gap_p95_m: float
    gap_max_m: float
    into_workings_share: float
    narrowest_plan_m: float
    narrowest_seen_m: float
    narrowest_kept: float
    median_kept: float


def measure_walls(seen: np.ndarray, free: Polygon, network: DriftNetwork) -> WallGaps:
    """Compare visible wall points (n, 2) m at one height with the free space that the collision walls enclose.

    Passages are the network's stations, except those nearer to a dead end than their own half width.
    """
    gap = distances_to_walls(free, seen)
    stations, half = passage_stations(network)
    stations = stations[half >= LEAST_HALF_WIDTH_M]
    nudge = np.stack(np.meshgrid(_NUDGES_M, _NUDGES_M), axis=-1).reshape(-1, 2)
    places = (stations[:, None, :] + nudge).reshape(-1, 2)
    inside = shapely.contains_xy(free, places[:, 0], places[:, 1])
    plan = np.where(inside, distances_to_walls(free, places), 0.0)
    rock = np.where(inside, cKDTree(seen).query(places)[0], 0.0)
    plan, rock = (np.max(v.reshape(-1, len(nudge)), axis=1, initial=0.0) for v in (plan, rock))
    kept = rock / np.maximum(plan, 1e-9)
    if not len(plan):
        plan, rock, kept = np.zeros(1), np.zeros(1), np.ones(1)
    narrow = int(plan.argmin())
    return WallGaps(
        gap_median_m=round(float(np.median(gap)), 4),
        gap_p95_m=round(float(np.percentile(gap, 95)), 4),
        gap_max_m=round(float(gap.max()), 4),
        into_workings_share=round(float(shapely.contains_xy(free, seen[:, 0], seen[:, 1]).mean()), 4),
        narrowest_plan_m=round(2 * float(plan[narrow]), 3),
        narrowest_seen_m=round(2 * float(rock[narrow]), 3),
        narrowest_kept=round(float(kept[narrow]), 4),
        median_kept=round(float(np.median(kept)), 4),
    )
