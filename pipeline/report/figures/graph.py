"""Tables of the widths of drifts and of blocked columns."""

from __future__ import annotations

import numpy as np

from pipeline.types import DriftNetwork, Points2


def width_table(network: DriftNetwork) -> str:
    """Return the clear width along every leg as CSV: leg, chainage_m, easting_m, northing_m, width_m."""
    rows = ["leg,chainage_m,easting_m,northing_m,width_m"]
    for leg in network.legs:
        for chainage, (x, y), half in zip(leg.chainage_m, leg.stations_m, leg.half_width_m, strict=True):
            rows.append(f"{leg.name},{chainage:g},{x:g},{y:g},{np.round(2 * half, 2):g}")
    return "\n".join(rows) + "\n"


def blocked_table(places_m: Points2, depths_m: np.ndarray, wall_band_m: float) -> str:
    """Return blocked columns as CSV, deepest first: easting_m, northing_m, depth_m, at_wall (0 or 1)."""
    order = np.lexsort((places_m[:, 1], places_m[:, 0], -np.round(depths_m, 4)))
    rows = ["easting_m,northing_m,depth_m,at_wall"]
    for (x, y), depth in zip(places_m[order], depths_m[order], strict=True):
        rows.append(f"{x:.3f},{y:.3f},{depth:.4f},{int(depth <= wall_band_m)}")
    return "\n".join(rows) + "\n"
