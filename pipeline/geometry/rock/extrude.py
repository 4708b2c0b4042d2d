"""Extrude plane polygons: to prisms for collision, to meshes for decomposition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.rock.partition import triangulate
from pipeline.types import ConvexParts, Points2, Points3

if TYPE_CHECKING:
    import trimesh


def prism(part: Points2, height_m: float) -> Points3:
    """Extrude a convex polygon (n, 2) m into the (2 n, 3) vertices of a prism from the floor to `height_m`."""
    return np.vstack([np.column_stack([part, np.full(len(part), z)]) for z in (0.0, height_m)])


def collect_parts(parts: list[Points3]) -> ConvexParts:
    """Pack the vertex arrays of parts into one record."""
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int32)
    return ConvexParts(np.vstack(parts) if parts else np.empty((0, 3)), offsets)


def extrude_polygon(polygon: BaseGeometry, height_m: float) -> trimesh.Trimesh:
    """Extrude a polygon or multipolygon with holes into a closed mesh from the floor to `height_m`."""
    import trimesh  # takes half a second to load, and exact parts need none

    points, faces = triangulate(polygon)
    return trimesh.creation.extrude_triangulation(points, faces, height=height_m)


def section_footprint(vertices: Points3) -> Polygon:
    """Return the convex footprint of a part seen from above, m, mine frame."""
    return shapely.convex_hull(shapely.multipoints(vertices[:, :2]))
