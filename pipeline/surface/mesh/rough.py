"""The rough surface: the displaced lattice, simplified, checked, repaired and cut into chunks."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from minexplore import bundle
from minexplore.floors.floor import Floor
from minexplore.floors.folding import Folding
from minexplore.floors.stretch import raise_m
from pipeline.errors import GeometryError
from pipeline.geometry.rock.partition import triangulate
from pipeline.surface.folded.fold import FoldedSurface, fold_surface, shade_folded
from pipeline.surface.mesh.displacement import Bounds, bound_displacement, damp, displaced
from pipeline.surface.mesh.lattice import ROOF, WALL, Lattice
from pipeline.surface.mesh.mesh_checks import find_crossings, find_shared_edges
from pipeline.surface.mesh.normals import ShadedMesh
from pipeline.surface.mesh.simplify import Mesher, SurfaceMesh
from pipeline.surface.mesh.walls import foot_of
from pipeline.surface.texture.coordinates import relax_texture
from pipeline.types import Mesh

_CHUNKS = {WALL: bundle.WALLS, ROOF: bundle.ROOF}
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


def displace_lattice(mesher: Mesher, wanted_m: np.ndarray, bounds: Bounds) -> RoughSurface:
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
        if not len(wrong) and not lattice.floor.is_flat:
            wrong = _crossings_when_folded(points, faces, lattice.floor)
        if not len(wrong):
            return RoughSurface(lattice, vertices, wanted_m, given, mended, mesher.surface(vertices))
        mended = np.concatenate([mended, wrong])
        if repair >= _REFINE_AFTER:
            mesher.refine(wrong)
        near, _ = cKDTree(wrong).query(vertices, distance_upper_bound=_MEND_RADIUS_M, workers=2)
        given = damp(given, near, _MEND_RADIUS_M, _MEND_FACTOR)
        moved = np.isfinite(near)  # only what is near the repairs has moved, so only this is built and checked again
        if lattice.meeting:  # and the next sheet where it meets this one
            moved |= (displaced(lattice, given) != vertices).any(axis=1)
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
    with ThreadPoolExecutor(2) as pool:
        crossings = pool.submit(find_crossings, points, changed)
        shared = pool.submit(find_shared_edges, points, changed)
        folds, knots = _folds(vertices, fine, lattice), _knots(vertices, lattice)
        return np.concatenate([crossings.result(), shared.result(), folds, knots])


def _crossings_when_folded(points: np.ndarray, faces: np.ndarray, floor: Floor) -> np.ndarray:
    """Return the places (k, 3) m, in plan, of crossings of the folded faces, also of faces of two sheets."""
    folded = Folding(floor).fold(points)
    crossings = find_crossings(folded, faces)
    if not len(crossings):
        return crossings
    return np.asarray(points[cKDTree(folded).query(crossings)[1]])


def _folds(vertices: np.ndarray, faces: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Return the centres (k, 3) m of faces that the displacement has turned over.

    Such a face faces away from where it faced before, and from the direction of the displacement. A step on the floor
    chamfer that overhangs does only the first; a face at a corner that points elsewhere than its points, the second.
    """
    parts = [faces[at : at + _FACES] for at in range(0, len(faces), _FACES)]
    with ThreadPoolExecutor(2) as pool:
        faces = np.concatenate([faces[:0], *pool.map(lambda part: _turned(part, vertices, lattice.vertices), parts)])
    turned = np.einsum("ij,ij->i", _normals(vertices[faces]), lattice.direction[faces].sum(axis=1)) <= 0
    return vertices[faces[turned]].mean(axis=1)


def _turned(faces: np.ndarray, vertices: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the faces (k, 3) that face away from where they faced with the vertices `before` (n, 3) m."""
    return faces[np.einsum("ij,ij->i", _normals(vertices[faces]), _normals(before[faces])) <= 0]


def _normals(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _knots(vertices: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Return the place (1, 3) m where the line of the walls on the floor crosses itself, or (0, 3) if it does not."""
    foot, _ = foot_of(vertices[: len(lattice.walls.xy), :2], lattice.walls)
    if foot.is_valid:
        return np.zeros((0, 3))
    reason = shapely.is_valid_reason(foot)
    return np.array([[*map(float, reason[reason.index("[") + 1 : -1].split()), 0.0]])


def closed_mesh(rough: RoughSurface) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) m and faces (m, 3) of the rough surface closed by the floor, in the plan.

    The sheets of a mine are closed by their own floors and open on their seams.
    """
    walls = rough.lattice.walls
    outline, columns = foot_of(rough.vertices[: len(walls.xy), :2], walls)
    points, floor = triangulate(outline)
    if walls.sheets is None:
        number = {tuple(xy): i for i, xy in enumerate(rough.vertices[columns, :2].tolist())}
        place = rough.mesh.place_of(len(columns))
    else:
        on_floor = np.flatnonzero(rough.mesh.vertices[:, 2] == 0)
        place, corners = on_floor, rough.mesh.vertices[on_floor, :2]
        number = dict(zip(map(tuple, corners.tolist()), range(len(on_floor)), strict=True))
    index = place[np.array([number[tuple(xy)] for xy in points.tolist()])]
    return rough.mesh.vertices, np.concatenate([rough.mesh.faces, index[floor]])


def cut_chunks(
    rough: RoughSurface,
    tile_m: float,
    texture_m: float,
    normals: bool = False,
    crease_deg: float = 180.0,
    tether_m: float | None = None,
    folded: FoldedSurface | None = None,
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
    folded : FoldedSurface, optional
        Where the vertices are in space; by default where the floor folds them to. Tiles and texture are of the plan.

    Returns
    -------
    dict of Mesh
        The name holds the piece, and the tile's column and row from the south-west. Faces face the workings. A chunk
        belongs to one sheet.
    """
    lattice, mesh, folded = rough.lattice, rough.mesh, folded or fold_surface(rough)
    shaded = shade_folded(rough, folded, crease_deg) if normals else _unshaded(mesh)
    along = _along_walls(lattice, texture_m)
    centre = lattice.vertices[mesh.source[mesh.faces]].mean(axis=1)[:, :2]
    # A face along a straight wall may have its middle, rounded, a hair beyond the wall.
    tile = np.maximum(np.floor((centre - lattice.vertices[:, :2].min(axis=0)) / tile_m), 0).astype(int)
    tile += lattice.floor.places_at(centre)  # so that no tile has faces of two sheets

    def cut(piece: int) -> dict[str, Mesh]:
        of_piece = np.flatnonzero(mesh.piece == piece)
        offset = np.zeros((len(mesh.vertices), 2))
        if tether_m is not None:
            whole = _chunk(rough, mesh.vertices, shaded, of_piece, piece, along, texture_m, offset)
            axes = texture_axes(rough, of_piece, piece)
            laid_m = whole.texcoords[whole.faces] * texture_m
            faces = folded.number[mesh.faces[of_piece]]
            offset = relax_texture(folded.vertices, faces, laid_m, axes, tether_m)[folded.number] / texture_m
        in_tile = _merge_single_faces(tile[of_piece], centre[of_piece])
        order = np.lexsort(in_tile.T[::-1])
        first = np.flatnonzero(np.any(np.diff(in_tile[order], axis=0, prepend=-1) != 0, axis=1))
        chunks = {}
        for part in np.split(order, first[1:]):
            name = bundle.chunk_mesh(_CHUNKS[piece], *in_tile[part[0]])
            chunks[name] = _chunk(rough, folded.vertices, shaded, of_piece[part], piece, along, texture_m, offset)
        return chunks

    with ThreadPoolExecutor(2) as pool:
        walls, roof = pool.map(cut, (WALL, ROOF))
    return walls | roof


def _merge_single_faces(tile: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the faces' tiles (n, 2); a single face joins the nearest tile, since MuJoCo needs four vertices a mesh."""
    place = (tile[:, 0] - tile[:, 0].min()) * (np.ptp(tile[:, 1]) + 1) + tile[:, 1] - tile[:, 1].min()
    single = np.bincount(place)[place] == 1
    merged = tile.copy()
    for face in np.flatnonzero(single):
        distance = np.linalg.norm(centre - centre[face], axis=1)
        merged[face] = tile[np.where(single, np.inf, distance).argmin()]
    return merged


def _along_walls(lattice: Lattice, texture_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return each column's texture coordinate along its wall, and its ring's number of repeats, a whole number."""
    if lattice.walls.sheets:
        sheets = lattice.walls.sheets
        times = np.maximum(1, np.round(sheets.length_m / texture_m))
        return sheets.along_m / sheets.length_m * times, times
    u, repeats = [], []
    for ring in lattice.walls.rings:
        whole = max(1, round(ring.count * ring.step_m / texture_m))
        u.append(np.arange(ring.count) / ring.count * whole)
        repeats.append(np.full(ring.count, float(whole)))
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
        places = _places_on_surface(rough, shaded.source[used])[:, :2]
        texcoords = (places - _offset_m(rough, shaded.source[used])) / texture_m
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
        stretch = Folding(rough.lattice.floor).stretch_at(places[:, :2])
        above = places[:, 2] if stretch is None else raise_m(places[:, 2], stretch)
        texcoords = np.column_stack([repeat, above / texture_m])
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


def _offset_m(rough: RoughSurface, vertices: np.ndarray) -> np.ndarray | float:
    """Return how far (k, 2) m the sheets of the mesh's vertices, given by number, are moved aside."""
    sheets = rough.lattice.walls.sheets
    return sheets.offset_m[rough.lattice.column[rough.mesh.source[vertices]]] if sheets else 0.0


def _unshaded(mesh: SurfaceMesh) -> ShadedMesh:
    return ShadedMesh(np.arange(len(mesh.vertices)), np.zeros((0, 3)), mesh.faces)
