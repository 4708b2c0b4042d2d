"""Facets of a volume by how the survey knows them, for the 3D view: measured, interpolated or assumed."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.report.figures.legs import DrawnLegs

_ON = 1e-9  # of a corner's distance from the middle of its leg, over the leg's length


def facets_by_known(
    corners_m: np.ndarray, label: np.ndarray, leg: np.ndarray, legs: DrawnLegs
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return triangles (k, 3, 3) m cut in the middle of their legs, how each is known (k,), and its facet (k,).

    A facet of a wall is known as the wall on its side of the leg, at the nearer station.

    Parameters
    ----------
    corners_m : (f, 3, 3) float64, m, mine frame
    label, leg : (f,) int
    legs : DrawnLegs
    """
    start, step = legs.ends_m[leg, 0], np.diff(legs.ends_m, axis=1)[leg, 0]
    size = np.maximum((step**2).sum(axis=1), 1e-12)
    share = ((corners_m - start[:, None]) * step[:, None]).sum(axis=2) / size[:, None] - 0.5
    triangles, of = _cut(corners_m, share)
    middle = triangles.mean(axis=1)
    late = ((middle - start[of]) * step[of]).sum(axis=1) / size[of] > 0.5
    end = late.astype(int)
    aside = ((middle - legs.ends_m[leg[of], end])[:, :2] * legs.across[leg[of], end]).sum(axis=1)
    column = np.select([label[of] == FacetLabel.FLOOR, label[of] == FacetLabel.ROOF], [3, 2], np.where(aside > 0, 0, 1))
    return triangles, legs.known[leg[of], end, column], of


def _cut(corners_m: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return triangles (f, 3, 3) m cut where a value (f, 3), linear over each, is 0, and the facet of each part."""
    low, high = (off < -_ON).any(axis=1), (off > _ON).any(axis=1)
    mixed = np.flatnonzero(low & high)
    whole = np.setdiff1d(np.arange(len(off)), mixed)
    sign = np.sign(np.where(np.abs(off[mixed]) <= _ON, 0.0, off[mixed]))
    alone = np.where(sign.sum(axis=1) > 0, -1.0, 1.0)  # the side with one corner; with a corner on the cut, either
    first = (sign == alone[:, None]).argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    rows = np.arange(len(mixed))[:, None]
    a, b, c = np.moveaxis(corners_m[mixed][rows, order], 1, 0)
    u, v, w = off[mixed][rows, order].T
    ab, ac = (a + (np.clip(u / (u - other), 0, 1))[:, None] * (to - a) for other, to in ((v, b), (w, c)))
    parts = [corners_m[whole], *(np.stack(part, axis=1) for part in ((a, ab, ac), (ab, b, c), (ab, c, ac)))]
    return np.concatenate(parts), np.concatenate([whole, mixed, mixed, mixed])
