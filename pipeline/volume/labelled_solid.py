"""A volume, or what of it is about some facets, as a solid whose facets keep their piece and label, and back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import manifold3d
import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import GeometryError
from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets
from pipeline.geometry.facets.separation import boxes_near, boxes_of
from pipeline.volume.union import Volume, mesh_of

_ROUNDS = 4
_BEYOND_M = 0.0137  # of a box beyond the facets in it: on no plane of theirs
_BESIDE_M = 0.1  # of facets that cross: facets so near are not simplified
_TOGETHER = 1000  # boxes of which all pairs are looked for, and boxes whose pairs with facets are


@dataclass(frozen=True)
class KeyedSolid:
    """A solid, and manifold3d's number of each part of its surface to its key: `len(FacetLabel) * piece + label`.

    manifold3d remembers which facets were coplanar before they moved, so that the solid is made anew of a mesh.
    """

    solid: manifold3d.Manifold
    keys: dict[int, int]


def keyed(volume: Volume, vertices: np.ndarray, label: np.ndarray, kept: np.ndarray | None = None) -> KeyedSolid:
    """Return the solid of a volume's facets with other vertices (v, 3) m and labels (f,).

    Facets of `kept` (f,) are parts of the surface by themselves, so that they are not simplified.
    """
    key_of = len(FacetLabel) * volume.source + label
    part = key_of if kept is None else np.where(kept, key_of.max() + 1 + np.arange(len(key_of)), key_of)
    order = np.argsort(part, kind="stable")
    found, starts = np.unique(part[order], return_index=True)
    first = manifold3d.Manifold.reserve_ids(len(found))
    mesh = manifold3d.Mesh64(
        vertices,
        volume.faces[order].astype(np.uint64),
        run_index=3 * np.append(starts, len(order)),
        run_original_id=first + np.arange(len(found)),
    )
    keys = {first + k: int(key_of[order[start]]) for k, start in enumerate(starts.tolist())}
    return KeyedSolid(manifold3d.Manifold(mesh), keys)


def volume_of(one: KeyedSolid, volume: Volume) -> Volume:
    """Return a keyed solid as a volume of the pieces of the one that it was made from.

    Raises
    ------
    GeometryError
        If it was made of a mesh that is not closed.
    """
    if one.solid.status() != manifold3d.Error.NoError:
        raise GeometryError(f"volume: a changed mesh encloses no space ({one.solid.status().name})")
    vertices, faces, key = mesh_of(one.solid, one.keys)
    return Volume(vertices, faces, key // len(FacetLabel), key % len(FacetLabel), volume.pieces)


def of_facets(volume: Volume, numbers: np.ndarray) -> Volume:
    """Return some facets (n,) of a volume, in order, and their vertices."""
    used, faces = np.unique(volume.faces[numbers], return_inverse=True)
    return replace(
        volume,
        vertices=volume.vertices[used],
        faces=faces.reshape(-1, 3),
        source=volume.source[numbers],
        label=volume.label[numbers],
    )


def with_short_edges(volume: Volume, longest_m: float) -> Volume:
    """Return the volume with its facets split so that no edge is longer than a length, m; the same surface.

    A part is as long as its facet, and MuJoCo keeps the corners of long ones less exactly.
    """
    corners = volume.vertices[volume.faces]
    if np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= longest_m:
        return volume
    one = keyed(volume, volume.vertices, volume.label)
    return volume_of(KeyedSolid(one.solid.refine_to_length(longest_m), one.keys), volume)


def simplified(volume: Volume, stays: np.ndarray, tolerance_m: float) -> Volume:
    """Return the volume without the vertices that no shape needs.

    Facets that are to stay (f,) are as they are, and those that would cross then.
    """
    kept, vertices = stays.copy(), volume.vertices
    for _ in range(_ROUNDS):
        one = keyed(volume, vertices, volume.label, kept)
        found = KeyedSolid(one.solid.simplify(tolerance_m), one.keys)
        apart, faces, _ = mesh_of(found.solid, found.keys)
        pairs = crossing_facets(apart, faces, CROSSING_M)
        beside = near_facets(vertices[volume.faces], apart[faces[np.unique(pairs)]], _BESIDE_M)
        if not (beside & ~kept).any():  # none cross, or all about them stay already
            break
        kept |= beside
    return volume_of(found, volume)


def near_facets(corners: np.ndarray, places: np.ndarray, reach_m: float) -> np.ndarray:
    """Return which facets (f,) have boxes within a distance, m, of those of others (n, 3, 3), seen from above."""
    low, high = boxes_of(corners)
    least, most = boxes_of(places)
    least, most = least - reach_m, most + reach_m
    some = boxes_near(low, high, least, most)
    tree = shapely.STRtree(shapely.box(*low[some, :2].T, *high[some, :2].T))
    found = np.zeros(len(corners), bool)
    for start in range(0, len(least), _TOGETHER):
        bottom, top = least[start : start + _TOGETHER], most[start : start + _TOGETHER]
        other, row = tree.query(shapely.box(*bottom[:, :2].T, *top[:, :2].T))
        facet = some[row]
        beside = (low[facet, 2] < top[other, 2]) & (high[facet, 2] > bottom[other, 2])
        found[facet[beside]] = True
    return found


class Neighbourhood:
    """The part of a volume in boxes about some facets, which all other facets are cut by.

    Attributes
    ----------
    volume : Volume
    border : int
        `source` of its facets that are the boxes' or are cut by them; these are to stay as they are.
    """

    def __init__(self, volume: Volume, places: np.ndarray, reach_m: float) -> None:
        """Cut out all facets within a reach of triangles (n, 3, 3) m, and what is within that reach of these facets.

        manifold3d merges vertices that are too near each other. Where one of them is between facets that are cut out
        and others, those about it are cut out as well.
        """
        self._whole, self.border = volume, int(volume.source.max()) + 1
        corners = volume.vertices[volume.faces]
        about, lost = near_facets(corners, places, reach_m), np.zeros(1)
        while len(lost):
            low, high = boxes_of(corners[about])
            low, high = boxes_apart(low - reach_m - _BEYOND_M, high + reach_m + _BEYOND_M)
            self._within = _within(corners, low, high)
            self.volume = self._cut(low, high)
            rim = np.intersect1d(volume.faces[~self._within], volume.faces[self._within])
            found = set(map(tuple, self.volume.vertices.tolist()))
            lost = rim[[tuple(place) not in found for place in volume.vertices[rim].tolist()]]
            about |= np.isin(volume.faces, lost).any(axis=1)
        self._rim = rim

    def _cut(self, low: np.ndarray, high: np.ndarray) -> Volume:
        """Return what of the whole is in boxes (n, 3) m."""
        whole = self._whole
        marked = replace(whole, source=np.where(self._within, whole.source, self.border))
        one = keyed(marked, whole.vertices, whole.label)
        boxes = [
            manifold3d.Manifold.cube((most - least).tolist()).translate(least.tolist()).as_original()
            for least, most in zip(low, high, strict=True)
        ]
        wall = len(FacetLabel) * self.border + FacetLabel.WALL
        keys = one.keys | {box.original_id(): wall for box in boxes}
        return volume_of(KeyedSolid(one.solid ^ manifold3d.Manifold.compose(boxes), keys), whole)

    def numbers(self, facets: np.ndarray) -> np.ndarray:
        """Return the numbers that facets (n,) of the whole have here, without those that manifold3d has merged."""
        ours = {_corners(one): k for k, one in enumerate(self.volume.vertices[self.volume.faces].tolist())}
        theirs = self._whole.vertices[self._whole.faces[facets]].tolist()
        return np.array([ours[key] for key in map(_corners, theirs) if key in ours], int)

    def at_border(self, volume: Volume) -> np.ndarray:
        """Return which facets (f,) of the neighbourhood, or of a changed one, are its border."""
        found: np.ndarray = volume.source == self.border
        return found

    def put_back(self, changed: Volume) -> Volume:
        """Return the whole volume with a changed neighbourhood in the place of this one.

        Raises
        ------
        GeometryError
            If the whole is not closed then: the border is not as it was, or two of its vertices are at one place.
        """
        whole, new = self._whole, ~self.at_border(changed)
        stay = whole.faces[~self._within]
        known: dict[tuple[float, ...], int] = {}
        same = np.arange(len(whole.vertices))  # of vertices in one place the first
        for k, place in zip(self._rim.tolist(), whole.vertices[self._rim].tolist(), strict=True):
            same[k] = known.setdefault(tuple(place), k)
        used, corners = np.unique(changed.faces[new], return_inverse=True)
        number = np.array([known.get(tuple(place), -1) for place in changed.vertices[used].tolist()], int)
        fresh = number < 0
        number[fresh] = len(whole.vertices) + np.arange(fresh.sum())
        vertices = np.concatenate([whole.vertices, changed.vertices[used[fresh]]])
        used, faces = np.unique(np.concatenate([same[stay], number[corners].reshape(-1, 3)]), return_inverse=True)
        source, label = (
            np.concatenate([ours[~self._within], theirs[new]])
            for ours, theirs in ((whole.source, changed.source), (whole.label, changed.label))
        )
        found = Volume(vertices[used], faces.reshape(-1, 3), source, label, whole.pieces)
        if keyed(found, found.vertices, found.label).solid.status() != manifold3d.Error.NoError:
            raise GeometryError("volume: what is about a changed neighbourhood does not fit it")
        return found


def _corners(corners: list[list[float]]) -> tuple[tuple[float, ...], ...]:
    """Return the corners of a facet as a key, the same whichever is first."""
    first = corners.index(min(corners))
    return tuple(map(tuple, corners[first:] + corners[:first]))


def boxes_apart(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return boxes (n, 3) m, one about all that meet each other, until none meet.

    Many are taken by halves, which leaves few: of all boxes of a cave of 13.6 km the pairs took 4 GB.
    """
    if len(low) > _TOGETHER:
        half = len(low) // 2
        both = boxes_apart(low[:half], high[:half]), boxes_apart(low[half:], high[half:])
        low, high = (np.concatenate(ends) for ends in zip(*both, strict=True))
    while True:
        boxes = shapely.box(*low[:, :2].T, *high[:, :2].T)
        one, two = shapely.STRtree(boxes).query(boxes)
        meets = (low[one, 2] <= high[two, 2]) & (low[two, 2] <= high[one, 2])
        pairs = coo_matrix((np.ones(meets.sum()), (one[meets], two[meets])), (len(low), len(low)))
        count, group = connected_components(pairs, directed=False)
        if count == len(low):
            return low, high
        least, most = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(least, group, low)
        np.maximum.at(most, group, high)
        low, high = least, most


def _within(corners: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return which triangles (n, 3, 3) are in one of some boxes (k, 3) m."""
    least, most = boxes_of(corners)
    some = boxes_near(least, most, low, high)
    tree = shapely.STRtree(shapely.box(*low[:, :2].T, *high[:, :2].T))
    row, box = tree.query(shapely.box(*least[some, :2].T, *most[some, :2].T))
    facet = some[row]
    inside = ((least[facet] > low[box]) & (most[facet] < high[box])).all(axis=1)
    found = np.zeros(len(corners), bool)
    found[facet[inside]] = True
    return found
