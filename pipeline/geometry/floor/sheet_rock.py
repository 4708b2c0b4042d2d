"""The rock between sheets: beside floor of other sheets there is none, and over a roof there must be enough."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor
from pipeline.geometry.floor.wall_foot import BAND_M, CORNER, WallFoot, band_of

_OVERLAP_M2 = 1e-3
_ONE_FLOOR_M = 0.3  # floors of two sheets that differ less are one, at their seam


def beside_sheets(floor: Floor, height_m: float) -> list[BaseGeometry]:
    """Return floor of other sheets at about the same height beside each sheet, in its plan: no rock may stand there.

    That is floor between the foot of a wall and the roof, or under the foot by less than a height.
    """
    if len(floor.offset_m) == 1:
        return []
    foot, lifts = WallFoot(floor, height_m=height_m), floor.lifts_m(height_m)
    (low, high), most_m = floor.levels_m, height_m + max(0.0, lifts.max())
    found = []
    for sheet, offset in enumerate(floor.offset_m):
        own = shapely.union_all(shapely.polygons(floor.vertices[floor.faces[floor.sheet == sheet], :2]))
        band = own.buffer(BAND_M * CORNER).union(band_of(own)).difference(own)  # a cut mitre's ends reach further
        least, most = floor.spans_m[sheet] + [-most_m, most_m]
        others = np.flatnonzero((floor.sheet != sheet) & (low < most) & (high > least))
        moved = offset - floor.offset_m[floor.sheet[others]]
        triangles = shapely.polygons(floor.vertices[floor.faces[others], :2] + moved[:, None])
        near = np.flatnonzero(shapely.intersects(band, triangles))
        places, of = shapely.get_coordinates(shapely.intersection(band, triangles[near]), return_index=True)
        if not len(places):
            continue
        faces, (feet, lift) = others[near[of]], foot.levels_at(places)
        above = _values_on(floor, faces, places - moved[near[of]]) - feet
        lowest, highest = np.full(len(near), np.inf), np.full(len(near), -np.inf)
        np.minimum.at(lowest, of, above - lift)
        np.maximum.at(highest, of, above + _values_on(floor, faces, places - moved[near[of]], lifts))
        found += triangles[near[(lowest < height_m) & (highest > -height_m)]].tolist()
    return found


def _values_on(floor: Floor, faces: np.ndarray, places_m: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
    """Return the heights (k,) m of the planes of faces (k,) at places (k, 2) m of the plan, or of values (n,) there."""
    if values is None:
        a, b, c = floor.planes[faces].T
    elif not values.any():
        return np.zeros(len(places_m))
    else:
        a, b, c = floor.planes_of(values)[faces].T
    return np.asarray(a * places_m[:, 0] + b * places_m[:, 1] + c)
