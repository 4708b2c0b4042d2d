"""The rough surface: the displaced lattice, simplified, checked, repaired and cut into chunks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from pipeline.errors import GeometryError
from pipeline.geometry.rock.partition import triangulate
from pipeline.surface.mesh.displacement import Bounds, bound_displacement, damp, displaced
from pipeline.surface.mesh.lattice import Lattice
from pipeline.surface.mesh.mesh_checks import MeshReport, check_mesh, find_crossings, find_shared_edges
from pipeline.surface.mesh.simplify import Mesher, SurfaceMesh
from pipeline.surface.mesh.walls import outline_of

_FACES = 32768  # at a time, so that intermediate arrays stay in the cache
_MEND_ROUNDS = 8
_MEND_RADIUS_M = 0.6
_MEND_FACTOR = 0.5
_REFINE_AFTER = 2  # rounds: what is still wrong comes from the simplification and not from the displacement


@dataclass(frozen=True)
class RoughSurface:
    """The displaced lattice and the mesh that is made of it, m.

    `vertices` (n, 3) are the lattice's points after displacement; displacements (n,) are `wanted_m` before and
    `given_m` after bounds and repairs; `mended` (k, 3), the repaired places. `mesh` is what is built.
    """

    lattice: Lattice
    vertices: np.ndarray
    wanted_m: np.ndarray
    given_m: np.ndarray
    mended: np.ndarray
    mesh: SurfaceMesh


def displace_lattice(mesher: Mesher[Lattice], wanted_m: np.ndarray, bounds: Bounds) -> RoughSurface:
    """Displace the lattice, simplify its mesh, and repair self-intersections.

    Where an edge crosses a face, a face turns over, more than two faces share an edge, or the line of the walls on the
    floor crosses itself, the displacement around the place is halved, several times if needed. If that does not help,
    the tile is simplified less. The result holds the places.

    Parameters
    ----------
    mesher : Mesher
        It holds the lattice, and makes its meshes.
    wanted_m : (n,) m
        Displacement of each point along the lattice's direction, before bounds.
    bounds : Bounds

    Raises
    ------
    GeometryError
        If the surface intersects itself after all rounds of repairs.
    """
    lattice = mesher.lattice
    given = bound_displacement(wanted_m, lattice, bounds)
    mended, moved = np.zeros((0, 3)), np.ones(len(given), bool)
    for repair in range(_MEND_ROUNDS):
        vertices = displaced(lattice, given)
        points, faces, changed = mesher.mesh(vertices, moved)
        wrong = _defects(points, faces[changed], vertices, moved, lattice)
        if not len(wrong) and mesher.simplification and not changed.all():  # tiles meet elsewhere, too
            wrong = find_crossings(points, faces)
        if not len(wrong):
            return RoughSurface(lattice, vertices, wanted_m, given, mended, mesher.surface(vertices))
        mended = np.concatenate([mended, wrong])
        if repair >= _REFINE_AFTER:
            mesher.refine(wrong)
        near, _ = cKDTree(wrong).query(vertices, distance_upper_bound=_MEND_RADIUS_M, workers=2)
        given = damp(given, near, _MEND_RADIUS_M, _MEND_FACTOR)
        moved = np.isfinite(near)  # only what is near the repairs has moved, so only this is built and checked again
    x, y, z = wrong[0]
    raise GeometryError(
        f"surface: the rough surface intersects itself at ({x:.1f}, {y:.1f}, {z:.1f}) m "
        f"after {_MEND_ROUNDS} rounds of repairs"
    )


def _defects(
    points: np.ndarray, changed: np.ndarray, vertices: np.ndarray, moved: np.ndarray, lattice: Lattice
) -> np.ndarray:
    """Return the places (k, 3) m of defects in the changed faces (m, 3) over points, and at the moved points (n,)."""
    fine = lattice.faces[moved[lattice.faces].any(axis=1)]
    crossings, shared = find_crossings(points, changed), find_shared_edges(points, changed)
    return np.concatenate([crossings, shared, _folds(vertices, fine, lattice), _knots(vertices, lattice)])


def _folds(vertices: np.ndarray, faces: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Return the centres (k, 3) m of faces that the displacement has turned over.

    Such a face faces away from where it faced before, and from the direction of the displacement. A step on the floor
    chamfer that overhangs does only the first; a face at a corner that points elsewhere than its points, the second.
    """
    parts = [faces[at : at + _FACES] for at in range(0, len(faces), _FACES)]
    faces = np.concatenate([faces[:0], *(_turned(part, vertices, lattice.vertices) for part in parts)])
    turned = np.einsum("ij,ij->i", _normals(vertices[faces]), lattice.direction[faces].sum(axis=1)) <= 0
    return vertices[faces[turned]].mean(axis=1)


def _turned(faces: np.ndarray, vertices: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the faces (k, 3) that face away from where they faced with the vertices `before` (n, 3) m."""
    return faces[np.einsum("ij,ij->i", _normals(vertices[faces]), _normals(before[faces])) <= 0]


def _normals(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _knots(vertices: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Return the place (1, 3) m where the line of the walls on the floor crosses itself, or (0, 3) if it does not."""
    foot = outline_of(vertices[: len(lattice.walls.xy), :2], lattice.walls.rings)
    if foot.is_valid:
        return np.zeros((0, 3))
    reason = shapely.is_valid_reason(foot)
    return np.array([[*map(float, reason[reason.index("[") + 1 : -1].split()), 0.0]])


def closed_mesh(rough: RoughSurface) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) m and faces (m, 3) of the rough surface closed by the floor."""
    walls = rough.lattice.walls
    feet = rough.vertices[: len(walls.xy), :2]
    points, floor = triangulate(outline_of(feet, walls.rings))
    number = {tuple(xy): i for i, xy in enumerate(feet.tolist())}
    place = rough.mesh.place_of(len(feet))
    index = place[np.array([number[tuple(xy)] for xy in points.tolist()])]
    return rough.mesh.vertices, np.concatenate([rough.mesh.faces, index[floor]])


def check_rough(rough: RoughSurface, faces: np.ndarray) -> MeshReport:
    """Check that the rough surface encloses one volume and faces inwards, as `check_mesh` does.

    `faces` (m, 3) are those of the mesh closed by a floor. `displace_lattice` has tried all edges of the rock against
    the rock; what may still cross is the floor and the rock that reaches down to it.

    Raises
    ------
    GeometryError
        If it has a crack or a flipped face, intersects itself, or is in several pieces.
    """
    vertices = rough.mesh.vertices
    return check_mesh(vertices, faces, faces[vertices[faces, 2].min(axis=1) <= 0])
