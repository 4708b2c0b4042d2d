"""Whether the legs of a survey are as wide in a volume as the survey has them."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.floors.volume_arrays import VolumeFacets, each_of
from pipeline.geometry.raycast import RayCaster
from pipeline.metrics.leg_widths import KEPT, SAMPLE_M
from pipeline.volume.network import SurveyNetwork

_HIGH = 0.4  # of a passage's height over its floor, where its walls are plumb
_END = 0.002  # of a leg's length, from its stations
_LEAST_M = 0.3  # of a width that is compared
_TOLERANCE_M = 0.004  # by which the mesh of a volume is simplified
_NO_RUN_M = 1e-3  # in plan


def width_figures(network: SurveyNetwork, offset: np.ndarray, mine: VolumeFacets) -> dict[str, Any]:
    """Return the least share of a leg's width, and the share of the length with less than 95 % of it, less 4 mm a wall.

    Widths are level, square to each leg, at 40 % of its height over the floor, every 0.25 m. On either side half of the
    survey's width counts at most, so that no room on one side makes up for rock on the other. Legs over 45 deg have
    level sections, and do not count. The network is moved by `offset` (3,) m into the mine frame.
    """
    floors, lrud = network.floors_m + offset, network.lrud_m
    step = floors[:, 1, :2] - floors[:, 0, :2]
    run = np.linalg.norm(step, axis=1)
    rise = np.minimum(np.abs(np.diff(network.ends_m[:, :, 2])), np.abs(np.diff(floors[:, :, 2])))[:, 0]
    count = np.where(run > np.maximum(rise, _NO_RUN_M), np.maximum(3, np.ceil(run / SAMPLE_M).astype(int)), 0)
    leg, number = each_of(count)
    share = (_END + number / np.maximum(count[leg] - 1, 1) * (1 - 2 * _END))[:, None]
    walls = (1 - share) * lrud[leg, 0] + share * lrud[leg, 1]
    half = walls[:, :2].sum(axis=1) / 2
    across = np.column_stack([-step[leg, 1], step[leg, 0], np.zeros(len(leg))]) / run[leg][:, None]
    middles = (1 - share) * floors[leg, 0] + share * floors[leg, 1] + across * (walls[:, :1] - walls[:, 1:2]) / 2
    middles[:, 2] += _HIGH * walls[:, 2:].sum(axis=1)
    rays = RayCaster(mine.vertices[mine.faces])
    built = sum(np.minimum(rays.cast(middles, way), half) for way in (across, -across))
    counts = 2 * half >= _LEAST_M
    share = np.where(counts, built / np.maximum(2 * half, _LEAST_M), 1.0)
    is_narrow = counts & (built < KEPT * 2 * half - 2 * _TOLERANCE_M)
    spacing = (run / np.maximum(count - 1, 1))[leg]
    least = int(share.argmin())
    place = ", ".join(f"{value:.1f}" for value in middles[least])
    return {
        "least_width_share": round(float(share[least]), 4),
        "least_width_at": f"leg {network.leg_name(int(leg[least]))} at ({place})",
        "narrow_share": round(float(spacing[is_narrow].sum() / max(spacing[counts].sum(), _NO_RUN_M)), 6),
        "narrow_at": f"leg {network.leg_name(int(leg[least]))} at ({place})" if is_narrow.any() else "",
    }
