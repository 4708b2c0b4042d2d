"""Make the smooth surface of a bundle again from its outline and compare it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shapely import Polygon

from minexplore.bundle import FLOOR_CHAMFER, ROOF, WALLS, mesh_file, smooth_mesh
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import WorldRecord
from pipeline.proof.rebuilt.same_surface import surfaces_differ
from pipeline.store.codecs import decode
from pipeline.surface.mesh.smooth import FLOOR, smooth_surface
from pipeline.types import Mesh


@dataclass(frozen=True)
class SmoothSizes:
    """What makes the smooth surface of an outline, m: its chamfers, and the length of one repeat of its texture."""

    floor_chamfer_m: float
    roof_chamfer_m: float
    repeat_m: float


def smooth_sizes(folder: Path, record: WorldRecord) -> SmoothSizes:
    """Read the sizes of the smooth surface off its meshes, to a tenth of a millimetre."""
    repeat_m = texture_repeat_m(folder)
    chamfer, roof = (_above_floor(folder, piece) for piece in (FLOOR_CHAMFER, ROOF))
    return SmoothSizes(
        round(float(chamfer.max()), 4), round(record.height_m - float(roof.min()), 4), round(repeat_m, 4)
    )


def _above_floor(folder: Path, piece: str) -> np.ndarray:
    """Return the heights (n,) m of a piece above the floor."""
    mesh: Mesh = decode(folder / mesh_file(smooth_mesh(piece)), Mesh)
    return mesh.vertices[:, 2]


def texture_repeat_m(folder: Path) -> float:
    """Return the length that one repeat of the texture covers, m, by the smooth floor chamfer; 0 if it has none."""
    floor: Mesh = decode(folder / mesh_file(smooth_mesh(FLOOR_CHAMFER)), Mesh)
    widest = int(np.abs(floor.texcoords).max(axis=1).argmax())
    axis = int(np.abs(floor.texcoords[widest]).argmax())
    repeats = float(floor.texcoords[widest, axis])
    return round(float(floor.vertices[widest, axis]) / repeats, 4) if repeats else 0.0


@dataclass(frozen=True)
class RemadeSmooth:
    """The smooth surface of an outline, made again: its sizes, and its triangles (n, 3, 3) m without the floor."""

    sizes: SmoothSizes
    triangles: np.ndarray


def require_smooth(folder: Path, record: WorldRecord, free: Polygon) -> RemadeSmooth:
    """Compare the smooth surface with the one of the outline, and return this.

    Its two chamfers and its texture's size are read off.

    Raises
    ------
    ArtifactError
        With the file and how it differs.
    """
    sizes = smooth_sizes(folder, record)
    chamfers, repeat_m = (sizes.floor_chamfer_m, sizes.roof_chamfer_m), sizes.repeat_m
    if not (0.01 < repeat_m < 1000 and min(chamfers) > 1e-3 and sum(chamfers) < record.height_m):
        raise ArtifactError(
            f"{folder / mesh_file(smooth_mesh(ROOF))}: chamfers of {chamfers} m, a texture of {repeat_m} m; "
            f"want chamfers above 0 that fit under {record.height_m} m"
        )
    made = smooth_surface(free, record.height_m, *chamfers, repeat_m)
    for piece in (name for name in made if name != FLOOR):
        path = folder / mesh_file(smooth_mesh(piece))
        found: Mesh = decode(path, Mesh)
        if found.normals is not None:
            differs: str | None = "a normal, want none"
        else:
            differs = surfaces_differ(found, made[piece])
        # The walls have the outline's own points in its order; roof and chamfer are textured from above.
        above = found.vertices[:, :2] / repeat_m
        wanted = (
            made[piece].texcoords if piece == WALLS and len(found.texcoords) == len(made[piece].texcoords) else above
        )
        if differs is None and not np.allclose(found.texcoords, wanted, rtol=1e-4, atol=2e-3):
            differs = "texture coordinates that differ"
        if differs:
            raise ArtifactError(
                f"{path}: {differs}; compared with the smooth surface of the outline, chamfers of {chamfers[0]:g} m "
                f"and {chamfers[1]:g} m and a texture of {repeat_m:g} m"
            )
    return RemadeSmooth(
        sizes, np.concatenate([mesh.vertices[mesh.faces] for name, mesh in made.items() if name != FLOOR])
    )
