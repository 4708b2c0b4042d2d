"""Whether the floor's mesh of a world with heights covers the workings once, without a step, and is gentle enough."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import FLOOR, FREE_SPACE
from pipeline.errors import ArtifactError, GeometryError
from pipeline.geometry.floor.mesh import require_gentle
from pipeline.geometry.floor.wall_foot import boundary_edges, outline_of
from pipeline.mjcf.bundle import WorldRecord, read_floor

_PLACE_M = 2e-4
_OVERLAP_M2 = 1e-5  # for each metre of wall; rounding leaves 1e-14
_LONGER_M = 1e-3  # of the boundary; rounding leaves 1e-12


def require_floor(folder: Path, record: WorldRecord, free: BaseGeometry, steepest_deg: float) -> None:
    """Compare the floor's mesh with the outline of the workings.

    The heights themselves are the survey's, so that any are accepted up to the steepest floor that the builder makes.

    Raises
    ------
    ArtifactError
        If the mesh's boundary is not the outline, faces overlap, the floor is cut open within the workings (its sides
        could have different heights there), or a face is too steep.
    """
    floor, path = read_floor(folder, record), folder / FLOOR
    if floor.is_flat:
        return
    apart = shapely.hausdorff_distance(outline_of(floor).boundary, free.boundary)
    if not apart < _PLACE_M:
        raise ArtifactError(f"{path}: its boundary is {apart:.4f} m from the outline of {FREE_SPACE}")
    twice = float(shapely.area(shapely.polygons(floor.vertices[floor.faces, :2])).sum()) - free.area
    if not abs(twice) <= _OVERLAP_M2 * free.length:
        raise ArtifactError(f"{path}: its faces have {twice:+.4f} m2 more than the outline of {FREE_SPACE}")
    ends = floor.vertices[boundary_edges(floor), :2]
    longer = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) - free.length
    if not abs(longer) <= _LONGER_M:
        raise ArtifactError(f"{path}: its boundary is {longer:+.4f} m longer than the outline of {FREE_SPACE}")
    try:
        require_gentle(floor, steepest_deg)
    except GeometryError as error:
        raise ArtifactError(f"{path}: {error}") from error
