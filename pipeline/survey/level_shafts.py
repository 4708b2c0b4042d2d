"""Shafts between the levels of a drawing, and raises over them: its plumb lines."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from pipeline.params.reader_limits import reader_limits
from pipeline.survey.child import tell
from pipeline.survey.level_areas import Area, nearest_heights
from pipeline.survey.level_walls import Wall
from pipeline.survey.shafts import FLOORS_APART_M, OVER_RAISE_M
from pipeline.types import Shaft


def shafts_of(
    path: Path,
    plumb: list[Wall],
    polygons: list[Polygon],
    of_sheet: list[list[Area]],
    offsets: np.ndarray,
    datum: float,
) -> list[Shaft]:
    """Return a shaft from each floor that a plumb line meets to the next, or to its blind end; say what is left out.

    Then come the raises: a plumb line that ends above the highest floor that it meets is one from there.

    Parameters
    ----------
    path : Path
    plumb : list of (2, 3) m, mine frame
        From the upper to the lower end.
    polygons : list of shapely Polygon, m, mine frame
        Of the sheets.
    of_sheet : list of list of Area
        The areas in each sheet.
    offsets : (sheets, 2) m
        How far each sheet is moved aside.
    datum : float
        Of the heights, m.
    """
    step, left_out = reader_limits().flat_step_m, []
    found: list[Shaft] = []
    raises: list[Shaft] = []
    for line in plumb:
        (x, y), top, bottom = line[0, :2], float(line[0, 2]), float(line[1, 2])
        at = np.array([[x, y]])
        floors = sorted(
            (
                (float(nearest_heights(areas, at)[0]), k)
                for k, (polygon, areas) in enumerate(zip(polygons, of_sheet, strict=True))
                if polygon.contains(shapely.Point(x, y))
            ),
            reverse=True,
        )
        met = [(z, k) for z, k in floors if bottom - step <= z <= top + max(step, OVER_RAISE_M)]
        where = f"({x:.1f}, {y:.1f}) from {top:.1f} to {bottom:.1f} m"
        if not met:
            left_out.append(f"{where}, whose ends are on no floor")
            continue
        ends: list[tuple[float, int | None]] = [*met]
        if met[-1][0] - bottom > step:
            if any(bottom - FLOORS_APART_M < z < bottom - step for z, _ in floors):
                left_out.append(f"{where}, which ends blind less than {FLOORS_APART_M:g} m over another floor")
                continue
            ends.append((bottom, None))
        if top - met[0][0] > step:
            ends.insert(0, (top, None))
        for (high, sheet), (low, below) in pairwise(ends):
            plan = below if sheet is None else sheet
            assert plan is not None
            nearest = shapely.shortest_line(shapely.Point(x, y), polygons[plan].boundary)
            dx, dy = np.diff(shapely.get_coordinates(nearest), axis=0)[0]
            place = offsets[plan] + (x, y)
            (found if sheet is not None else raises).append(
                Shaft(
                    stations=(f"{high:.1f} m", f"{low:.1f} m"),
                    place_m=(float(place[0]), float(place[1])),
                    heading_rad=float(np.arctan2(dx, -dy)),
                    side_m=None,
                    sheet=sheet,
                    below=below,
                    top_m=high - datum,
                    bottom_m=low - datum,
                )
            )
    if left_out:
        tell(f"{path.name}: {len(left_out)} shafts are left out, the first at {left_out[0]}")
    return found + raises
