"""Ledges between floors of legs that meet: which facets they are, and a mesh on which they have no height."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Label, Solid, Volume

DEEPEST_M = 0.6  # of a ledge between two floors of legs that are near each other; deeper ones are as surveyed
NEAR_M = 5.0  # along the survey: legs so near share one floor where their sections overlap
_OVERHANG = 0.1  # of a facet's normal, which points out of the free space: what hangs over is no ledge
_OVER_M, _TWIST_M, _EDGE_M = 0.02, 0.1, 1e-3  # see `_is_under`
_PLUMB = 0.02  # of a facet's normal: so steep a ledge has no area seen from above
_ONE_PLACE_M = 1e-6  # seen from above
_ENDS = 4  # facets beside each other at the end of a ledge, at most
_ROUNDING_M = 1e-6


def ledges_of(volume: Volume, network: SurveyNetwork) -> np.ndarray:
    """Return which facets (f,) are ledges: under the floor of another drivable piece that is near along the survey."""
    near = network.near_pairs(NEAR_M)
    by_shot: dict[int, list[int]] = {}
    for number, piece in enumerate(volume.pieces):
        if piece.is_drivable:
            by_shot.setdefault(piece.shot, []).append(number)
    middles, normal = volume.vertices[volume.faces].mean(axis=1), volume.normals
    is_wall = (volume.label == Label.WALL) & (normal[:, 2] < _OVERHANG * np.linalg.norm(normal, axis=1))
    found = np.zeros(len(middles), bool)
    order = np.argsort(volume.source, kind="stable")
    starts = np.searchsorted(volume.source[order], np.arange(len(volume.pieces) + 1))
    for number, piece in enumerate(volume.pieces):
        own = order[starts[number] : starts[number + 1]]
        own = own[is_wall[own]]
        if piece.is_plumb or not len(own):
            continue
        others = [k for shot in (piece.shot, *near[piece.shot]) for k in by_shot.get(int(shot), ()) if k != number]
        for other in others:
            found[own] |= _is_under(middles[own], volume.pieces[other])
    for _ in range(_ENDS):
        found |= _between_floors(volume, is_wall, (volume.label == Label.FLOOR) | found, near)
        found |= _ends(volume, is_wall, found)
    return found


def _between_floors(volume: Volume, is_wall: np.ndarray, is_floor: np.ndarray, near: list[np.ndarray]) -> np.ndarray:
    """Return which facets (f,) of walls have all corners on floors of legs that are near each other."""
    leg = np.full(len(volume.vertices), -1)
    shot = np.array([piece.shot for piece in volume.pieces])[volume.source]
    leg[volume.faces[is_floor]] = shot[is_floor, None]
    some = np.flatnonzero(is_wall & ~is_floor & (leg[volume.faces] >= 0).all(axis=1))
    some = some[np.ptp(volume.vertices[volume.faces[some], 2], axis=1) < DEEPEST_M]
    found = np.zeros(len(is_wall), bool)
    for k in some:
        a, b, c = leg[volume.faces[k]]
        found[k] = all(i == j or j in near[i] for i, j in ((a, b), (b, c), (c, a)))
    return found


def _ends(volume: Volume, is_wall: np.ndarray, is_ledge: np.ndarray) -> np.ndarray:
    """Return which facets (f,) of walls are at the ends of ledges: beside a ledge's facet, and no lower or higher."""
    edges = np.sort(volume.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    one, two = order.reshape(-1, 2).T // 3  # a closed mesh has each edge twice
    one, two = np.concatenate([one, two]), np.concatenate([two, one])
    height = volume.vertices[volume.faces, 2]
    low, high = height.min(axis=1), height.max(axis=1)
    inside = is_wall[two] & (low[two] > low[one] - _ROUNDING_M) & (high[two] < high[one] + _ROUNDING_M)
    found = np.zeros(len(is_wall), bool)
    found[two[inside & is_ledge[one]]] = True
    return found


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


def fold_ledges(volume: Volume, is_floor: np.ndarray, is_ledge: np.ndarray) -> FoldedLedges:
    """Cut plumb ledges at the places of their corners, and find the corners that are over each other.

    The corners below a ledge and those above it are at different places along it. Each facet of a ledge is parted at
    the place of its middle corner, which parts the facet across its longest edge too, until all have a plumb edge.
    """
    normal = volume.normals
    plumb = is_ledge & (np.abs(normal[:, 2]) < _PLUMB * np.linalg.norm(normal, axis=1))
    mesh = _Cuts(volume, plumb)
    for facet in np.flatnonzero(plumb).tolist():
        mesh.part(facet)
    vertices, faces, parent = np.array(mesh.vertices), np.array(mesh.faces), np.array(mesh.parent)
    cut = replace(volume, vertices=vertices, faces=faces, source=volume.source[parent], label=volume.label[parent])
    a, b = (np.concatenate([faces[plumb[parent]][:, k] for k in order]) for order in ((0, 1, 2), (1, 2, 0)))
    over = np.linalg.norm((vertices[a] - vertices[b])[:, :2], axis=1) < _ONE_PLACE_M
    n = len(vertices)
    _, group = connected_components(coo_matrix((np.ones(over.sum()), (a[over], b[over])), (n, n)), directed=False)
    _, first = np.unique(group, return_index=True)
    return FoldedLedges(cut, is_floor[parent], is_ledge[parent], first[group])


class _Cuts:
    """A mesh of which facets are parted."""

    def __init__(self, volume: Volume, plumb: np.ndarray) -> None:
        """Begin with a volume's mesh."""
        self.vertices, self.faces = list(volume.vertices), volume.faces.tolist()
        self.parent = list(range(len(self.faces)))
        self._plumb = plumb
        self._facet = {(face[i], face[i - 2]): k for k, face in enumerate(self.faces) for i in range(3)}

    def part(self, facet: int) -> None:
        """Part a plumb facet, and what comes of it, until each has two corners over each other."""
        stack = [facet]
        while stack:
            face = self.faces[stack.pop()]
            places = np.array([self.vertices[k] for k in face])
            sides = np.roll(places, -1, axis=0)[:, :2] - places[:, :2]
            length = np.linalg.norm(sides, axis=1)
            if length.min() < _ONE_PLACE_M:
                continue
            i = int(np.argmax(length))
            a, b, c = face[i], face[i - 2], face[i - 1]
            share = float((places[i - 1] - places[i])[:2] @ sides[i]) / length[i] ** 2
            if not 0 < share < 1:
                continue
            height = (1 - share) * places[i][2] + share * places[i - 2][2]
            self.vertices.append(np.array([*self.vertices[c][:2], height]))
            for one, two in ((a, b), (b, a)):
                stack += self._halve(one, two, len(self.vertices) - 1)

    def _halve(self, a: int, b: int, middle: int) -> list[int]:
        """Part the facet that has the edge from a to b; return the plumb ones among its halves."""
        facet = self._facet.pop((a, b))
        c = next(k for k in self.faces[facet] if k not in (a, b))
        other = len(self.faces)
        self.faces[facet] = [a, middle, c]
        self.faces.append([middle, b, c])
        self.parent.append(self.parent[facet])
        self._facet |= {(a, middle): facet, (middle, c): facet, (c, a): facet}
        self._facet |= {(middle, b): other, (b, c): other, (c, middle): other}
        return [facet, other] if self._plumb[self.parent[facet]] else []
