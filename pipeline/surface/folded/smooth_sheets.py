"""The smooth surface of a mine with heights: that of each sheet, open on its seams, and folded by the floor."""

from __future__ import annotations

from functools import partial

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.floors.floor import Floor
from minexplore.floors.folding import Folding
from pipeline.geometry.floor.seams import continue_sheets, seam_lines, seams_of_edges
from pipeline.geometry.floor.subdivide import split_edges
from pipeline.surface.mesh.smooth import smooth_surface
from pipeline.types import Mesh

_BEHIND_M = 3.0  # of the next sheet; chamfers are narrower
_LONGEST_M, _BENT_M = 1.0, 0.002  # of an edge that the fold may bend, and by how much it may bend a longer one


def smooth_sheets(
    free: BaseGeometry, floor: Floor, height_m: float, floor_chamfer_m: float, roof_chamfer_m: float, texture_m: float
) -> dict[str, Mesh]:
    """Return the smooth surface in the plan: see `smooth_surface`; with several sheets, all of them."""
    sizes = height_m, floor_chamfer_m, roof_chamfer_m, texture_m
    if len(floor.offset_m) == 1:
        return smooth_surface(free, *sizes)
    seams = seam_lines(floor)
    parts = shapely.get_parts(shapely.set_precision(free, 0.0))
    sheets = []
    for sheet, whole in enumerate(continue_sheets(free, floor, _BEHIND_M)):

        def on_seam(ring: np.ndarray, at: int = sheet) -> np.ndarray:
            return seams_of_edges(ring, at, seams) >= 0

        sheets.append(smooth_surface(parts[sheet], *sizes, whole, on_seam))
    return {piece: _joined([sheet[piece] for sheet in sheets]) for piece in sheets[0]}


def _joined(meshes: list[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(faces).astype(np.int32),
        np.concatenate([mesh.texcoords for mesh in meshes]),
    )


def fold_smooth(pieces: dict[str, Mesh], floor: Floor) -> dict[str, Mesh]:
    """Return the smooth surface in space; edges are halved until it follows the floor, and a flat one is unchanged."""
    if floor.is_flat:
        return pieces
    folding, folded = Folding(floor), {}
    for piece, mesh in pieces.items():
        laid = np.column_stack([mesh.vertices, mesh.texcoords])
        points, faces = split_edges(laid, mesh.faces, partial(_leaves_floor, folding))
        folded[piece] = Mesh(folding.fold(points[:, :3]), faces.astype(np.int32), points[:, 3:])
    return folded


def _leaves_floor(folding: Folding, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return whether the fold bends edges (k,) longer than `_LONGEST_M`, between places (k, 3) m of the plan."""
    length = np.linalg.norm(one[:, :3] - two[:, :3], axis=1)
    long = np.flatnonzero(length > _LONGEST_M)
    count = np.maximum(np.ceil(length[long] / _LONGEST_M).astype(int), 2)  # of pieces, with a place between each two
    edge = np.repeat(long, count - 1)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count - 1) - (count - 1), count - 1) + 1) / np.repeat(
        count, count - 1
    )
    ends = [folding.fold(end[:, :3]) for end in (one, two)]

    def between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
        return start[edge, :3] + share[:, None] * (end[edge, :3] - start[edge, :3])

    bent = np.linalg.norm(folding.fold(between(one, two)) - between(*ends), axis=1) > _BENT_M
    found = np.zeros(len(length), bool)
    found[edge[bent]] = True
    return found
