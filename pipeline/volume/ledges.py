"""Ledges between floors of legs that meet: which facets they are, and a mesh on which they have no height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.volume.folded.cuts import cut_ledges
from pipeline.volume.folded.steps import ALL_PLACES, DEEPEST_M, MIDDLE, Steps, walls_on_floors
from pipeline.volume.network import NearLegs
from pipeline.volume.union import Label, Solid, Volume

_OVERHANG = 0.1  # of a facet's normal, which points out of the free space: what hangs over is no ledge
_OVER_M, _TWIST_M, _EDGE_M = 0.02, 0.1, 1e-3  # see `_is_under`
_PLUMB = 0.02  # of a facet's normal: a steeper one is no ledge that leans
_ONE_PLACE_M = 1e-3  # seen from above
_ENDS = 4  # facets beside each other at the end of a ledge, at most
_ROUNDING_M = 1e-6
_ROUNDS = 6  # of cuts: each looks at the facets beside those of the one before


def ledges_of(volume: Volume, near: NearLegs) -> np.ndarray:
    """Return which facets (f,) are ledges: under the floor of a drivable leg that meets theirs, and not deep under it.

    What is between floors of other legs is as surveyed.
    """
    drivable = np.flatnonzero([piece.is_drivable for piece in volume.pieces])
    boxes = shapely.box(*np.array([_box(piece) for piece in volume.pieces]).T)
    pairs = shapely.STRtree(boxes[drivable]).query(boxes)
    shot = np.array([piece.shot for piece in volume.pieces])
    pairs = pairs[:, near.has(shot[pairs[0]], shot[drivable[pairs[1]]])]
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
        found |= _between_floors(volume, is_wall, (volume.label == Label.FLOOR) | found, near)
        found |= _ends(volume, beside, is_wall, found)
    return found


def _beside(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets (n,) on both sides of each edge, both ways about."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.argsort(edges[:, 0] * len(faces) + edges[:, 1], kind="stable")
    one, two = order.reshape(-1, 2).T // 3  # a closed mesh has each edge twice
    return np.concatenate([one, two]), np.concatenate([two, one])


def _between_floors(volume: Volume, is_wall: np.ndarray, is_floor: np.ndarray, near: NearLegs) -> np.ndarray:
    """Return which facets (f,) of walls have all corners on floors of legs that meet, none deep under another."""
    low = np.ptp(volume.vertices[volume.faces, 2], axis=1) < DEEPEST_M
    some = np.flatnonzero(is_wall & ~is_floor & low)
    found = np.zeros(len(is_wall), bool)
    found[some[_on_one_floor(volume, is_floor, volume.faces, volume.faces[some], near)]] = True
    return found


def _on_one_floor(
    volume: Volume, is_floor: np.ndarray, faces: np.ndarray, corners: np.ndarray, near: NearLegs
) -> np.ndarray:
    """Return which triples of corners (n, 3) are on floors, some of `faces` (f, 3), of legs that meet."""
    shot_at = np.full(len(volume.vertices), -1)
    shot = np.array([piece.shot for piece in volume.pieces])[volume.source[is_floor]]
    shot_at[faces[is_floor]] = shot[:, None]
    a, b, c = shot_at[corners].T
    found: np.ndarray = near.has(a, b) & near.has(b, c) & near.has(c, a)
    return found & (np.minimum(np.minimum(a, b), c) >= 0)


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

    @property
    def was_cut(self) -> np.ndarray:
        """Return which facets (f,) are parts of one that was cut."""
        found: np.ndarray = np.bincount(self.parent)[self.parent] > 1
        return found


def fold_ledges(
    volume: Volume, is_floor: np.ndarray, is_ledge: np.ndarray, stays: np.ndarray, steps: Steps
) -> FoldedLedges:
    """Cut plumb ledges at the places of their corners, and find the corners that are over each other.

    The corners below a ledge and those above it are at different places along it. Each facet of a ledge is parted at
    the place of its middle corner, which parts the facet across its longest edge too, until all have a plumb edge.
    What is between floors of legs that meet then is ledge too, but of the facets `stays` (f,). `steps` are those of the
    volume.
    """
    cut, parent = volume, np.arange(len(volume.faces))
    near, seen = np.ones(len(parent), bool), np.zeros(len(parent), bool)  # where to look; steps when last looked at
    for _ in range(_ROUNDS):
        some = walls_on_floors(cut, is_floor, stays)
        some = some[near[parent[some]]]
        seen = np.where(near[parent], steps.find(cut, parent, is_floor, some, ALL_PLACES), seen)
        cut, first, own = cut_ledges(cut, is_ledge | seen)
        near |= steps.facets_near(parent[np.bincount(own) > 1])
        parent, is_floor, is_ledge, stays, seen = (x[own] for x in (parent, is_floor, is_ledge, stays, seen))
        some = walls_on_floors(cut, is_floor, stays)
        some = some[near[parent[some]]]
        more = steps.find(cut, parent, is_floor, some, MIDDLE)
        more[some] |= _lie_between(cut, is_floor, first, some, steps.near)
        if not more.any():
            break
        is_floor, is_ledge = is_floor | more, is_ledge | more
        near = steps.facets_near(parent[more | (np.bincount(own)[own] > 1)])
    return FoldedLedges(cut, is_floor, is_ledge, first, parent)


def _lie_between(
    volume: Volume, is_floor: np.ndarray, first: np.ndarray, some: np.ndarray, near: NearLegs
) -> np.ndarray:
    """Return which of some facets (n,) lean or are capped, are low and have all corners on floors of legs that meet."""
    normal, corners = volume.normals[some], volume.faces[some]
    leans = normal[:, 2] < -_PLUMB * np.linalg.norm(normal, axis=1)
    found: np.ndarray = (leans | _capped(volume.vertices[corners])) & (
        np.ptp(volume.vertices[corners, 2], axis=1) < DEEPEST_M
    )
    return found & _on_one_floor(volume, is_floor, first[volume.faces], first[corners], near)


def _capped(corners: np.ndarray) -> np.ndarray:
    """Return which plumb facets, by their corners (n, 3, 3) m, have a corner over the inside of their longest edge.

    Where a wall turns, such a facet is a ledge on one side of the upper floor's corner and a wall on the other.
    """
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.hypot(sides[:, :, 0], sides[:, :, 1])
    row, i = np.arange(len(corners)), length.argmax(axis=1)
    step, side = corners[row, i - 1] - corners[row, i], sides[row, i]
    share = (step[:, :2] * side[:, :2]).sum(axis=1) / np.maximum(length[row, i], 1e-9) ** 2
    margin = _ONE_PLACE_M / np.maximum(length[row, i], 1e-9)
    found: np.ndarray = (share > margin) & (share < 1 - margin) & (step[:, 2] > share * side[:, 2])
    return found
