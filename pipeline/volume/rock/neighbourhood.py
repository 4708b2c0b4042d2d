"""What of a volume is about some facets, as a volume of its own, which is put back when it has changed."""

from __future__ import annotations

from dataclasses import replace

import manifold3d
import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.errors import GeometryError
from pipeline.volume.keyed import KeyedSolid, keyed, near_facets, volume_of
from pipeline.volume.separation import boxes_near, boxes_of
from pipeline.volume.union import Volume

_BEYOND_M = 0.0137  # of a box beyond the facets in it: on no plane of theirs


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
            low, high = _apart(low - reach_m - _BEYOND_M, high + reach_m + _BEYOND_M)
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
            If its border is not as it was.
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
        if len(known) > len(set(number[~fresh].tolist())):
            raise GeometryError("volume: rock that is put before thin rock changes what is about it")
        vertices = np.concatenate([whole.vertices, changed.vertices[used[fresh]]])
        used, faces = np.unique(np.concatenate([same[stay], number[corners].reshape(-1, 3)]), return_inverse=True)
        source, label = (
            np.concatenate([ours[~self._within], theirs[new]])
            for ours, theirs in ((whole.source, changed.source), (whole.label, changed.label))
        )
        return Volume(vertices[used], faces.reshape(-1, 3), source, label, whole.pieces)


def _corners(corners: list[list[float]]) -> tuple[tuple[float, ...], ...]:
    """Return the corners of a facet as a key, the same whichever is first."""
    first = corners.index(min(corners))
    return tuple(map(tuple, corners[first:] + corners[:first]))


def _apart(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return boxes (n, 3) m, one about all that meet each other, until none meet."""
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
