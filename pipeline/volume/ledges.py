"""Ledges between floors of legs that meet, on which a mesh has no height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.volume.folded.cuts import cut_ledges
from pipeline.volume.folded.steps import ALL_PLACES, DEEPEST_M, MIDDLE, Steps, walls_on_floors
from pipeline.volume.network import NearLegs
from pipeline.volume.union import Volume

_PLUMB = 0.02  # of a facet's normal: a steeper one is no ledge that leans
_ONE_PLACE_M = 1e-3  # seen from above
_ROUNDS = 6  # of cuts: each looks at the facets beside those of the one before


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
