"""The collision parts of a volume world: those that MuJoCo compiles, floors cut at the borders of zones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress, pairwise

import numpy as np
import shapely
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel, Parts, VolumeFacets
from pipeline.volume.rock.faces import faces_on_facets
from pipeline.volume.rock.ragged import parts_of
from pipeline.volume.shell import ShellPart
from pipeline.volume.world.content import closed_volume

_LEAST_M = 1e-6  # least extent of a part: MuJoCo refuses a sliver without a volume
TWINS_M = 1e-6
_ON_BORDER_M = 1e-4  # a corner so near a border needs no cut


def without_refused(parts: list[ShellPart]) -> tuple[list[ShellPart], int]:
    """Return the parts that MuJoCo compiles, and how many it refuses: slivers without a volume."""
    good = list(compress(parts, _have_volume([part.corners for part in parts]).tolist()))
    return good, len(parts) - len(good)


def _have_volume(parts: list[np.ndarray]) -> np.ndarray:
    """Return which parts (n,) have some; those with equally many corners are measured together."""
    count, found = np.array([len(corners) for corners in parts], int), np.zeros(len(parts), bool)
    for k in np.unique(count):
        some = np.flatnonzero(count == k)
        corners = np.array([parts[n] for n in some.tolist()])
        away = corners - corners.mean(axis=1, keepdims=True)
        found[some] = np.linalg.svd(away, compute_uv=False)[:, 2] > _LEAST_M
    return found


def labelled_parts(parts: list[ShellPart], volume: VolumeFacets, offset_m: np.ndarray) -> Parts:
    """Return a shell's parts in the mine frame, moved by `offset_m` (3,), with the labels of their facets."""
    label = [int(volume.label[part.facets[0]]) for part in parts]
    return collect_labelled([part.corners + offset_m for part in parts], label)


def cut_floors(parts: Parts, borders_m: Sequence[float], volume: VolumeFacets) -> Parts:
    """Return parts of which those under floors are cut in two at each easting, where the floor's friction changes.

    A half that is behind no facet of the volume, as its part leans, is left out.
    """
    corners: list[np.ndarray] = []
    label: list[int] = []
    halves: list[int] = []
    for number, kind in enumerate(parts.label.tolist()):
        pieces = [parts[number]]
        for border in borders_m if kind == FacetLabel.FLOOR else ():
            pieces = [half for piece in pieces for half in _halves(piece, border)]
        kept = list(compress(pieces, _have_volume(pieces).tolist())) if len(pieces) > 1 else pieces
        halves += range(len(corners), len(corners) + len(kept)) if len(pieces) > 1 else ()
        corners += kept
        label += [kind] * len(kept)
    faces = faces_on_facets(closed_volume(volume), parts_of([corners[k] for k in halves]))
    backs = np.ones(len(corners), bool)
    backs[np.delete(halves, faces.part)] = False
    return collect_labelled(list(compress(corners, backs)), list(compress(label, backs)))


def collect_labelled(corners: list[np.ndarray], label: Sequence[int]) -> Parts:
    """Return parts, each with its corners (k, 3) m and its label; of twin corners each has one."""
    parts = parts_of(corners, label)
    twins = twin_corners(parts)
    if not len(twins):
        return parts
    kept = np.ones(len(parts.corners), bool)
    kept[twins] = False
    return parts_of([parts[k][kept[start:end]] for k, (start, end) in enumerate(pairwise(parts.first.tolist()))], label)


def twin_corners(parts: Parts) -> np.ndarray:
    """Return the numbers (t,) of corners that lie within a micrometre of an earlier one of their part.

    MuJoCo finds a hull's farthest corner by climbing along its edges. Between twins it stops, and has no contact:
    findings/mujoco-hull-with-twin-corners-not-touched.sh.
    """
    number = np.repeat(np.arange(len(parts), dtype=float), np.diff(parts.first))
    apart = cKDTree(np.column_stack([parts.corners, number]))  # two parts are a metre apart
    return np.unique(apart.query_pairs(TWINS_M, output_type="ndarray").max(axis=1, initial=0))


def _halves(corners: np.ndarray, border_m: float) -> list[np.ndarray]:
    """Return the parts of a convex part (k, 3) m west and east of an easting."""
    x = corners[:, 0] - border_m
    west, east = corners[x < -_ON_BORDER_M], corners[x > _ON_BORDER_M]
    if not len(west) or not len(east):
        return [corners]
    at = np.meshgrid(np.flatnonzero(x < -_ON_BORDER_M), np.flatnonzero(x > _ON_BORDER_M), indexing="ij")
    a, b = (side.ravel() for side in at)
    share = x[a] / (x[a] - x[b])
    cut = corners[a] + share[:, None] * (corners[b] - corners[a])
    ring = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(cut[:, 1:])))
    cut = np.column_stack([np.full(len(ring), border_m), ring])[:-1]  # the ring ends where it begins
    on = corners[np.abs(x) <= _ON_BORDER_M]
    return [np.concatenate([side, cut, on]) for side in (west, east)]
