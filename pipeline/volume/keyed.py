"""A volume as a solid whose facets keep their piece and label through booleans, and back."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from pipeline.volume.union import Label, Volume, mesh_of


@dataclass(frozen=True)
class KeyedSolid:
    """A solid, and manifold3d's number of each part of its surface to the piece and label: `len(Label) * piece + label`.

    manifold3d remembers which facets were coplanar before they moved, so that the solid is made anew of a mesh.
    """

    solid: manifold3d.Manifold
    keys: dict[int, int]


def keyed(volume: Volume, vertices: np.ndarray, label: np.ndarray) -> KeyedSolid:
    """Return the solid of a volume's facets with other vertices (v, 3) m and labels (f,)."""
    key_of = len(Label) * volume.source + label
    order = np.argsort(key_of, kind="stable")
    found, starts = np.unique(key_of[order], return_index=True)
    first = manifold3d.Manifold.reserve_ids(len(found))
    mesh = manifold3d.Mesh64(
        vertices,
        volume.faces[order].astype(np.uint64),
        run_index=3 * np.append(starts, len(order)),
        run_original_id=first + np.arange(len(found)),
    )
    return KeyedSolid(manifold3d.Manifold(mesh), {first + k: int(found[k]) for k in range(len(found))})


def volume_of(one: KeyedSolid, volume: Volume) -> Volume:
    """Return a keyed solid as a volume of the pieces of the one that it was made from."""
    vertices, faces, key = mesh_of(one.solid, one.keys)
    solid = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces.astype(np.uint64))).as_original()
    if solid.status() != manifold3d.Error.NoError:
        raise ValueError(f"volume: the moved mesh is not closed ({solid.status()})")
    return Volume(solid, vertices, faces, key // len(Label), key % len(Label), volume.pieces, volume.numbers)


def simplified(volume: Volume, vertices: np.ndarray, label: np.ndarray, tolerance_m: float) -> Volume:
    """Return the volume with moved vertices and other labels, and without the vertices that no shape needs."""
    one = keyed(volume, vertices, label)
    return volume_of(KeyedSolid(one.solid.simplify(tolerance_m), one.keys), volume)
