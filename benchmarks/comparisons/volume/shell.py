"""The rock as convex parts: one behind every facet of the free space, none in the free space, none left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import manifold3d
import numpy as np
import shapely

from benchmarks.comparisons.volume.volume import Volume

DEPTHS_M = (0.3, 0.15, 0.08, 0.04, 0.02)
_LONGEST = 2.0  # of a corner's way into the rock, in depths: at sharp edges the corner stays nearer
_FLAT = 1e-6  # m, of the corners of one polygon from its plane
_STRAIGHT = 1e-9  # of the sine at a corner of a convex polygon
_ALLOWED_M = 1e-7  # volume of a part in the free space, by its area: rounding
_ROUNDING_M = 1e-9  # a facet that is so deep in a part only touches it
_TILE_FACETS = 150
_RIDGE = 1e-3

Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class ShellPart:
    """One convex part: its corners (k, 3) m, the facets that it lies behind, its shape, and what of it is free, m3."""

    corners: np.ndarray
    facets: list[int]
    shape: str
    depth_m: float  # of its farthest corner behind the facet
    area_m2: float
    intrusion_m3: float


def polygons_of(volume: Volume) -> list[tuple[list[int], list[int]]]:
    """Return convex polygons of coplanar facets with one label: their vertices in order, and their facets."""
    normal = volume.normals
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    ring = {k: face for k, face in enumerate(volume.faces.tolist())}
    held = {k: [k] for k in ring}
    owner = {(face[i], face[(i + 1) % 3]): k for k, face in ring.items() for i in range(3)}
    vertices, label = volume.vertices, volume.label
    offset = np.einsum("ij,ij->i", unit, vertices[volume.faces[:, 0]])
    for (a, b), first in list(owner.items()):
        one, two = owner[a, b], owner.get((b, a), -1)
        if two < 0 or one == two or label[one] != label[two] or unit[one] @ unit[two] < 1 - 1e-9:
            continue
        if np.abs(vertices[ring[two]] @ unit[one] - offset[one]).max() > _FLAT:
            continue
        joined = _spliced(ring[one], ring[two], a, b)
        if joined is None or not _is_convex(vertices[joined], unit[one]):
            continue
        ring[one] = joined
        held[one] += held.pop(two)
        for i, p in enumerate(ring[two]):
            owner[p, ring[two][(i + 1) % len(ring[two])]] = one
        del ring[two], owner[a, b], owner[b, a], first
        owner[a, b] = owner[b, a] = one
    return [(ring[k], held[k]) for k in ring]


def _spliced(one: list[int], two: list[int], a: int, b: int) -> list[int] | None:
    """Return the ring of two polygons that share the edge from a to b; None if they share more corners."""
    i, j = one.index(a), two.index(b)
    first = one[i + 1 :] + one[: i + 1]  # begins at b, ends at a
    second = two[j + 1 :] + two[: j + 1]  # begins at a, ends at b
    joined = first + second[1:-1]
    return joined if len(set(joined)) == len(joined) else None


def _is_convex(corners: np.ndarray, normal: np.ndarray) -> bool:
    edge = np.roll(corners, -1, axis=0) - corners
    edge /= np.maximum(np.linalg.norm(edge, axis=1, keepdims=True), 1e-30)
    turn = np.cross(np.roll(edge, 1, axis=0), edge) @ normal
    return bool((turn > -_STRAIGHT).all() and (np.einsum("ij,ij->i", np.roll(edge, 1, axis=0), edge) > -0.999).all())


def ways_into_rock(volume: Volume) -> np.ndarray:
    """Return for each vertex the vector (v, 3) that goes one metre behind each of its facets, as near as can be."""
    normal = volume.normals
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    corners = volume.vertices[volume.faces]
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("ijk,ijk->ij", to_next, to_last)
    cosine /= np.maximum(np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2), 1e-30)
    angle = np.arccos(np.clip(cosine, -1, 1))
    n = len(volume.vertices)
    squares, sums = np.zeros((n, 3, 3)), np.zeros((n, 3))
    outer = unit[:, :, None] * unit[:, None, :]
    for i in range(3):
        np.add.at(squares, volume.faces[:, i], angle[:, i, None, None] * outer)
        np.add.at(sums, volume.faces[:, i], angle[:, i, None] * unit)
    squares += _RIDGE * np.eye(3)
    way: np.ndarray = np.linalg.solve(squares, sums[:, :, None])[:, :, 0]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return way * np.minimum(1.0, _LONGEST / np.maximum(length, 1e-9))


class Tiles:
    """The free space cut into boxes of few facets, so that a part meets few of them."""

    def __init__(self, solid: manifold3d.Manifold) -> None:
        """Cut along the longest side of the bounding box again and again."""
        self.solids: list[manifold3d.Manifold] = []
        stack = [solid]
        while stack:
            one = stack.pop()
            low, high = _box(one)
            if one.num_tri() <= _TILE_FACETS or (high - low).max() < 1.0:
                self.solids.append(one)
                continue
            axis = int(np.argmax(high - low))
            normal = np.eye(3)[axis]
            stack += [half for half in one.split_by_plane(normal, (low + high)[axis] / 2) if not half.is_empty()]
        boxes = np.array([_box(one) for one in self.solids]).reshape(-1, 2, 3)
        self.low, self.high = boxes[:, 0], boxes[:, 1]

    def near(self, low: np.ndarray, high: np.ndarray) -> Iterator[manifold3d.Manifold]:
        """Return the pieces of the free space that reach into a box."""
        for k in np.flatnonzero((self.low < high).all(axis=1) & (self.high > low).all(axis=1)):
            yield self.solids[k]

    def shared_m3(self, part: manifold3d.Manifold) -> float:
        """Return the volume that a part shares with the free space."""
        return sum((part ^ one).volume() for one in self.near(*_box(part)))


def _box(solid: manifold3d.Manifold) -> tuple[np.ndarray, np.ndarray]:
    bounds = np.array(solid.bounding_box())
    return bounds[:3], bounds[3:]


def build_shell(volume: Volume, progress: Progress = iter) -> list[ShellPart]:
    """Return one part behind each convex polygon of facets.

    The first shape counts that has nothing in the free space: the polygon moved 0.3 m into the rock along the ways of
    its corners, or less; the same cut along the bisectors of the rock's edges; a pyramid; a plate along the normal. If
    all have, it is the one with the least.
    """
    polygons, ways, surroundings = polygons_of(volume), ways_into_rock(volume), _Surroundings(volume)
    normal = volume.normals
    size = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(size, 1e-30)[:, None]
    beside = {(f[i], f[(i + 1) % 3]): k for k, f in enumerate(volume.faces.tolist()) for i in range(3)}
    parts = []
    for number in progress(range(len(polygons))):
        stack = [polygons[number]]
        while stack:
            ring, facets = stack.pop()
            biggest = unit[max(facets, key=lambda k: float(size[k]))]
            across = [unit[beside[ring[(i + 1) % len(ring)], ring[i]]] for i in range(len(ring))]
            shapes = _shapes(volume.vertices[ring], ways[ring], biggest, np.array(across))
            if len(facets) > 1:  # rather a part for each facet than a thin one for all
                shapes = islice(shapes, 2)
            area = float(size[facets].sum() / 2)
            part = _first_fitting(volume.vertices[ring], biggest, shapes, facets, area, surroundings)
            if len(facets) > 1 and part.intrusion_m3 > _ALLOWED_M * area:
                stack += [(volume.faces[k].tolist(), [k]) for k in facets]
            else:
                parts.append(part)
    return parts


def _first_fitting(
    corners: np.ndarray,
    normal: np.ndarray,
    shapes: Iterable[tuple[str, manifold3d.Manifold]],
    facets: list[int],
    area_m2: float,
    surroundings: _Surroundings,
) -> ShellPart:
    best, least = None, np.inf
    for shape, solid in shapes:
        if solid.is_empty() or solid.volume() <= 0:
            continue
        shared = surroundings.shared_m3(solid, facets)
        if shared < least:
            best, least = (shape, solid), shared
        if shared <= _ALLOWED_M * area_m2:
            break
    if best is None:  # a facet without an area
        return ShellPart(np.concatenate([corners, corners + DEPTHS_M[-1] * normal]), facets, "none", 0.0, area_m2, 0.0)
    shape, solid = best
    points = np.asarray(solid.to_mesh64().vert_properties)[:, :3]
    return ShellPart(points, facets, shape, float(((points - corners[0]) @ normal).max()), area_m2, least)


class _Surroundings:
    """The free space about a part: its facets, to see fast that none is in the part, and its solid."""

    def __init__(self, volume: Volume) -> None:
        """Index the facets by their boxes."""
        self._corners = volume.vertices[volume.faces]
        self._low, self._high = self._corners.min(axis=1), self._corners.max(axis=1)
        self._tree = shapely.STRtree(shapely.box(*self._low[:, :2].T, *self._high[:, :2].T))
        self._tiles = Tiles(volume.solid)

    def shared_m3(self, part: manifold3d.Manifold, facets: list[int]) -> float:
        """Return the volume that a part behind some facets shares with the free space.

        A plane of the part's faces that has a facet on its outer side parts them. If one does for each facet, no facet
        is inside the part, so that the part is all rock.
        """
        low, high = _box(part)
        near = self._tree.query(shapely.box(low[0], low[1], high[0], high[1]))
        near = near[(self._low[near, 2] <= high[2]) & (self._high[near, 2] >= low[2])]
        near = near[~np.isin(near, facets)]
        mesh = part.to_mesh64()
        corners = np.asarray(mesh.vert_properties)[:, :3]
        a, b, c = np.moveaxis(corners[np.asarray(mesh.tri_verts, np.int64)], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        offset = np.einsum("pk,pk->p", a, normal)
        sound = (corners @ normal.T - offset).max(axis=0) < _ROUNDING_M  # not of slivers, whose normals are rounding
        normal, offset = normal[sound], offset[sound]
        out = np.einsum("fck,pk->fpc", self._corners[near], normal) - offset[None, :, None]
        if (out.min(axis=2) > -_ROUNDING_M).any(axis=1).all():
            return 0.0
        return self._tiles.shared_m3(part)


def _shapes(
    corners: np.ndarray, ways: np.ndarray, normal: np.ndarray, across: np.ndarray
) -> Iterator[tuple[str, manifold3d.Manifold]]:
    """Return the shapes of a part from the best to the thinnest."""
    hull = manifold3d.Manifold.hull_points
    forward = np.where((ways @ normal)[:, None] > 0.1, ways, normal)
    cuts: list[tuple[np.ndarray, float]] | None = None
    for depth in DEPTHS_M:
        solid = hull(np.concatenate([corners, corners + depth * forward]))
        yield f"moved {depth:g}", solid
        cuts = _bisectors(corners, normal, across) if cuts is None else cuts
        for direction, offset in cuts:
            solid = solid.trim_by_plane(direction, offset)
        yield f"cut {depth:g}", solid
    middle = corners.mean(axis=0)
    for depth in DEPTHS_M[:-1]:
        yield f"pyramid {depth:g}", hull(np.concatenate([corners, [middle + depth * normal]]))
    for depth in DEPTHS_M[2:]:
        yield f"plate {depth:g}", hull(np.concatenate([corners, corners + depth * normal]))


def _bisectors(corners: np.ndarray, normal: np.ndarray, across: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Return the planes that halve the rock at the polygon's edges where it is a wedge: normal to the part, offset."""
    found = []
    for a, b, other in zip(corners, np.roll(corners, -1, axis=0), across, strict=True):
        edge = (b - a) / max(float(np.linalg.norm(b - a)), 1e-30)
        inward = np.cross(normal, edge)  # in the facet, away from the edge
        if inward @ other > -1e-6:  # the rock is not a wedge here
            continue
        into = normal + other
        direction = np.cross(edge, -into)
        size = float(np.linalg.norm(direction))
        if size < 1e-6:
            direction, size = inward, 1.0
        direction = direction / size * (1 if direction @ inward > 0 else -1)
        found.append((direction, float(direction @ a)))
    return found
