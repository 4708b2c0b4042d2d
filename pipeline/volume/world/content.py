"""The arrays of a volume world's bundle, made from the volume of its survey, and as the volume's measures take them."""

from __future__ import annotations

import numpy as np

from minexplore.floors.volume_arrays import VolumeFacets
from pipeline.volume.union import Volume

SPARE_M = 1.0  # between the volume and the edge of the world's box in plan


def in_mine_frame(volume: Volume, offset_m: np.ndarray) -> VolumeFacets:
    """Return a volume moved by an offset (3,) m, with the number of the leg that each facet comes from."""
    shot = np.array([piece.shot for piece in volume.pieces])
    return VolumeFacets(
        volume.vertices + offset_m,
        volume.faces.astype(np.int32),
        volume.label.astype(np.int32),
        shot[volume.source].astype(np.int32),
    )


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
