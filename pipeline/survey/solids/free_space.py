"""The free space that closed pieces make: the union of those of free space, without those of rock."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import manifold3d
import numpy as np
import shapely

from pipeline.scans.meshes.uncrossed import arrays_of
from pipeline.survey.solids.closing import LEAST_M3, ClosedPieces

Place = tuple[float, float, float]
PARTED_M = 0.05  # of rock between spaces that touch: bodies sink in where it is thinner than 2 cm
_LEAST_M2 = 0.01  # of a face in which solids meet
_ALONG = 0.999  # cosine between normals of facets that lie on each other


@dataclass(frozen=True)
class Rock:
    """A piece of rock in the free space: the middle of its box, and its volume."""

    middle_m: Place
    volume_m3: float


@dataclass(frozen=True)
class PiecedSpace:
    """The free space of pieces.

    `rock` lists those that are rock, `turned` counts others whose normals pointed into them, and `touching` are places
    where spaces touched at an edge or a point alone, which are parted.
    """

    solid: manifold3d.Manifold
    rock: list[Rock]
    turned: int
    touching: list[Place]


def free_space_of(pieces: ClosedPieces, weld_m: float) -> PiecedSpace:
    """Return the union of the pieces of free space without those of rock.

    Normals of free space point out of it, or into it: as those of the pieces that have more volume in all. A piece of
    the other sense is rock if most of its volume is inside them; else it is turned. A piece of free space most of which
    is inside rock is cut into that. Pieces that meet in a face, to `weld_m`, m, are joined; spaces that touch at an
    edge or a point get rock between them.
    """
    solids, outwards = pieces.solids, pieces.outwards
    volumes = np.array([solid.volume() for solid in solids])
    others = np.flatnonzero(outwards != (volumes[outwards].sum() >= volumes[~outwards].sum())).tolist()
    free = union_of([solid for k, solid in enumerate(solids) if k not in others])
    rock = [k for k in others if _is_rock(solids[k], free)]
    taken = union_of([solids[k] for k in rock])
    cut = [k for k in range(len(solids)) if rock and k not in rock and _is_inside(solids[k], taken)]
    about = [k for k in range(len(solids)) if k not in cut]
    meeting = dict(zip(about, overlapping([solids[k] for k in about], np.isin(about, rock), weld_m), strict=True))
    found = union_of([meeting[k] for k in about if k not in rock])
    if rock:
        found = union_of([found - union_of([meeting[k] for k in rock]), *(solids[k] for k in cut)])
    found, touching = _parted(found, weld_m) if len(solids) > 1 else (found, [])
    turned = sum(not outwards[k] for k in range(len(solids)) if k not in rock)
    return PiecedSpace(found, [Rock(_middle(solids[k]), solids[k].volume()) for k in rock], turned, touching)


def union_of(solids: list[manifold3d.Manifold]) -> manifold3d.Manifold:
    """Return the union of solids."""
    return manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)


def _is_rock(solid: manifold3d.Manifold, free: manifold3d.Manifold) -> bool:
    """Return whether most of a piece of the other sense is in the free space, and it is no copy of that."""
    return _is_inside(solid, free) and (free - solid).volume() > LEAST_M3


def _is_inside(solid: manifold3d.Manifold, other: manifold3d.Manifold) -> bool:
    return bool((solid ^ other).volume() > solid.volume() / 2)


def _parted(free: manifold3d.Manifold, weld_m: float) -> tuple[manifold3d.Manifold, list[Place]]:
    """Return the free space with rock between spaces no farther apart than a weld, m, and the places where.

    The smaller space gets the rock: as far as it is beside the other's facets there.
    """
    shells = free.decompose()
    spaces = sorted((shell for shell in shells if shell.volume() > 0), key=lambda space: -space.volume())
    boxes = np.array([space.bounding_box() for space in spaces]).reshape(-1, 2, 3)
    places, rock = list[Place](), {k: list[manifold3d.Manifold]() for k in range(len(spaces))}
    for k, (low, high) in enumerate(boxes):
        least, most = np.maximum(low, boxes[:k, 0]), np.minimum(high, boxes[:k, 1])
        for j in np.flatnonzero((least <= most + weld_m).all(axis=1)).tolist():
            if spaces[k].min_gap(spaces[j], 2 * weld_m) <= weld_m:
                x, y, z = ((least[j] + most[j]) / 2).tolist()
                places.append((x, y, z))
                rock[k].append(_about_facets(spaces[j], least[j] - weld_m, most[j] + weld_m))
    if not places:
        return free, []
    floating = [_turned_over(shell) for shell in shells if shell.volume() <= 0]
    parted = union_of([space - union_of(rock[k]) if rock[k] else space for k, space in enumerate(spaces)])
    return parted - union_of(floating) if floating else parted, places


def _turned_over(shell: manifold3d.Manifold) -> manifold3d.Manifold:
    vertices, faces = arrays_of(shell)
    return manifold3d.Manifold(manifold3d.Mesh64(vertices, faces[:, ::-1].astype(np.uint64)))


def _about_facets(space: manifold3d.Manifold, low: np.ndarray, high: np.ndarray) -> manifold3d.Manifold:
    """Return what is beside the facets of a space whose boxes reach into a box (3,), (3,) m."""
    corners = np.take(*arrays_of(space), axis=0)
    meets = (corners.min(axis=1) <= high).all(axis=1) & (corners.max(axis=1) >= low).all(axis=1)
    cube = PARTED_M * np.array(list(product((-1.0, 1.0), repeat=3)))
    return union_of([manifold3d.Manifold.hull_points((one[:, None] + cube).reshape(-1, 3)) for one in corners[meets]])


def _middle(solid: manifold3d.Manifold) -> Place:
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    x, y, z = ((low + high) / 2).tolist()
    return x, y, z


def overlapping(solids: list[manifold3d.Manifold], is_rock: np.ndarray, reach_m: float) -> list[manifold3d.Manifold]:
    """Return solids whose corners on a facet of another are moved beyond it, by twice a reach, m.

    A facet of two solids of free space, or of two of rock, looks the other way than that it lies on. One of rock that
    lies on the border of the free space looks the same way as that, and is moved into the rock behind. Facets lie on
    each other if no more than the reach is between them. Where no corner is on a facet, those of the smaller facet are
    moved.

    Parameters
    ----------
    solids : list
    is_rock : (n,) bool
    reach_m : float
    """
    if len(solids) < 2:
        return solids
    meshes = [arrays_of(solid) for solid in solids]
    piece = np.repeat(np.arange(len(meshes)), [len(faces) for _, faces in meshes])
    first = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    faces = np.concatenate([faces + start for (_, faces), start in zip(meshes, first[:-1], strict=True)])
    pairs = _candidates(vertices[faces], piece, is_rock, reach_m)
    moves = _moves(vertices, faces, pairs, is_rock[piece], reach_m)
    for corner, ways in moves.items():
        vertices[corner] += 2 * reach_m * np.sum(ways, axis=0)
    changed = set(np.searchsorted(first, list(moves), side="right") - 1)
    return [
        _moved(solid, vertices[first[k] : first[k + 1]], meshes[k][1]) if k in changed else solid
        for k, solid in enumerate(solids)
    ]


def _moved(solid: manifold3d.Manifold, vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    moved = manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))
    return moved if moved.status() == manifold3d.Error.NoError else solid


def _normals(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (k, 3) and areas (k,) of triangles."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(twice, 1e-30)[:, None], twice / 2


def _candidates(corners: np.ndarray, piece: np.ndarray, is_rock: np.ndarray, reach_m: float) -> np.ndarray:
    """Return the pairs (k, 2) of facets of two solids whose boxes meet and whose normals are along each other."""
    normal, area = _normals(corners)
    large = np.flatnonzero(area > _LEAST_M2)
    low, high = corners[large].min(axis=1) - reach_m, corners[large].max(axis=1) + reach_m
    boxes = shapely.box(*low[:, :2].T, *high[:, :2].T)
    a, b = shapely.STRtree(boxes).query(boxes)
    meets = (a < b) & (piece[large[a]] != piece[large[b]]) & (low[a, 2] < high[b, 2]) & (low[b, 2] < high[a, 2])
    one, other = large[a[meets]], large[b[meets]]
    along = np.einsum("ij,ij->i", normal[one], normal[other])
    differ = is_rock[piece[one]] != is_rock[piece[other]]
    return np.column_stack([one, other])[np.where(differ, along, -along) > _ALONG]


def _moves(
    vertices: np.ndarray, faces: np.ndarray, pairs: np.ndarray, of_rock: np.ndarray, reach_m: float
) -> dict[int, list[np.ndarray]]:
    """Return the directions in which corners are moved: the normals of their facets that lie on another."""
    corners = vertices[faces]
    normal, area = _normals(corners)
    moves: dict[int, list[np.ndarray]] = {}
    for one, other in pairs.tolist():
        origin, up = corners[one, 0], normal[one]
        aside = np.linalg.svd(up[None])[2][1:]
        flat = [(corners[k] - origin) @ aside.T for k in (one, other)]
        meet = shapely.intersection(*shapely.polygons(np.array(flat)))
        if meet.area < _LEAST_M2:
            continue
        middle = origin + np.array(meet.centroid.coords[0]) @ aside
        if abs((middle - corners[other, 0]) @ normal[other]) > reach_m:
            continue
        movable = [k for k in (one, other) if of_rock[k] or of_rock[one] == of_rock[other]]
        near = [(k, int(c)) for k in movable for c in faces[k][_on(corners[k], corners[one + other - k], reach_m)]]
        smaller = min(movable, key=lambda k: area[k])
        for k, corner in near or [(smaller, int(c)) for c in faces[smaller]]:
            ways = moves.setdefault(corner, [])
            if all(way @ normal[k] < _ALONG for way in ways):
                ways.append(normal[k])
    return moves


def _on(places: np.ndarray, triangle: np.ndarray, reach_m: float) -> np.ndarray:
    """Return which places (k, 3) m are on a triangle (3, 3)."""
    up = _normals(triangle[None])[0][0]
    aside = np.linalg.svd(up[None])[2][1:]
    flat, height = (places - triangle[0]) @ aside.T, (places - triangle[0]) @ up
    beside = shapely.distance(shapely.points(flat), shapely.Polygon((triangle - triangle[0]) @ aside.T))
    return np.asarray((np.abs(height) <= reach_m) & (beside <= reach_m))
