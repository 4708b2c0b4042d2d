"""Whether collision parts are the prisms of a partition of the rock: upright, on its corners, without overlap."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import MultiLineString, Polygon

from minexplore.bundle import MODEL, is_rock
from minexplore.physics.local_models import part_vertices
from pipeline.errors import ArtifactError
from pipeline.geometry.rock.partition import Box, cut_lines
from pipeline.mjcf.bundle import WorldRecord

_PLACE_M = 2e-4  # centres have four decimals, vertices 32 bits
_OVERLAP_M = 4e-4  # of two parts along their common edges


def require_prisms(
    folder: Path, record: WorldRecord, stated: mujoco.MjSpec, free: Polygon, tile_m: float | None = None
) -> None:
    """Compare the collision parts with the corners of outline, box and tiles, and with the height.

    That they cover all rock and nothing else is the certificate's matter.

    Raises
    ------
    ArtifactError
        With the part, the vertex and what is wrong.
    """
    corners = cKDTree(_corners(free, record.world_m, tile_m))
    outlines = []
    for geom in (geom for geom in stated.geoms if is_rock(geom.name)):
        vertices = part_vertices(stated, geom) + geom.pos
        where = f"{folder / MODEL}: geom {geom.name}"
        low, high = vertices[vertices[:, 2] < record.height_m / 2], vertices[vertices[:, 2] >= record.height_m / 2]
        if len(low) != len(high) or not (
            np.abs(low[:, 2]).max(initial=0.0) < _PLACE_M
            and np.abs(high[:, 2] - record.height_m).max(initial=0.0) < _PLACE_M
            and np.abs(low[:, :2] - high[:, :2]).max(initial=0.0) < _PLACE_M
        ):
            raise ArtifactError(f"{where}: not an upright prism from the floor to {record.height_m} m")
        off, _ = corners.query(low[:, :2])
        if off.max() > _PLACE_M:
            x, y = low[int(off.argmax()), :2]
            raise ArtifactError(
                f"{where}: a corner at ({x:.3f}, {y:.3f}) m is {off.max():.3f} m from the corners of outline and box, "
                f"want at most {_PLACE_M} m"
            )
        ring = Polygon(low[:, :2])
        hull = ring.convex_hull
        if not ring.is_valid or hull.area - ring.area > _OVERLAP_M * ring.length:
            raise ArtifactError(f"{where}: its outline is not convex")
        outlines.append(hull)
    solid = shapely.union_all(outlines)
    twice = sum(outline.area for outline in outlines) - solid.area
    if twice > _OVERLAP_M * sum(outline.length for outline in outlines):
        raise ArtifactError(f"{folder / MODEL}: collision parts overlap by {twice:.3f} m2")


def _corners(free: Polygon, world_m: Box, tile_m: float | None) -> np.ndarray:
    """Return the places (n, 2) m where a part may have a corner: of outline, box and tiles, and on borders of tiles."""
    eastings, northings = cut_lines(world_m, tile_m)
    west, south, east, north = world_m
    borders = MultiLineString(
        [((x, south), (x, north)) for x in eastings[1:-1]] + [((west, y), (east, y)) for y in northings[1:-1]]
    )
    crossings = shapely.get_coordinates(free.boundary.intersection(borders))
    tiles = np.stack(np.meshgrid(eastings, northings), axis=-1).reshape(-1, 2)
    return np.concatenate([shapely.get_coordinates(free), tiles, crossings])
