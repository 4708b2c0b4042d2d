"""The rough surface in space: folded by the floor, its sheets joined on their seams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.floors.folding import Folding
from pipeline.errors import GeometryError
from pipeline.surface.mesh.mesh_checks import MeshReport, check_mesh, find_crossings
from pipeline.surface.mesh.normals import ShadedMesh, shade_mesh
from pipeline.surface.mesh.rough import RoughSurface

_DIGITS = 4  # 0.1 mm, as in the plan


@dataclass(frozen=True)
class FoldedSurface:
    """The vertices (n, 3) m of a rough surface's mesh in the mine frame, and the number (n,) of the place of each.

    Vertices of two sheets that lie at one place have one number.
    """

    vertices: np.ndarray
    number: np.ndarray


def fold_surface(rough: RoughSurface) -> FoldedSurface:
    """Fold the mesh of a rough surface by its floor; of a flat one nothing changes."""
    mesh, lattice = rough.mesh, rough.lattice
    if lattice.floor.is_flat:
        return FoldedSurface(mesh.vertices, np.arange(len(mesh.vertices)))
    folded = Folding(lattice.floor).fold(mesh.vertices).round(_DIGITS) + 0.0
    number = np.arange(len(folded))
    if lattice.seam_join:
        place = np.full(len(lattice.vertices), -1)
        place[lattice.seam_join.points] = lattice.seam_join.place
        own = place[mesh.source]
        own[(mesh.vertices != rough.vertices[mesh.source]).any(axis=1)] = -1
        on_seam = np.flatnonzero(own >= 0)
        _, first, at = np.unique(own[on_seam], return_index=True, return_inverse=True)
        number[on_seam] = on_seam[first][at]
        folded = folded[number]
    return FoldedSurface(folded, number)


def shade_folded(rough: RoughSurface, folded: FoldedSurface, crease_deg: float) -> ShadedMesh:
    """Return normals of the folded surface, which sheets share on their seams, for the vertices of the mesh."""
    faces = rough.mesh.faces
    shaded = shade_mesh(folded.vertices, folded.number[faces], crease_deg)
    if rough.lattice.seam_join is None:
        return shaded
    count = len(folded.vertices)
    key, corner = np.unique(shaded.faces.astype(np.int64) * count + faces, return_inverse=True)
    return ShadedMesh(key % count, shaded.normals[key // count], corner.reshape(-1, 3).astype(np.int32))


def check_folded(rough: RoughSurface, folded: FoldedSurface, faces: np.ndarray) -> MeshReport:
    """Check that the folded surface encloses one volume and faces inwards, as `check_mesh` does.

    `faces` (m, 3) are those of the mesh closed by a floor. On a floor with heights these are long faces between the
    feet of the walls, so that only the rock's crossings count. On a flat floor, `displace_lattice` has tried all edges
    of the rock against the rock; what may still cross is the floor and the rock that reaches down to it.

    Raises
    ------
    GeometryError
        If it has a crack or a flipped face, intersects itself, or is in several pieces.
    """
    if rough.lattice.floor.is_flat:
        return check_mesh(folded.vertices, faces, faces[folded.vertices[faces, 2].min(axis=1) <= 0])
    import trimesh  # takes half a second to load, and light worlds do without

    mesh = trimesh.Trimesh(folded.vertices, folded.number[faces], process=False)
    crossings = find_crossings(folded.vertices, folded.number[rough.mesh.faces])
    report = MeshReport(
        faces=len(faces),
        vertices=len(np.unique(folded.number[faces])),
        volume_m3=round(-float(mesh.volume), 3),
        area_m2=round(float(mesh.area), 3),
        watertight=bool(mesh.is_watertight),
        winding_consistent=bool(mesh.is_winding_consistent),
        self_intersecting=len(crossings) > 0,
    )
    if not (report.watertight and report.winding_consistent and report.volume_m3 > 0) or report.self_intersecting:
        raise GeometryError(f"surface: the folded mesh is not closed, flipped, or intersects itself: {report}")
    return report
