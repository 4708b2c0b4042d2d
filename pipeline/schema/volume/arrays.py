"""The arrays of a volume that `minexplore` has read: a mesh that is closed, parts that are solid."""

from __future__ import annotations

from typing import Any

import numpy as np

from minexplore.bundle import PARTS, VOLUME, BundleError
from minexplore.floors.volume_arrays import FacetLabel, Parts, VolumeArrays, VolumeFacets

_LEAST_M = 1e-6  # MuJoCo refuses a part that is thinner


def check_arrays(volume: VolumeArrays) -> None:
    """Refuse a mesh that is not closed or whose normals point inwards, and parts without a volume.

    Raises
    ------
    BundleError
        Naming the file, the array, and what is wrong with it.
    """
    _require_closed(volume.facets.faces, len(volume.facets.vertices))
    _require_outward(volume.facets)
    _require_solid(volume.parts)


def _require_outward(facets: VolumeFacets) -> None:
    vertices, faces = facets.vertices, facets.faces
    if float(np.einsum("ij,ij->", vertices[faces[:, 0]] - vertices[0], facets.normals)) <= 0:
        raise BundleError(f"{VOLUME}: faces: normals point into the free space, want them out of it")


def _require_closed(faces: np.ndarray, count: int) -> None:
    """Refuse a mesh unless each edge has two facets, which pass it in opposite ways, and each vertex a facet."""
    a, b = (np.concatenate([faces[:, (k + turn) % 3] for k in range(3)]).astype(np.int64) for turn in (0, 1))
    flat = np.flatnonzero(a == b)
    if len(flat):
        raise BundleError(f"{VOLUME}: faces[{flat[0] % len(faces)}]: names vertex {a[flat[0]]} twice")
    own, turned = np.sort(a * count + b), np.sort(b * count + a)
    again = np.flatnonzero(np.diff(own) == 0)
    odd = own[again] if len(again) else np.setdiff1d(own, turned, assume_unique=True)
    if len(odd):
        one, other = divmod(int(odd[0]), count)
        raise BundleError(
            f"{VOLUME}: faces: the edge from vertex {one} to {other} has not two facets in opposite ways; the mesh is "
            "not closed"
        )
    if len(np.unique(a)) != count:
        raise BundleError(f"{VOLUME}: vertices: {count - len(np.unique(a))} belong to no facet")


def _require_solid(parts: Parts) -> None:
    """Refuse a part that has no volume in any direction."""
    starts, count = parts.first[:-1], np.diff(parts.first)
    middle = np.add.reduceat(parts.corners, starts) / count[:, None]
    apart = parts.corners - np.repeat(middle, count, axis=0)
    spread = np.linalg.eigvalsh(np.add.reduceat(apart[:, :, None] * apart[:, None, :], starts))[:, 0]
    thin = np.flatnonzero(~(spread > _LEAST_M**2 / 4))
    if len(thin):
        raise BundleError(f"{PARTS}: part {thin[0]} is {np.sqrt(max(0, spread[thin[0]])):g} m thick, want {_LEAST_M}")


def figures_of(volume: VolumeArrays) -> dict[str, Any]:
    """Return what the record states of the arrays, under `volume`."""
    facets, parts, spans = volume.facets, volume.parts, volume.spans
    return {
        "facets": len(facets.faces),
        "vertices": len(facets.vertices),
        "parts": len(parts),
        "floors": int((parts.label == FacetLabel.FLOOR).sum()),
        "storeys": int(spans.storey.max()) + 1,
        "low_m": round(float(facets.vertices[:, 2].min()), 6),
        "high_m": round(float(facets.vertices[:, 2].max()), 6),
    }
