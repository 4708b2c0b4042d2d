"""Ledges between floors of legs that meet: which facets they are, and a mesh on which they have no height."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import open3d
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.union import Label, Solid, Volume

DEEPEST_M = 0.6  # of a ledge between two floors that overlap; deeper ones are as surveyed
_OVERHANG = 0.1  # of a facet's normal, which points out of the free space: what hangs over is no ledge
_OVER_M, _TWIST_M, _EDGE_M = 0.02, 0.1, 1e-3  # see `_is_under`
_PLUMB = 0.02  # of a facet's normal: so steep a ledge has no area seen from above
_ONE_PLACE_M = 1e-3  # seen from above: corners that are nearer get one height
_ENDS = 4  # facets beside each other at the end of a ledge, at most
_ROUNDING_M = 1e-6
_ROUNDS = 6  # of cuts: each looks at the facets beside those of the one before
_BEFORE_M = (1e-3, 0.05)  # before a wall, where floors are looked for; behind it at the first
# Places on a facet by the weights of its corners: its middle first, then near its corners and edges.
_SAMPLES = np.array([[1, 1, 1], *(0.2 + 1.8 * np.eye(3)), *(1.3 - 1.0 * np.eye(3))])
_SAMPLES /= _SAMPLES.sum(axis=1, keepdims=True)
MIDDLE = _SAMPLES[:1]


def ledges_of(volume: Volume) -> np.ndarray:
    """Return which facets (f,) are ledges: under the floor of another drivable piece, and not deep under it."""
    drivable = np.flatnonzero([piece.is_drivable for piece in volume.pieces])
    boxes = shapely.box(*np.array([_box(piece) for piece in volume.pieces]).T)
    pairs = shapely.STRtree(boxes[drivable]).query(boxes)
    pairs = pairs[:, np.argsort(pairs[0], kind="stable")]
    middles, normal = volume.vertices[volume.faces].mean(axis=1), volume.normals
    is_wall = (volume.label == Label.WALL) & (normal[:, 2] < _OVERHANG * np.linalg.norm(normal, axis=1))
    found = np.zeros(len(middles), bool)
    order = np.argsort(volume.source, kind="stable")
    starts = np.searchsorted(volume.source[order], np.arange(len(volume.pieces) + 1))
    first = np.searchsorted(pairs[0], np.arange(len(volume.pieces) + 1))
    for number, piece in enumerate(volume.pieces):
        own = order[starts[number] : starts[number + 1]]
        own = own[is_wall[own]]
        if piece.is_plumb or not len(own):
            continue
        for other in drivable[pairs[1, first[number] : first[number + 1]]]:
            if other != number:
                found[own] |= _is_under(middles[own], volume.pieces[other])
    beside = _beside(volume.faces)
    for _ in range(_ENDS):
        found |= _between_floors(volume, is_wall, (volume.label == Label.FLOOR) | found)
        found |= _ends(volume, beside, is_wall, found)
    return found


def _beside(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets (n,) on both sides of each edge, both ways about."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.argsort(edges[:, 0] * len(faces) + edges[:, 1], kind="stable")
    one, two = order.reshape(-1, 2).T // 3  # a closed mesh has each edge twice
    return np.concatenate([one, two]), np.concatenate([two, one])


def _between_floors(volume: Volume, is_wall: np.ndarray, is_floor: np.ndarray) -> np.ndarray:
    """Return which facets (f,) of walls have all corners on floors, none deep under another."""
    on_floor = np.zeros(len(volume.vertices), bool)
    on_floor[volume.faces[is_floor]] = True
    low = np.ptp(volume.vertices[volume.faces, 2], axis=1) < DEEPEST_M
    found: np.ndarray = is_wall & ~is_floor & low & on_floor[volume.faces].all(axis=1)
    return found


def _ends(
    volume: Volume, beside: tuple[np.ndarray, np.ndarray], is_wall: np.ndarray, is_ledge: np.ndarray
) -> np.ndarray:
    """Return which facets (f,) of walls are at the ends of ledges: beside a ledge's facet, and no lower or higher."""
    one, two = beside
    height = volume.vertices[volume.faces, 2]
    low, high = height.min(axis=1), height.max(axis=1)
    inside = is_wall[two] & (low[two] > low[one] - _ROUNDING_M) & (high[two] < high[one] + _ROUNDING_M)
    found = np.zeros(len(is_wall), bool)
    found[two[inside & is_ledge[one]]] = True
    return found


def _box(piece: Solid) -> np.ndarray:
    """Return the least and the largest place (4,) m of what is beside a piece's footprint, seen from above."""
    return np.concatenate([piece.footprint.min(axis=0) - _EDGE_M, piece.footprint.max(axis=0) + _EDGE_M])


def _is_under(places: np.ndarray, piece: Solid) -> np.ndarray:
    """Return which places (n, 3) lie below the floor of a piece, within its footprint.

    On its edge they may be `_OVER_M` over the floor's plane, well within it `_TWIST_M`: floors of bends are no planes.
    """
    over = places[:, 2] - piece.floor_at(places[:, :2])
    a, b = piece.footprint, np.roll(piece.footprint, -1, axis=0)
    area = np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    edge = (b - a) * np.sign(area) / np.maximum(np.linalg.norm(b - a, axis=1, keepdims=True), 1e-9)
    step = places[:, None, :2] - a
    inside = (edge[:, 0] * step[:, :, 1] - edge[:, 1] * step[:, :, 0]).min(axis=1)
    near = ((inside > -_EDGE_M) & (over < _OVER_M)) | ((inside > 10 * _EDGE_M) & (over < _TWIST_M))
    found: np.ndarray = near & (over > -DEEPEST_M)
    return found


@dataclass(frozen=True)
class FoldedLedges:
    """A mesh whose plumb ledges are cut at all their corners, and the first (v,) of the corners over each other.

    Corners that one ledge has over each other get one height, so that the ledge has none and no two facets cross.
    """

    volume: Volume
    is_floor: np.ndarray
    is_ledge: np.ndarray
    first: np.ndarray
    parent: np.ndarray  # (f,) the facet that each is cut from


def fold_ledges(volume: Volume, is_floor: np.ndarray, is_ledge: np.ndarray, stays: np.ndarray) -> FoldedLedges:
    """Cut plumb ledges at the places of their corners, and find the corners that are over each other.

    The corners below a ledge and those above it are at different places along it. Each facet of a ledge is parted at
    the place of its middle corner, which parts the facet across its longest edge too, until all have a plumb edge.
    What is between two floors then is ledge too, but of the facets `stays` (f,).
    """
    parent = np.arange(len(volume.faces))
    cut = volume
    for _ in range(_ROUNDS):
        some = walls_on_floors(cut, is_floor, stays)
        cut, first, own = _folded(cut, is_ledge | are_steps(cut, is_floor, some, _SAMPLES))
        parent, is_floor, is_ledge, stays = parent[own], is_floor[own], is_ledge[own], stays[own]
        some = walls_on_floors(cut, is_floor, stays)
        steps = are_steps(cut, is_floor, some, MIDDLE)
        steps[some] |= _lie_between(cut, is_floor, first, some)
        if not steps.any():
            break
        is_floor, is_ledge = is_floor | steps, is_ledge | steps
    return FoldedLedges(cut, is_floor, is_ledge, first, parent)


def _lie_between(volume: Volume, is_floor: np.ndarray, first: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Return which of some facets (n,) lean, are low and have all corners on floors."""
    on_floor = np.zeros(len(first), bool)
    on_floor[first[volume.faces[is_floor]]] = True
    normal, corners = volume.normals[some], volume.faces[some]
    leans = normal[:, 2] < -_PLUMB * np.linalg.norm(normal, axis=1)
    found: np.ndarray = leans & (np.ptp(volume.vertices[corners, 2], axis=1) < DEEPEST_M)
    return found & on_floor[first[corners]].all(axis=1)


def walls_on_floors(volume: Volume, is_floor: np.ndarray, stays: np.ndarray) -> np.ndarray:
    """Return the facets (n,) of walls that have a corner on a floor; none of `stays` (f,)."""
    corner = np.zeros(len(volume.vertices), bool)
    corner[volume.faces[is_floor]] = True
    normal = volume.normals
    is_wall = (volume.label == Label.WALL) & (normal[:, 2] < _OVERHANG * np.linalg.norm(normal, axis=1))
    return np.flatnonzero(is_wall & ~is_floor & ~stays & corner[volume.faces].any(axis=1))


def are_steps(volume: Volume, is_floor: np.ndarray, some: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return which facets (f,), of some (n,), have a place between two floors, at most `DEEPEST_M` apart.

    One floor is over the rock behind the place, the other under the free space before it.
    """
    places = np.einsum("sc,fcx->sfx", samples, volume.vertices[volume.faces[some]])
    normal = volume.normals[some]
    way = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    scene, middle = open3d.t.geometry.RaycastingScene(nthreads=1), volume.vertices.mean(axis=0)
    scene.add_triangles((volume.vertices - middle).astype(np.float32), volume.faces.astype(np.uint32))

    def far_m(places: np.ndarray, up: float) -> np.ndarray:
        """Return how far (n,) m a floor is over or under places (n, 3)."""
        rays = np.column_stack([places - middle, np.tile([0, 0, up], (len(places), 1))]).astype(np.float32)
        found = scene.cast_rays(open3d.core.Tensor(rays), nthreads=1)
        far, hit = found["t_hit"].numpy().astype(float), found["primitive_ids"].numpy().astype(np.int64)
        on_floor = np.isfinite(far)
        on_floor[on_floor] = is_floor[hit[on_floor]]
        return np.where(on_floor, far, np.inf)

    places, way = places.reshape(-1, 3), np.tile(way, (len(samples), 1))
    apart = far_m(places + _BEFORE_M[0] * way, 1.0)
    under = np.flatnonzero(apart < DEEPEST_M)
    apart[under] += np.minimum(*(far_m(places[under] - beside * way[under], -1.0) for beside in _BEFORE_M))
    found_steps = np.zeros(len(volume.faces), bool)
    found_steps[some] = (apart < DEEPEST_M).reshape(len(samples), -1).any(axis=0)
    return found_steps


def _folded(volume: Volume, is_ledge: np.ndarray) -> tuple[Volume, np.ndarray, np.ndarray]:
    """Return the mesh with cut ledges, the first (v,) of the corners over each other, and each facet's parent (f,)."""
    normal = volume.normals
    plumb = is_ledge & (np.abs(normal[:, 2]) < _PLUMB * np.linalg.norm(normal, axis=1))
    mesh = _Cuts(volume, plumb)
    for facet in np.flatnonzero(plumb).tolist():
        mesh.part(facet)
    vertices, faces, parent = mesh.mesh()
    cut = replace(volume, vertices=vertices, faces=faces, source=volume.source[parent], label=volume.label[parent])
    a, b = (np.concatenate([faces[plumb[parent]][:, k] for k in order]) for order in ((0, 1, 2), (1, 2, 0)))
    over = np.linalg.norm((vertices[a] - vertices[b])[:, :2], axis=1) < _ONE_PLACE_M
    n = len(vertices)
    _, group = connected_components(coo_matrix((np.ones(over.sum()), (a[over], b[over])), (n, n)), directed=False)
    _, first = np.unique(group, return_index=True)
    return cut, first[group], parent


class _Cuts:
    """A mesh of which facets are parted."""

    def __init__(self, volume: Volume, plumb: np.ndarray) -> None:
        """Begin with a volume's mesh; edges are looked up beside plumb facets alone."""
        self.vertices, self.faces = volume.vertices, volume.faces
        self._added: list[np.ndarray] = []
        self._more: list[list[int]] = []
        self._parents: list[int] = []
        self._plumb = plumb
        corner = np.zeros(len(volume.vertices), bool)
        corner[volume.faces[plumb]] = True
        beside = np.flatnonzero(corner[volume.faces].sum(axis=1) >= 2)
        self._ours = dict(zip(beside.tolist(), volume.faces[beside].tolist(), strict=True))
        self._facet = {(face[i], face[i - 2]): k for k, face in self._ours.items() for i in range(3)}

    def part(self, facet: int) -> None:
        """Part a plumb facet, and what comes of it, until each has two corners over each other."""
        stack = [facet]
        while stack:
            face = self._ours[stack.pop()]
            places = np.array([self._place(k) for k in face])
            sides = np.roll(places, -1, axis=0)[:, :2] - places[:, :2]
            length = np.linalg.norm(sides, axis=1)
            if length.min() < _ONE_PLACE_M:
                continue
            i = int(np.argmax(length))
            a, b, c = face[i], face[i - 2], face[i - 1]
            share = float((places[i - 1] - places[i])[:2] @ sides[i]) / length[i] ** 2
            if not _ONE_PLACE_M < share * length[i] < length[i] - _ONE_PLACE_M:
                continue
            height = (1 - share) * places[i][2] + share * places[i - 2][2]
            self._added.append(np.array([*self._place(c)[:2], height]))
            for one, two in ((a, b), (b, a)):
                stack += self._halve(one, two, len(self.vertices) + len(self._added) - 1)

    def _halve(self, a: int, b: int, middle: int) -> list[int]:
        """Part the facet that has the edge from a to b; return the plumb ones among its halves."""
        facet = self._facet.pop((a, b))
        c = next(k for k in self._ours[facet] if k not in (a, b))
        other = len(self.faces) + len(self._parents)
        self._ours[facet], self._ours[other] = [a, middle, c], [middle, b, c]
        self._parents.append(self._parent(facet))
        self._facet |= {(a, middle): facet, (middle, c): facet, (c, a): facet}
        self._facet |= {(middle, b): other, (b, c): other, (c, middle): other}
        return [facet, other] if self._plumb[self._parent(facet)] else []

    def mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the vertices (v, 3) m, the facets (f, 3), and the facet (f,) that each is of."""
        count = len(self.faces)
        faces = np.concatenate([self.faces, np.zeros((len(self._parents), 3), int)])
        faces[list(self._ours)] = np.array(list(self._ours.values())).reshape(-1, 3)
        vertices = np.concatenate([self.vertices, np.array(self._added).reshape(-1, 3)])
        return vertices, faces, np.concatenate([np.arange(count), np.array(self._parents, int)])

    def _parent(self, facet: int) -> int:
        return facet if facet < len(self.faces) else self._parents[facet - len(self.faces)]

    def _place(self, vertex: int) -> np.ndarray:
        count = len(self.vertices)
        place: np.ndarray = self.vertices[vertex] if vertex < count else self._added[vertex - count]
        return place
