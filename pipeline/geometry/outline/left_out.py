"""What of drawn workings is left out, and which islands in them are filled: remarks with the largest and its place."""

from __future__ import annotations

import numpy as np
from shapely import MultiPolygon, Polygon

from minesurveys.remarks import warn_user
from pipeline.geometry.outline.binarize import left_out, pieces_of
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.types import Frame, Mask

_SLIVER_M2 = 0.01  # smaller islands are rounding where areas meet
Islands = list[tuple[float, float, float]]  # area m2 and place x, y m in the mine frame, the largest first


def islands_of(workings: MultiPolygon, chosen: Polygon, min_island_m2: float) -> Islands:
    """Return the islands of workings (m, mine frame) that `mend` fills in a chosen component."""
    holes = [Polygon(ring) for component in as_polygons(workings).geoms for ring in component.interiors]
    middles = [(hole.area, hole.representative_point()) for hole in holes if _SLIVER_M2 <= hole.area < min_island_m2]
    return sorted(((area, place.x, place.y) for area, place in middles if chosen.covers(place)), reverse=True)


def drawn_islands(filled: Mask, frame: Frame) -> Islands:
    """Return the islands that are filled in a plan (rows, cols); those of less than a square metre are specks."""
    scale = frame.px_per_m**2
    return [(px / scale, *frame.to_mine(np.array([place]))[0].tolist()) for px, *place in pieces_of(filled, scale)]


def warn_of_islands(islands: Islands, min_island_m2: float) -> None:
    """Warn of islands that are filled, with the parameter that keeps them."""
    if islands:
        area, x, y = islands[0]
        warn_user(
            f"islands in the workings are smaller than {min_island_m2:g} m2 and are filled, "
            f"{sum((a for a, _, _ in islands)):.1f} m2 in all (the largest, {area:.1f} m2, at ({x:.1f}, "
            f"{y:.1f}))",
            of="contours",
            count=len(islands),
            option="contours.min_island_m2",
            advice="contours.min_island_m2 keeps them",
        )


def unconnected_m2(raw: Mask, cleaned: Mask, frame: Frame) -> float:
    """Return the area of unconnected drawn pieces, and print where the largest is: a drift may be missing."""
    pieces = left_out(raw, cleaned, frame.px_per_m**2)
    if not pieces:
        return 0.0
    area, (x, y) = sum(p[0] for p in pieces) / frame.px_per_m**2, frame.to_mine(np.array([pieces[0][1:]]))[0]
    warn_user(
        f"in {len(pieces)} drawn pieces are connected to nothing and are left out (the largest, "
        f"{pieces[0][0] / frame.px_per_m**2:.1f} m2, at ({x:.1f}, {y:.1f}))",
        of="contours",
        count=f"{area:.1f} m2",
        option="contours.bridge_m",
        advice="contours.bridge_m closes gaps",
    )
    return area
