"""The certificate's figures of openings: fences, walls and ends of shafts, and the roof over their collars."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import SLAB_M, GeomGroup
from minexplore.floors.floor import Floor
from pipeline.geometry.openings.shaft_parts import (
    FENCE_HEIGHT_M,
    FENCE_M,
    ends_of,
    is_blind,
    rows_of,
    section_at,
    section_below,
    section_of,
)
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.metrics.containment import WallCover, slices_above
from pipeline.mjcf.bundle import OpenedBundle, placed_parts
from pipeline.types import Opening, Openings

_SEAM_M = 0.002
_NEAR_M = 0.01  # of the first and the last slice from a shaft's ends
_THICK_M, _SLANT = 0.2, 0.2  # of a shaft's walls, and by how much they grow a metre from its ends
_ON_ROOF_M = 0.02
_LEVEL = np.zeros(3)


def cover_openings(
    world: OpenedBundle, floor: Floor, parts: list[np.ndarray], slices_m: tuple[float, ...]
) -> WallCover:
    """Return the worst of all openings: rock within, rock missing from fence, walls and blind ends, and the widest gap.

    Fences are sliced above the collar, shafts at six depths, where there must be no roof either; those that lean at six
    depths between two bends. The parts are convex, so that what is closed in the slices next to both ends of a wall is
    closed between them.
    """
    worst = np.zeros(3)
    walls = _Bodies(parts)
    roofs = _Bodies(placed_parts(world.model, GeomGroup.ROOF, np.array(world.record.T_world_mine)))
    for opening in world.record.openings:
        hole = Polygon(section_of(opening, floor))
        tops, ends = ends_of(opening, floor, world.record.height_m)
        top, end = float(tops.min()), float(ends.max())
        depths = _depths(opening, floor, world.record.height_m, top, end)
        sections = [Polygon(section_at(opening, floor, depth)) for depth in depths]
        whole = shapely.convex_hull(shapely.union_all([hole, *sections])) if opening.bends_m else hole
        near = walls.near(whole.buffer(SLAB_M + _SEAM_M))
        over = roofs.near(whole) if opening.below is not None else []
        fenced = bool(Openings([opening]).fenced(world.record.fenced))
        if fenced:
            plane, ring = _collar_plane(opening, floor), hole.difference(hole.buffer(-FENCE_M, join_style="mitre"))
            for height in (height for height in slices_m if height < FENCE_HEIGHT_M):
                worst = np.maximum(worst, _errors(near, plane, height, Polygon(), ring, hole))
        fence_end = top - SLAB_M - _SEAM_M if fenced else top
        for depth, section in zip(depths, sections, strict=True):
            thick = min(_THICK_M, _SLANT * min(top - depth, depth - end))
            inner = section.buffer(-FENCE_M - _SEAM_M, join_style="mitre") if depth > fence_end else section
            ring = section.buffer(thick, join_style="mitre").difference(section)
            worst = np.maximum(worst, _errors(near, _LEVEL, depth, inner, ring, section))
            worst[0] = max(worst[0], _errors(over, _LEVEL, depth, section, Polygon(), section)[0])
        if is_blind(opening):
            middle = end - SLAB_M / 2 if opening.below is None else top + SLAB_M / 2
            closed = Polygon(section_at(opening, floor, middle))
            worst = np.maximum(worst, _errors(near, _LEVEL, middle, Polygon(), closed, closed))
    return WallCover(*worst.round(6).tolist())


def _depths(opening: Opening, floor: Floor, height_m: float, top_m: float, end_m: float) -> list[float]:
    """Return the heights, m, at which a shaft is sliced."""
    levels = [end_m, top_m]
    if opening.bends_m:
        rows = rows_of(opening, floor, height_m)
        levels = [end_m, *(float(heights.min()) for _, heights in rows[-2:0:-1]), top_m]
    pairs = pairwise(levels)
    return [depth for low, high in pairs for depth in np.linspace(low + _NEAR_M, high - _NEAR_M, 6).tolist()]


class _Bodies:
    """Convex bodies by their place in plan."""

    def __init__(self, parts: list[np.ndarray]) -> None:
        self._parts = parts
        self._tree = shapely.STRtree([section_footprint(part) for part in parts])

    def near(self, area: Polygon) -> list[np.ndarray]:
        """Return the bodies that reach into an area of the plan."""
        return [self._parts[k] for k in sorted(self._tree.query(area, predicate="intersects").tolist())]


def _errors(
    parts: list[np.ndarray], plane: np.ndarray, height_m: float, open_to: Polygon, closed: BaseGeometry, rim: Polygon
) -> np.ndarray:
    """Return rock in the one area, rock missing from the other (m2), and the longest gap along a rim (m) in a slice."""
    rock = shapely.union_all([cut for part in parts for cut in slices_above(part, plane, [height_m])])
    gaps = shapely.get_parts(rim.exterior.difference(rock.buffer(_SEAM_M)))
    widest = max((gap.length for gap in gaps), default=0.0)
    return np.array([rock.intersection(open_to).area, closed.difference(rock).area, widest])


def _collar_plane(opening: Opening, floor: Floor) -> np.ndarray:
    """Return the plane (3,), z = a x + b y + c, through the corners of a collar in the mine frame."""
    corners, heights = section_of(opening, floor), floor.heights_at(np.array(opening.outline_m))
    fit, *_ = np.linalg.lstsq(np.column_stack([corners, np.ones(len(corners))]), heights, rcond=None)
    return np.asarray(fit)


def holes_in_roof(world: OpenedBundle, floor: Floor) -> BaseGeometry:
    """Return where shafts come through roofs, in plan."""
    sections = [section_below(opening, floor) for opening in world.record.openings]
    return shapely.union_all([Polygon(section) for section in sections if section is not None])


def open_over_collars_m2(world: OpenedBundle, floor: Floor) -> float:
    """Return the area of collars, m2, over which no wedge of the roof has its lower face at the roof's height."""
    collars = Openings(world.record.openings).collars
    if not collars:
        return 0.0
    wedges, missing = placed_parts(world.model, GeomGroup.ROOF, np.array(world.record.T_world_mine)), 0.0
    roof = floor.raised(world.record.height_m)
    for opening in collars:
        plane, hole = _collar_plane(opening, roof), Polygon(section_of(opening, floor))
        covered = []
        for wedge in wedges:
            above = wedge[:, 2] - wedge[:, :2] @ plane[:2] - plane[2]
            if np.minimum(np.abs(above), np.abs(above - SLAB_M)).max() < _ON_ROOF_M and above.min() < _ON_ROOF_M:
                covered.append(section_footprint(wedge).buffer(_SEAM_M))
        through = [Polygon(section_at(o, floor, o.bottom_m)) for o in world.record.openings if o.below == opening.sheet]
        missing += hole.difference(shapely.union_all(covered + through)).area
    return float(missing)
