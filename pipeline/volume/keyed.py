"""A volume as a solid whose facets keep their piece and label through booleans, and back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import manifold3d
import numpy as np
import shapely

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.crossings import CROSSING_M, crossing_facets
from pipeline.volume.separation import boxes_near, boxes_of
from pipeline.volume.union import Volume, mesh_of

_ROUNDS = 4
_BESIDE_M = 0.1  # of facets that cross: facets so near are not simplified


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
    """Return a keyed solid as a volume of the pieces of the one that it was made from."""
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
    other, row = tree.query(shapely.box(*least[:, :2].T, *most[:, :2].T))
    facet = some[row]
    beside = (low[facet, 2] < most[other, 2]) & (high[facet, 2] > least[other, 2])
    found = np.zeros(len(corners), bool)
    found[facet[beside]] = True
    return found
