"""The smooth surface: floor, two floor chamfers, two walls, two roof chamfers and the roof, as one closed mesh."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from minexplore.bundle import FLOOR_CHAMFER, ROOF, WALLS
from pipeline.errors import GeometryError
from pipeline.geometry.polyline import arc_length
from pipeline.geometry.rock.partition import triangulate
from pipeline.types import Mesh

FLOOR = "floor"  # the flat floor closes the surface; a bundle does not hold it
_RINGS = 4  # contours of a chamfer; in drifts narrower than two chamfers the ridge is exact to one contour


def smooth_surface(
    free: Polygon,
    height_m: float,
    floor_chamfer_m: float,
    roof_chamfer_m: float,
    texture_m: float,
) -> dict[str, Mesh]:
    """Build the closed inner surface of the workings with chamfered edges at floor and roof.

    Floor and roof are offsets of the free space, so chamfers meet at junctions, corners and islands. Where a drift is
    narrower than two chamfers, they meet in a ridge.

    Parameters
    ----------
    free : shapely.Polygon, m, mine frame
    height_m : float
        From floor to roof.
    floor_chamfer_m, roof_chamfer_m : float
        Width and height of the 45 deg chamfers.
    texture_m : float
        Length of one repeat of the texture.

    Returns
    -------
    dict of Mesh
        `floor`, `floor_chamfer`, `walls`, `roof` (with its chamfers); together watertight, facing inwards.

    Raises
    ------
    GeometryError
        If the chamfers do not fit under the height.
    """
    if floor_chamfer_m + roof_chamfer_m >= height_m:
        raise GeometryError(
            f"surface: chamfers of {floor_chamfer_m:g} m and {roof_chamfer_m:g} m do not fit into {height_m:g} m"
        )
    free = orient(free)
    top_m = height_m - roof_chamfer_m
    floor, flat = _sloping_cap(free, floor_chamfer_m)
    roof, _ = _sloping_cap(free, roof_chamfer_m)
    return {
        FLOOR: _cap_mesh(floor[flat], floor_chamfer_m, -1.0, texture_m),
        FLOOR_CHAMFER: _cap_mesh(floor[~flat], floor_chamfer_m, -1.0, texture_m),
        WALLS: _wall_mesh(free, floor_chamfer_m, top_m, texture_m),
        ROOF: _cap_mesh(roof, top_m, 1.0, texture_m),
    }


def _sloping_cap(free: Polygon, chamfer_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate the free space along contour rings inside it.

    Returns triangles (n, 3, 3) with vertices x, y and depth, m, and (n,) whether a triangle is in the flat middle. The
    depth is the offset of the vertex's contour ring: how far the surface there is above or below the wall's edge.
    """
    outer: BaseGeometry = free
    triangles, flat = [], []
    for k in range(_RINGS + 1):
        depth, step = chamfer_m * k / _RINGS, chamfer_m / _RINGS
        inner = shapely.Polygon() if k == _RINGS else _eroded(free, depth + step)
        if outer.is_empty:
            break
        points, faces = triangulate(outer.difference(inner))
        on_inner = {xy.tobytes() for xy in shapely.get_coordinates(inner)}
        inside = np.array([xy.tobytes() in on_inner for xy in points])
        depths = np.where(inside, depth + step, depth)
        triangles.append(np.column_stack([points, depths])[faces])
        flat.append(np.full(len(faces), k == _RINGS))
        outer = inner
    return np.concatenate(triangles), np.concatenate(flat)


def _eroded(free: Polygon, depth_m: float) -> BaseGeometry:
    """Return the part of the free space that is farther than a depth from the walls."""
    return free.buffer(-depth_m, join_style="mitre", mitre_limit=2.0)


def _cap_mesh(triangles: np.ndarray, edge_z_m: float, direction: float, texture_m: float) -> Mesh:
    points, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3).astype(np.int32)
    vertices = np.column_stack([points[:, :2], edge_z_m + direction * points[:, 2]])
    # The triangulation is counter-clockwise seen from above: correct for a floor, reversed for a roof.
    return Mesh(vertices, faces if direction < 0 else faces[:, ::-1].copy(), points[:, :2] / texture_m)


def _wall_mesh(free: Polygon, bottom_m: float, top_m: float, texture_m: float) -> Mesh:
    vertices, faces, texcoords, count = [], [], [], 0
    for ring in (free.exterior, *free.interiors):
        xy = np.asarray(ring.coords)[:, :2]  # closed: the seam has two vertices with different texture coordinates
        along = arc_length(xy)
        # A whole number of repeats round a ring, so that the texture continues across the seam.
        u = along / along[-1] * max(1, round(along[-1] / texture_m))
        n = len(xy)
        for z in (bottom_m, top_m):
            vertices.append(np.column_stack([xy, np.full(n, z)]))
            texcoords.append(np.column_stack([u, np.full(n, z / texture_m)]))
        low = count + np.arange(n - 1)
        high = low + n
        # Free space lies to the left of every ring, so the wall faces left.
        faces.append(np.column_stack([low, high + 1, low + 1]))
        faces.append(np.column_stack([low, high, high + 1]))
        count += 2 * n
    return Mesh(np.vstack(vertices), np.vstack(faces).astype(np.int32), np.vstack(texcoords))
