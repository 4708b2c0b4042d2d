"""Make the smooth surface of a bundle again from its outline and compare it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from shapely import Polygon

from minexplore.bundle import FLOOR_CHAMFER, ROOF, WALLS, mesh_file, smooth_mesh
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import WorldRecord
from pipeline.proof.same_surface import surfaces_differ
from pipeline.store.codecs import decode
from pipeline.surface.smooth import FLOOR, smooth_surface
from pipeline.types import Mesh


def texture_repeat_m(folder: Path) -> float:
    """Return the length that one repeat of the texture covers, m, by the smooth floor chamfer; 0 if it has none."""
    floor: Mesh = decode(folder / mesh_file(smooth_mesh(FLOOR_CHAMFER)), Mesh)
    widest = int(np.abs(floor.texcoords).max(axis=1).argmax())
    axis = int(np.abs(floor.texcoords[widest]).argmax())
    repeats = float(floor.texcoords[widest, axis])
    return round(float(floor.vertices[widest, axis]) / repeats, 4) if repeats else 0.0


def roof_foot_m(folder: Path) -> float:
    """Return the height at which the smooth roof begins, m."""
    roof: Mesh = decode(folder / mesh_file(smooth_mesh(ROOF)), Mesh)
    return float(roof.vertices[:, 2].min())


def require_smooth(folder: Path, record: WorldRecord, free: Polygon) -> None:
    """Compare the smooth surface with the one of the outline; its two chamfers and its texture's size are read off.

    Raises
    ------
    ArtifactError
        With the file and how it differs.
    """
    floor: Mesh = decode(folder / mesh_file(smooth_mesh(FLOOR_CHAMFER)), Mesh)
    repeat_m = texture_repeat_m(folder)
    chamfers = float(floor.vertices[:, 2].max()), record.height_m - roof_foot_m(folder)
    if not (0.01 < repeat_m < 1000 and min(chamfers) > 1e-3 and sum(chamfers) < record.height_m):
        raise ArtifactError(
            f"{folder / mesh_file(smooth_mesh(ROOF))}: chamfers of {chamfers} m, a texture of {repeat_m} m; "
            f"want chamfers above 0 that fit under {record.height_m} m"
        )
    rounded = [round(value, 4) for value in (*chamfers, repeat_m)]
    made = smooth_surface(free, record.height_m, *rounded)
    for piece in (name for name in made if name != FLOOR):
        path = folder / mesh_file(smooth_mesh(piece))
        found: Mesh = decode(path, Mesh)
        differs = "a normal, want none" if found.normals is not None else surfaces_differ(found, made[piece])
        # The walls have the outline's own points in its order; roof and chamfer are textured from above.
        above = found.vertices[:, :2] / rounded[2]
        wanted = (
            made[piece].texcoords if piece == WALLS and len(found.texcoords) == len(made[piece].texcoords) else above
        )
        if differs is None and not np.allclose(found.texcoords, wanted, rtol=1e-4, atol=2e-3):
            differs = "texture coordinates that differ"
        if differs:
            raise ArtifactError(
                f"{path}: {differs}; compared with the smooth surface of the outline with chamfers of {rounded[0]:g} m "
                f"and {rounded[1]:g} m and a texture of {rounded[2]:g} m"
            )
