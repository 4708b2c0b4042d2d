"""The rough surface: the lattice displaced by solid noise, checked, repaired and cut into chunks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from minexplore import bundle
from pipeline.errors import GeometryError
from pipeline.geometry.partition import triangulate
from pipeline.surface.displacement import Bounds, bound_displacement, damp_near, displaced
from pipeline.surface.lattice import ROOF, WALL, Lattice
from pipeline.surface.mesh_checks import find_crossings
from pipeline.surface.noise import slow_modulation, solid_noise
from pipeline.surface.normals import ShadedMesh, shade_mesh
from pipeline.surface.spectrum import Bands
from pipeline.surface.walls import outline_of
from pipeline.types import Mesh

_MEND_ROUNDS = 8
_MEND_RADIUS_M = 0.6
_MEND_FACTOR = 0.5


@dataclass(frozen=True)
class Modulation:
    """A slow variation of roughness along the workings: its wavelength, m, and the s.d. of its logarithm."""

    wavelength_m: float
    spread: float


@dataclass(frozen=True)
class RoughSurface:
    """The displaced lattice, m.

    `vertices` (n, 3); displacements (n,) `wanted_m` before and `given_m` after bounds and repairs; `mended` (k, 3), the
    repaired places.
    """

    lattice: Lattice
    vertices: np.ndarray
    wanted_m: np.ndarray
    given_m: np.ndarray
    mended: np.ndarray


def displace_lattice(
    lattice: Lattice, wall: Bands, roof: Bands, modulation: Modulation, bounds: Bounds, rng: np.random.Generator
) -> RoughSurface:
    """Displace the lattice by noise with the spectra of walls and roof, and repair self-intersections.

    Where an edge crosses a face, a face turns over, or the line of the walls on the floor crosses itself, the
    displacement around the place is halved, several times if needed. The result holds the places.

    Raises
    ------
    GeometryError
        If the surface intersects itself after eight rounds of repairs.
    """
    share = lattice.roof_share
    wanted = solid_noise(lattice.vertices, [wall, roof], [1 - share, share], rng)
    wanted *= slow_modulation(lattice.vertices, modulation.wavelength_m, modulation.spread, rng)
    given = bound_displacement(wanted, lattice, bounds)
    mended = np.zeros((0, 3))
    faces = lattice.faces
    for _ in range(_MEND_ROUNDS):
        vertices = displaced(lattice, given)
        wrong = np.concatenate(
            [find_crossings(vertices, faces), _folds(vertices, faces, lattice.vertices), _knots(vertices, lattice)]
        )
        if not len(wrong):
            return RoughSurface(lattice, vertices, wanted, given, mended)
        mended = np.concatenate([mended, wrong])
        given = damp_near(wrong, vertices, given, _MEND_RADIUS_M, _MEND_FACTOR)
        # Only faces near the repairs have moved, so only these are checked again.
        near, _ = cKDTree(wrong).query(vertices, distance_upper_bound=2 * _MEND_RADIUS_M)
        faces = lattice.faces[np.isfinite(near)[lattice.faces].any(axis=1)]
    x, y, z = wrong[0]
    raise GeometryError(
        f"surface: the rough surface intersects itself at ({x:.1f}, {y:.1f}, {z:.1f}) m "
        f"after {_MEND_ROUNDS} rounds of repairs"
    )


def _folds(vertices: np.ndarray, faces: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the centres (k, 3) m of faces that the displacement has turned over; `before` are the old vertices."""
    turned = np.einsum("ij,ij->i", _normals(vertices[faces]), _normals(before[faces])) <= 0
    return vertices[faces[turned]].mean(axis=1)


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
    columns = len(rough.lattice.walls.xy)
    foot = rough.vertices[:columns, :2]
    points, floor = triangulate(outline_of(foot, rough.lattice.walls.rings))
    number = {xy.tobytes(): i for i, xy in enumerate(foot)}
    index = np.array([number[xy.tobytes()] for xy in points])
    return rough.vertices, np.concatenate([rough.lattice.faces, index[floor]])


def cut_chunks(rough: RoughSurface, tile_m: float, texture_m: float, normals: bool = False) -> dict[str, Mesh]:
    """Cut walls and roof into square tiles of the plan, so that a renderer can skip most of them.

    Parameters
    ----------
    rough : RoughSurface
    tile_m, texture_m : float
        Side of a tile, and length on the rock that one repeat of the texture covers.
    normals : bool
        Give each vertex the normal of the whole surface, so that chunks meet without a seam; 12 bytes a vertex.

    Returns
    -------
    dict of Mesh
        The name holds the piece, and the tile's column and row from the south-west. Faces face the workings.
    """
    lattice = rough.lattice
    shaded = shade_mesh(rough.vertices, lattice.faces) if normals else _unshaded(rough)
    along = _along_walls(lattice, texture_m)
    centre = lattice.vertices[lattice.faces].mean(axis=1)[:, :2]
    tile = np.floor((centre - lattice.vertices[:, :2].min(axis=0)) / tile_m).astype(int)
    chunks = {}
    for piece, name in ((WALL, bundle.WALLS), (ROOF, bundle.ROOF)):
        of_piece = np.flatnonzero(lattice.piece == piece)
        tile[of_piece] = _merge_single_faces(tile[of_piece], centre[of_piece])
        order = of_piece[np.lexsort(tile[of_piece].T[::-1])]
        first = np.flatnonzero(np.any(np.diff(tile[order], axis=0, prepend=-1) != 0, axis=1))
        for part in np.split(order, first[1:]):
            col, row = tile[part[0]]
            chunks[bundle.chunk_mesh(name, col, row)] = _chunk(rough, shaded, part, piece, along, texture_m)
    return chunks


def _merge_single_faces(tile: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the faces' tiles (n, 2); a single face joins the nearest tile, since MuJoCo needs four vertices a mesh."""
    _, group, count = np.unique(tile, axis=0, return_inverse=True, return_counts=True)
    single = count[group.ravel()] == 1
    merged = tile.copy()
    for face in np.flatnonzero(single):
        distance = np.linalg.norm(centre - centre[face], axis=1)
        merged[face] = tile[np.where(single, np.inf, distance).argmin()]
    return merged


def _along_walls(lattice: Lattice, texture_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return each column's texture coordinate along its wall, and its ring's number of repeats, a whole number."""
    u, repeats = [], []
    for ring in lattice.walls.rings:
        whole = max(1, round(ring.count * ring.step_m / texture_m))
        u.append(np.arange(ring.count) / ring.count * whole)
        repeats.append(np.full(ring.count, float(whole)))
    return np.concatenate(u), np.concatenate(repeats)


def _chunk(
    rough: RoughSurface,
    shaded: ShadedMesh,
    part: np.ndarray,
    piece: int,
    along: tuple[np.ndarray, np.ndarray],
    texture_m: float,
) -> Mesh:
    lattice, faces = rough.lattice, shaded.faces[part]
    if piece == ROOF:
        used, index = np.unique(faces, return_inverse=True)
        source = shaded.source[used]
        texcoords = lattice.vertices[source, :2] / texture_m
    else:
        u, repeats = along
        column = lattice.column[shaded.source]
        corner = u[column[faces]]
        # A face across the seam of a ring joins the last column to the first, which counts one whole round there.
        wide = corner.max(axis=1) - corner.min(axis=1) > repeats[column[faces[:, 0]]] / 2
        key, index = np.unique(faces.astype(np.int64) * 2 + (wide[:, None] & (corner < 1)), return_inverse=True)
        used, late = key // 2, (key % 2).astype(float)
        source = shaded.source[used]
        repeat = u[column[used]] + late * repeats[column[used]]
        texcoords = np.column_stack([repeat, lattice.vertices[source, 2] / texture_m])
    index = index.reshape(-1, 3).astype(np.int32)
    return Mesh(rough.vertices[source], index, texcoords, shaded.normals[used] if len(shaded.normals) else None)


def _unshaded(rough: RoughSurface) -> ShadedMesh:
    return ShadedMesh(np.arange(len(rough.vertices)), np.zeros((0, 3)), rough.lattice.faces)
