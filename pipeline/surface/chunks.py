"""Chunks of the rough surface: walls and roof by tiles of the plan, with texture and normals."""

from __future__ import annotations

import numpy as np

from minexplore import bundle
from pipeline.surface.mesh.lattice import ROOF, WALL, Lattice
from pipeline.surface.mesh.normals import ShadedMesh, shade_mesh
from pipeline.surface.mesh.rough import RoughSurface
from pipeline.surface.mesh.simplify import SurfaceMesh
from pipeline.surface.texture.coordinates import relax_texture
from pipeline.types import Mesh

_ONE_REPEAT = 0.5  # of the texture, at least, are stretched to a whole one
_CHUNKS = {WALL: bundle.WALLS, ROOF: bundle.ROOF}


def cut_chunks(
    rough: RoughSurface,
    tile_m: float,
    texture_m: float,
    normals: bool = False,
    crease_deg: float = 180.0,
    tether_m: float | None = None,
) -> dict[str, Mesh]:
    """Cut walls and roof into square tiles of the plan, so that a renderer can skip most of them.

    Parameters
    ----------
    rough : RoughSurface
    tile_m, texture_m : float
        Side of a tile, and length on the rock that one repeat of the texture covers.
    normals : bool
        Give each vertex the normal of the whole surface, so that chunks meet without a seam; 12 bytes a vertex.
    crease_deg : float
        Faces that meet at a sharper angle share no normal.
    tether_m : float, optional
        Let the texture follow the displaced surface by `relax_texture`; without it, it is that of the plan's walls.

    Returns
    -------
    dict of Mesh
        The name holds the piece, and the tile's column and row from the south-west. Faces face the workings.
    """
    lattice, mesh = rough.lattice, rough.mesh
    shaded = shade_mesh(mesh.vertices, mesh.faces, crease_deg) if normals else _unshaded(mesh)
    along = _along_walls(lattice, texture_m)
    centre = lattice.vertices[mesh.source[mesh.faces]].mean(axis=1)[:, :2]
    # A face along a straight wall may have its middle, rounded, a hair beyond the wall.
    tile = np.maximum(np.floor((centre - lattice.vertices[:, :2].min(axis=0)) / tile_m), 0).astype(int)

    def cut(piece: int) -> dict[str, Mesh]:
        of_piece = np.flatnonzero(mesh.piece == piece)
        offset = np.zeros((len(mesh.vertices), 2))
        if tether_m is not None:
            whole = _chunk(rough, mesh.vertices, shaded, of_piece, piece, along, texture_m, offset)
            axes = texture_axes(rough, of_piece, piece)
            laid_m = whole.texcoords[whole.faces] * texture_m
            del whole
            offset = relax_texture(mesh.vertices, mesh.faces[of_piece], laid_m, axes, tether_m) / texture_m
        in_tile = merge_single_faces(tile[of_piece], centre[of_piece])
        order = np.lexsort(in_tile.T[::-1])
        first = np.flatnonzero(np.any(np.diff(in_tile[order], axis=0, prepend=-1) != 0, axis=1))
        chunks = {}
        for part in np.split(order, first[1:]):
            name = bundle.chunk_mesh(_CHUNKS[piece], *in_tile[part[0]])
            chunks[name] = _chunk(rough, mesh.vertices, shaded, of_piece[part], piece, along, texture_m, offset)
        return chunks

    return cut(WALL) | cut(ROOF)


def merge_single_faces(tile: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the faces' tiles (n, 2); a single face joins the nearest tile, since MuJoCo needs four vertices a mesh."""
    place = (tile[:, 0] - tile[:, 0].min()) * (np.ptp(tile[:, 1]) + 1) + tile[:, 1] - tile[:, 1].min()
    single = np.bincount(place)[place] == 1
    merged = tile.copy()
    for face in np.flatnonzero(single):
        distance = np.linalg.norm(centre - centre[face], axis=1)
        merged[face] = tile[np.where(single, np.inf, distance).argmin()]
    return merged


def _along_walls(lattice: Lattice, texture_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return each column's texture coordinate along its wall, and its ring's number of repeats.

    It is a whole number, so that the texture has no seam, except round columns that it would stretch too much for.
    """
    u, repeats = [], []
    for ring in lattice.walls.rings:
        covered = ring.count * ring.step_m / texture_m
        covered = covered if covered < _ONE_REPEAT else max(1.0, float(round(covered)))
        u.append(np.arange(ring.count) / ring.count * covered)
        repeats.append(np.full(ring.count, covered))
    return np.concatenate(u), np.concatenate(repeats)


def _chunk(
    rough: RoughSurface,
    vertices: np.ndarray,
    shaded: ShadedMesh,
    part: np.ndarray,
    piece: int,
    along: tuple[np.ndarray, np.ndarray],
    texture_m: float,
    offset: np.ndarray,
) -> Mesh:
    mesh, faces = rough.mesh, shaded.faces[part]
    if piece == ROOF:
        used, index = np.unique(faces, return_inverse=True)
        texcoords = _places_on_surface(rough, shaded.source[used])[:, :2] / texture_m
    else:
        u, repeats = along
        column = rough.lattice.column[mesh.source[shaded.source[faces]]]
        corner = u[column]  # without the vertices' own offsets, which could hide the seam
        # A face across the seam of a ring joins the last column to the first, which counts one whole round there.
        wide = corner.max(axis=1) - corner.min(axis=1) > repeats[column[:, 0]] / 2
        key, index = np.unique(
            faces.astype(np.int64) * 2 + (wide[:, None] & (corner < repeats[column] / 2)), return_inverse=True
        )
        used, late = key // 2, (key % 2).astype(float)
        column = rough.lattice.column[mesh.source[shaded.source[used]]]
        repeat = u[column] + late * repeats[column] + _beside(rough, shaded.source[used]) / texture_m
        places = _places_on_surface(rough, shaded.source[used])
        texcoords = np.column_stack([repeat, places[:, 2] / texture_m])
    index = index.reshape(-1, 3).astype(np.int32)
    texcoords = texcoords + offset[shaded.source[used]]
    normals = shaded.normals[used] if len(shaded.normals) else None
    return Mesh(vertices[shaded.source[used]], index, texcoords, normals)


def texture_axes(rough: RoughSurface, faces: np.ndarray, piece: int) -> np.ndarray:
    """Return the axes (k, 2, 3) of the texture at faces, given by number: along the wall and up, or east and north."""
    if piece == ROOF:
        return np.broadcast_to(np.eye(3)[:2], (len(faces), 2, 3))
    column = rough.lattice.column[rough.mesh.source[rough.mesh.faces[faces]]]
    inward = rough.lattice.walls.inward[column].mean(axis=1)
    inward = inward / np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-9)
    level, up = np.zeros(len(faces)), np.tile([0.0, 0.0, 1.0], (len(faces), 1))
    return np.stack([np.column_stack([inward[:, 1], -inward[:, 0], level]), up], axis=1)


def _beside(rough: RoughSurface, vertices: np.ndarray) -> np.ndarray:
    """Return how far (k,) m the mesh's vertices lie along the wall from their columns."""
    walls, source = rough.lattice.walls, rough.mesh.source[vertices]
    inward = walls.inward[rough.lattice.column[source]]
    offset = rough.mesh.vertices[vertices] - rough.vertices[source]
    return offset[:, 0] * inward[:, 1] - offset[:, 1] * inward[:, 0]


def _places_on_surface(rough: RoughSurface, vertices: np.ndarray) -> np.ndarray:
    """Return the places (k, 3) m of the mesh's vertices, given by number, on the surface before displacement."""
    source = rough.mesh.source[vertices]
    return rough.lattice.vertices[source] + (rough.mesh.vertices[vertices] - rough.vertices[source])


def _unshaded(mesh: SurfaceMesh) -> ShadedMesh:
    count = len(mesh.vertices)
    return ShadedMesh(np.arange(count), np.zeros((0, 3)), mesh.faces, np.zeros(count, bool))
