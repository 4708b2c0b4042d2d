"""Make the smooth surface of a bundle again from its outline and compare it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from shapely import Polygon

from minexplore.bundle import FLOOR_CHAMFER, ROOF, WALLS, mesh_file, smooth_mesh
from pipeline.errors import ArtifactError
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.mjcf.bundle import WorldRecord
from pipeline.store.codecs import decode
from pipeline.surface.mesh.smooth import FLOOR, smooth_surface
from pipeline.types import Mesh

_CORNER_M = 0.01  # far from the origin a vertex has millimetres
_APART_M = 0.1  # between the same corners: a diagonal across a bend may run either way
_AREA_SHARE = 2e-3
_SLIVER_M2 = 1e-4  # smaller faces have no reliable normal
_SAME_SIDE = 0.5  # cosine between normals of the two surfaces


def surfaces_differ(found: Mesh, wanted: Mesh) -> str | None:
    """Return how a surface differs from another in place, area or side, or None if it does not."""
    one, two = found.vertices[found.faces], wanted.vertices[wanted.faces]
    differs = triangles_differ(one, two)
    if differs is None and (len(one) != len(two) or _rim(found.faces) != _rim(wanted.faces)):
        return f"{len(one)} faces and a rim of {_rim(found.faces)} edges, want {len(two)} and {_rim(wanted.faces)}"
    return differs


def triangles_differ(one: np.ndarray, two: np.ndarray) -> str | None:
    """Return how triangles (n, 3, 3) m differ from others in place, area or side, or None if they do not."""
    areas = [float(np.linalg.norm(_crossed(t), axis=1).sum() / 2) for t in (one, two)]
    if abs(areas[0] - areas[1]) > _AREA_SHARE * areas[1]:
        return f"an area of {areas[0]:.3f} m2, want {areas[1]:.3f} m2"
    corners = one.reshape(-1, 3), two.reshape(-1, 3)
    off = max(float(cKDTree(a).query(b)[0].max()) for a, b in (corners, corners[::-1]))
    if not off <= _CORNER_M:
        return f"a corner {off:.4f} m from where it should be"
    found, back = NearestFacets.of(two).query(_samples(one)), NearestFacets.of(one).query(_samples(two))
    worst = max(float(found.distance_m.max()), float(back.distance_m.max()))
    if not worst <= _APART_M:
        return f"{worst:.4f} m from where it should be"
    facing = np.einsum("ij,ij->i", _unit(_crossed(one)), _unit(_crossed(two))[found.facet[: len(one)]])
    size = np.linalg.norm(_crossed(one), axis=1) / 2
    if ((facing < _SAME_SIDE) & (size > _SLIVER_M2)).any():
        return "a face that faces the wrong way"
    return None


def _rim(faces: np.ndarray) -> int:
    """Return the number of edges that have a face on one side only, or -1 if an edge has two faces on one side."""
    ahead = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    code, back = (ahead[:, i] * (faces.max() + 1) + ahead[:, 1 - i] for i in (0, 1))
    return -1 if len(np.unique(code)) < len(code) else int((~np.isin(code, back)).sum())


def _samples(triangles: np.ndarray) -> np.ndarray:
    """Return centres, corners and middles of sides, the centres first."""
    sides = (triangles + np.roll(triangles, -1, axis=1)) / 2
    return np.concatenate([triangles.mean(axis=1), triangles.reshape(-1, 3), sides.reshape(-1, 3)])


def _crossed(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30)


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
