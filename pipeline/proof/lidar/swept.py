"""What real sweeps are replayed in, by either model: casters of its walls, where a scanner can stand, and its frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import WALLS, GeomGroup
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.bundle import OpenedBundle, geom_triangles
from pipeline.mjcf.visible import visible_triangles
from pipeline.types import Frame


@dataclass(frozen=True)
class SweptWorld:
    """What replay needs of a world, in the mine frame.

    Attributes
    ----------
    collision : RayCaster
        What level rays meet of the collision parts.
    visible : RayCaster or None
        Likewise of the visible rock; None in a world without.
    plan : shapely geometry, m
        The floors seen from above.
    floor_m : callable
        Heights (n,) m of the floor under places (n, 2) m; inf where nobody can stand.
    frame : Frame
        Of the plan: what lies beyond it is no part of the mine.
    tilt_deg : float
        Of the world about the mine frame; a positive one lowers the east.
    """

    collision: RayCaster
    visible: RayCaster | None
    plan: BaseGeometry
    floor_m: Callable[[np.ndarray], np.ndarray]
    frame: Frame
    tilt_deg: float

    def ranges(self, caster: RayCaster, places: np.ndarray, bearings: np.ndarray, over_m: float) -> np.ndarray:
        """Return ranges (n, k) m of level rays at bearings (n, k) rad, from `over_m` over the floor at places (n, 2) m.

        They are inf where a ray meets nothing, and from places where nobody can stand.
        """
        height_m = self.floor_m(places) + over_m
        stands = np.isfinite(height_m)
        found = np.full(bearings.shape, np.inf)
        if stands.any():
            found[stands] = caster.fan(places[stands], bearings[stands], height_m[stands])
        return found


def swept_level(world: OpenedBundle, free: Polygon) -> SweptWorld:
    """Return what is replayed in of a level world with this free space, m, mine frame: its walls, on a floor at 0."""

    def floor_m(places: np.ndarray) -> np.ndarray:
        return np.where(shapely.contains_xy(free, places[:, 0], places[:, 1]), 0.0, np.inf)

    return SweptWorld(
        RayCaster(geom_triangles(world.model, GeomGroup.COLLISION)),
        RayCaster(visible_triangles(world.visible, WALLS)) if world.record.has_visible_rock else None,
        free,
        floor_m,
        world.record.plan_frame,
        world.record.tilt_deg,
    )
