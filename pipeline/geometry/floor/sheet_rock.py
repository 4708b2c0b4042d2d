"""The rock between sheets: beside floor of other sheets there is none, and over a roof there must be enough."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from minexplore.floors.floor import Floor
from pipeline.errors import GeometryError
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


def require_pillars(floor: Floor, height_m: float) -> None:
    """Refuse sheets that pass over each other with less than `2 * SLAB_M` of rock between.

    Raises
    ------
    GeometryError
        With the place and the thickness.
    """
    if len(floor.offset_m) == 1:
        return
    corners = floor.vertices[floor.faces].copy()
    corners[:, :, :2] -= floor.offset_m[floor.sheet][:, None]
    triangles = shapely.polygons(corners[:, :, :2])
    one, two = shapely.STRtree(triangles).query(triangles)
    low, high = floor.levels_m
    lifts = floor.lifts_m(height_m)
    between, most_m = (
        np.maximum(low[one], low[two]) - np.minimum(high[one], high[two]),
        height_m + max(0.0, lifts.max()),
    )
    near = np.flatnonzero((one < two) & (floor.sheet[one] != floor.sheet[two]) & (between < most_m + 2 * SLAB_M))
    pairs = near[shapely.overlaps(triangles[one[near]], triangles[two[near]])]
    one, two = one[pairs], two[pairs]
    common = shapely.intersection(triangles[one], triangles[two])
    large = shapely.area(common) > _OVERLAP_M2
    places, of = shapely.get_coordinates(common[large], return_index=True)  # planes are nearest over a corner
    heights, roofs = [], []
    for faces in (one[large][of], two[large][of]):
        at = places + floor.offset_m[floor.sheet[faces]]
        heights.append(_values_on(floor, faces, at))
        roofs.append(height_m + _values_on(floor, faces, at, lifts))
    apart = np.abs(np.subtract(*heights))
    roof_m = np.where(heights[0] < heights[1], *roofs)
    pillar = apart - roof_m
    thin = np.flatnonzero((apart > _ONE_FLOOR_M) & (pillar < 2 * SLAB_M))
    if len(thin):
        k = int(thin[pillar[thin].argmin()])
        (x, y), low = places[k], min(heights[0][k], heights[1][k])
        raise GeometryError(
            f"pillar: workings {apart[k]:.2f} m above others at ({x:.1f}, {y:.1f}), {low:.1f} m high, leave "
            f"{pillar[k]:.2f} m of rock over a roof {roof_m[k]:.4g} m high, want {2 * SLAB_M:g} m; a lower "
            "compile3d.height_m leaves more" + (", where the survey has no roof" if floor.is_stretched else "")
        )


def _values_on(floor: Floor, faces: np.ndarray, places_m: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
    """Return the heights (k,) m of the planes of faces (k,) at places (k, 2) m of the plan, or of values (n,) there."""
    if values is None:
        a, b, c = floor.planes[faces].T
    elif not values.any():
        return np.zeros(len(places_m))
    else:
        a, b, c = floor.planes_of(values)[faces].T
    return np.asarray(a * places_m[:, 0] + b * places_m[:, 1] + c)
