"""The rock between sheets: beside floor of other sheets there is none, and over a roof there must be enough."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M
from minexplore.floor import Floor
from pipeline.errors import GeometryError
from pipeline.geometry.wall_foot import BAND_M, CORNER, WallFoot

_OVERLAP_M2 = 1e-3
_ONE_FLOOR_M = 0.3  # floors of two sheets that differ less are one, at their seam


def beside_sheets(floor: Floor, height_m: float) -> list[BaseGeometry]:
    """Return floor of other sheets at about the same height beside each sheet, in its plan: no rock may stand there.

    That is floor between the foot of a wall and the roof, or under the foot by less than a height.
    """
    if len(floor.offset_m) == 1:
        return []
    foot = WallFoot(floor)
    low, high = floor.levels_m
    found = []
    for sheet, offset in enumerate(floor.offset_m):
        own = shapely.union_all(shapely.polygons(floor.vertices[floor.faces[floor.sheet == sheet], :2]))
        band = own.buffer(BAND_M * CORNER).difference(own)
        least, most = floor.spans_m[sheet] + [-height_m, height_m]
        others = np.flatnonzero((floor.sheet != sheet) & (low < most) & (high > least))
        moved = offset - floor.offset_m[floor.sheet[others]]
        triangles = shapely.polygons(floor.vertices[floor.faces[others], :2] + moved[:, None])
        near = np.flatnonzero(shapely.intersects(band, triangles))
        places, of = shapely.get_coordinates(shapely.intersection(band, triangles[near]), return_index=True)
        if not len(places):
            continue
        above = _heights_on(floor, others[near[of]], places - moved[near[of]]) - foot.heights_at(places)
        lowest, highest = np.full(len(near), np.inf), np.full(len(near), -np.inf)
        np.minimum.at(lowest, of, above)
        np.maximum.at(highest, of, above)
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
    between = np.maximum(low[one], low[two]) - np.minimum(high[one], high[two])
    near = np.flatnonzero((one < two) & (floor.sheet[one] != floor.sheet[two]) & (between < height_m + 2 * SLAB_M))
    pairs = near[shapely.overlaps(triangles[one[near]], triangles[two[near]])]
    one, two = one[pairs], two[pairs]
    common = shapely.intersection(triangles[one], triangles[two])
    large = shapely.area(common) > _OVERLAP_M2
    places, of = shapely.get_coordinates(common[large], return_index=True)  # planes are nearest over a corner
    heights = []
    for faces in (one[large][of], two[large][of]):
        heights.append(_heights_on(floor, faces, places + floor.offset_m[floor.sheet[faces]]))
    apart = np.abs(np.subtract(*heights)) if len(places) else np.zeros(0)
    pillar = apart - height_m
    thin = np.flatnonzero((apart > _ONE_FLOOR_M) & (pillar < 2 * SLAB_M))
    if len(thin):
        k = int(thin[pillar[thin].argmin()])
        (x, y), low = places[k], min(heights[0][k], heights[1][k])
        raise GeometryError(
            f"pillar: workings {apart[k]:.2f} m above others at ({x:.1f}, {y:.1f}), {low:.1f} m high, leave "
            f"{pillar[k]:.2f} m of rock over a roof {height_m:g} m high, want {2 * SLAB_M:g} m; a lower "
            "compile3d.height_m leaves more"
        )


def _heights_on(floor: Floor, faces: np.ndarray, places_m: np.ndarray) -> np.ndarray:
    """Return the heights (k,) m of the planes of faces (k,) at places (k, 2) m of the plan."""
    a, b, c = floor.planes[faces].T
    return np.asarray(a * places_m[:, 0] + b * places_m[:, 1] + c)
