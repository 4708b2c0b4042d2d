"""The arrays of a volume world's bundle, made from the volume of its survey, and as the volume's measures take them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.volume.union import STEEPEST, Volume
from pipeline.volume.world.topology import LegNetwork

SPARE_M = 1.0  # between the volume and the edge of the world's box in plan
_ROOF_NZ = 0.7  # upward part of a roof's normal, at least
_FLOOR_NZ = -0.3  # of a facet of a leg to drive on that is floor, at most; slabs have floors that are steeper
_THIN_M = 0.1  # of a sliver at a floor: its height over its longest side; in a cave of 35 km one has 0.109
_THIN_ROOF_M = 0.02  # between wall and roof; in a cave of 7.5 km 0.008
_NEAR_NZ = 0.05  # of a roof's normal, beside its limit: such facets move when the mesh is simplified
_LEDGE_M = 0.1  # over a leg's floor, where walls may face up: what was seen from stations begins 0.15 m over it
_BEYOND_M = 0.25  # beside a leg's floor and its ends, likewise; what was seen begins 0.3 m beside it, on no other floor
_SHORTEST_M = 1e-3  # run of a leg, at least


def in_mine_frame(volume: Volume, offset_m: np.ndarray) -> VolumeFacets:
    """Return a volume moved by an offset (3,) m, with the number of the leg that each facet comes from."""
    shot = np.array([piece.shot for piece in volume.pieces])
    return VolumeFacets(
        volume.vertices + offset_m,
        volume.faces.astype(np.int32),
        volume.label.astype(np.int32),
        shot[volume.source].astype(np.int32),
    )


def labels_by_place(mine: VolumeFacets, legs: LegNetwork) -> tuple[np.ndarray, np.ndarray]:
    """Return the labels (f,) that facets of surveyed legs have by slope and place, and which are slivers (f,).

    A floor is on a leg to drive on and its rock is under it. What faces up there is floor too, but for ledges: well
    over the leg's floor, or beside it and on that of no other leg, as splays widen walls there. Of the rest roof is
    what hangs, and wall what is left. Slivers may have another label: rock that is put before walls and edges that are
    cut and simplified leave them, also a few centimetres over floors, which they are no part of.
    """
    size = np.maximum(np.linalg.norm(mine.normals, axis=1), 1e-30)
    up = mine.normals[:, 2] / size
    corners = mine.vertices[mine.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    height_m = size / np.maximum(longest, 1e-30)
    flat = np.array([leg.grade <= STEEPEST for leg in legs.legs])[mine.leg]
    floor = (mine.label == FacetLabel.FLOOR) & (up < 0) & flat
    facing = np.flatnonzero(~floor & flat & (up < _FLOOR_NZ))
    floor[facing] = ~_are_ledges(corners[facing].mean(axis=1), mine.leg[facing], legs)
    label = np.where(floor, FacetLabel.FLOOR, np.where(up > _ROOF_NZ, FacetLabel.ROOF, FacetLabel.WALL))
    at_floor = floor != (mine.label == FacetLabel.FLOOR)
    thin = np.where(at_floor, height_m < _THIN_M, (height_m < _THIN_ROOF_M) | (np.abs(up - _ROOF_NZ) < _NEAR_NZ))
    return label.astype(mine.label.dtype), thin


def with_settled_labels(mine: VolumeFacets, legs: LegNetwork) -> VolumeFacets:
    """Return facets of surveyed legs of which only slivers have another label than their slope and place give."""
    label, is_sliver = labels_by_place(mine, legs)
    return replace(mine, label=np.where(is_sliver, mine.label, label))


def _are_ledges(places: np.ndarray, own: np.ndarray, network: LegNetwork) -> np.ndarray:
    """Return which places (n, 3) m are well over the floor of their leg (n,), or beyond it and on that of no other."""
    legs = network.legs
    ends = np.array([[network.stations_m[name] for name in (leg.start, leg.end)] for leg in legs])
    lrud = np.array([leg.lrud_m for leg in legs])
    over, beyond = _from_floor_m(ends[own], lrud[own], places)
    off: np.ndarray = (over > _LEDGE_M) | (beyond > _BEYOND_M)
    for k in np.flatnonzero([leg.grade <= STEEPEST for leg in legs]).tolist() if off.any() else ():
        over, beyond = _from_floor_m(ends[k], lrud[k], places)
        off &= (np.abs(over) > _LEDGE_M) | (beyond > 0)
    return off


def _from_floor_m(ends: np.ndarray, lrud: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (n,) m places (n, 3) m are over floors of legs, and beyond their walls and ends in plan.

    Legs have ends (n, 2, 3) m and distances to walls, roof and floor (n, 2, 4) m, or one leg (2, 3) and (2, 4).
    """
    start, end = np.moveaxis(ends - lrud[..., 3:] * [0, 0, 1.0], -2, 0)
    way, apart = end - start, places - start
    run = np.maximum(np.linalg.norm(way[..., :2], axis=-1), _SHORTEST_M)
    along = (apart * way)[..., :2].sum(axis=-1) / run
    left = (way[..., 0] * apart[..., 1] - way[..., 1] * apart[..., 0]) / run
    share = np.clip(along / run, 0, 1)
    first, last = np.moveaxis(lrud[..., :2], -2, 0)
    walls = first + share[..., None] * (last - first)
    aside = np.abs(left) - np.where(left < 0, walls[..., 1], walls[..., 0])
    return apart[..., 2] - share * way[..., 2], np.maximum(aside, np.abs(along - run / 2) - run / 2)


def closed_volume(facets: VolumeFacets) -> Volume:
    """Return facets as the measures of `pipeline.volume` take them: a solid with its mesh.

    Raises
    ------
    GeometryError
        If the mesh is not closed, or a facet is turned over.
    """
    faces, leg, label = (column.astype(np.int64) for column in (facets.faces, facets.leg, facets.label))
    volume = Volume(facets.vertices, faces, leg, label, [])
    _ = volume.solid  # which raises the error
    return volume


def world_box(facets: VolumeFacets) -> tuple[float, float, float, float]:
    """Return west, south, east and north, m, of the world's box in plan."""
    low, high = facets.vertices[:, :2].min(axis=0), facets.vertices[:, :2].max(axis=0)
    (west, south), (east, north) = np.floor(low - SPARE_M).tolist(), np.ceil(high + SPARE_M).tolist()
    return west, south, east, north
