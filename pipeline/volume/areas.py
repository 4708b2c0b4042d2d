"""The free space of drawn areas with heights: a slab over each floor, and the shafts between them, as one solid."""

from __future__ import annotations

import manifold3d
import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from pipeline.errors import GeometryError
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.geometry.rock.partition import triangulate
from pipeline.scans.meshes.uncrossed import arrays_of
from pipeline.survey.passages.legs import legs_of
from pipeline.types import ClosedMesh, DrawnFloors, FloorMesh
from pipeline.volume.network import network_of
from pipeline.volume.union import pieces_of, unite

_LEAST_M2 = 1e-12  # of a face seen from above, twice
_SIMPLE_M = 0.004  # of the mesh, as of surveyed legs: floors keep within 1 cm of the drawn heights


def solid_of_floors(drawn: DrawnFloors, height_m: float, half_m: float) -> ClosedMesh:
    """Return the closed mesh of all free space: floors with plumb walls and a roof `height_m` over them, and shafts.

    Shafts that nobody measured are `half_m` wide to each side. Floors keep their triangles, so that they are as drawn.

    Raises
    ------
    GeometryError
        If a roof cuts through the floor over it; the message names the place and what states less height.
    """
    floors, shafts = drawn.mesh, drawn.shafts
    vertices, faces = slab(floors, height_m)
    _require_apart(floors, vertices, faces, height_m)
    solids = [_solid(vertices, faces[part]) for part in _parts(len(vertices), faces)]
    if shafts is not None:
        network = network_of(legs_of(shafts), height_m, half_m)
        middle = shafts.positions_m[0] - network.places_m[0]
        solids.append(unite(network, pieces_of(network)).solid.translate(middle.tolist()))
    vertices, faces = arrays_of(manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).simplify(_SIMPLE_M))
    return ClosedMesh(vertices, faces.astype(np.int32), floors.datum_m)


def slab(floors: FloorMesh, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and faces of the space over floors: these, a roof, and a plumb wall on each edge of the rim.

    Normals point out of the space: those of floors point down.
    """
    vertices, faces, n = floors.vertices, floors.faces.astype(np.int64), len(floors.vertices)
    a, b = floors.rim.T
    walls = [np.column_stack([a, b, b + n]), np.column_stack([a, b + n, a + n])]
    lifted = vertices + np.array([0.0, 0.0, height_m])
    return np.concatenate([vertices, lifted]), np.concatenate([faces[:, ::-1], faces + n, *walls])


def slab_of_outline(
    outline: Polygon, floor_m: float, roof_m: float, lean: tuple[float, float] = (0.0, 0.0)
) -> ClosedMesh:
    """Return the closed mesh of a level plan: a floor and a roof, both of one plane, and plumb walls on the outline.

    Parameters
    ----------
    outline : shapely.Polygon, m, mine frame
        With islands as holes. Its corners are those of the mesh.
    floor_m, roof_m : float
        Heights at the frame's origin.
    lean : (float, float), optional
        Rise over run of floor and roof to the east and to the north; level by default.

    Raises
    ------
    GeometryError
        If the outline is invalid or empty, or the roof is not over the floor.
    """
    if outline.is_empty or not outline.is_valid or not roof_m > floor_m:
        what = "no outline" if outline.is_empty else shapely.is_valid_reason(outline)
        raise GeometryError(f"slab: {what}; floor at {floor_m:g} m, roof at {roof_m:g} m")
    points, faces = triangulate(outline)
    floor = FloorMesh(np.column_stack([points, floor_m + points @ lean]), faces.astype(np.int32), 0.0)
    vertices, sides = slab(floor, roof_m - floor_m)
    return ClosedMesh(vertices, sides.astype(np.int32), floor.datum_m)


def _parts(count: int, faces: np.ndarray) -> list[np.ndarray]:
    """Return the faces of each connected part of a mesh."""
    a, b = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    number, label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (count, count)), directed=False)
    part = label[faces[:, 0]]
    order = np.argsort(part, kind="stable")
    return [rows for rows in np.split(order, np.searchsorted(part[order], np.arange(1, number))) if len(rows)]


def _solid(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    used, faces = np.unique(faces, return_inverse=True)
    mesh = manifold3d.Mesh64(np.array(vertices[used], order="C"), faces.reshape(-1, 3).astype(np.uint64))
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError:
        x, y, z = vertices[used].mean(axis=0)
        raise GeometryError(
            f"compile3d: the walls of the areas about ({x:.1f}, {y:.1f}), {z:.1f} m high, enclose no space "
            f"({solid.status().name})"
        )
    return solid.as_original()


def _require_apart(floors: FloorMesh, vertices: np.ndarray, faces: np.ndarray, height_m: float) -> None:
    """Refuse roofs that cut through floors or walls over them.

    Where walls over each other lie in one plane no facets cross: there the floors' middles are compared.
    """
    corners = floors.vertices[floors.faces]
    middle = corners.mean(axis=1)
    place, face = shapely.STRtree(shapely.polygons(corners[:, :, :2])).query(
        shapely.points(middle[:, :2]), predicate="intersects"
    )
    a, b, c = np.moveaxis(corners[face], 1, 0)
    normal = np.cross(b - a, c - a)
    over = np.sum((a - middle[place]) * normal, axis=1) / np.maximum(normal[:, 2], _LEAST_M2)
    low = np.flatnonzero((place != face) & (over > CROSSING_M) & (over < height_m))
    pairs = crossing_facets(vertices, faces, CROSSING_M)
    if len(low) or len(pairs):
        x, y, z = middle[place[low[0]]] if len(low) else vertices[faces[pairs[0]]].reshape(-1, 3).mean(axis=0)
        raise GeometryError(
            f"roof: floors over each other are less than their height of {height_m:g} m apart in "
            f"{len(low) + len(pairs)} places, the first at ({x:.1f}, {y:.1f}), {z + floors.datum_m:.1f} m high; "
            "compile3d.height_m states less"
        )
