"""Labels, pieces and areas of a compiled bundle and of a file that was read back."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup, is_shade, puddle_geom
from pipeline.errors import ArtifactError
from pipeline.export.labels import PieceLabel, part_label, seen_label, surface_label, water_label
from pipeline.export.scene import ExportScene, ReadScene, hull_triangles

PART_GROUPS = (GeomGroup.COLLISION, GeomGroup.FLOOR, GeomGroup.ROOF)
_SAME_AREA = 1e-5  # share: MuJoCo's meshes have 32 bits and are turned
_LEAST_AREA_M2 = 1e-3


@dataclass(frozen=True)
class LabelMatch:
    """Pieces of one label and their area, m2: in the world, and in the file."""

    pieces: int
    area_m2: float
    file_pieces: int
    file_area_m2: float

    @property
    def holds(self) -> bool:
        """Return whether both are alike."""
        near = max(_SAME_AREA * self.area_m2, _LEAST_AREA_M2)
        return self.pieces == self.file_pieces and abs(self.area_m2 - self.file_area_m2) <= near


@dataclass(frozen=True)
class Piece:
    """A piece of a world; `label` is "touched" or "seen", what it is, and the zone of a floor, joined by slashes."""

    label: str
    area_m2: float


def match_labels(world_pieces: Iterable[Piece], read: ReadScene) -> dict[str, LabelMatch]:
    """Compare the pieces of a world with those of a file, label by label."""
    world, file = _sum(world_pieces), _sum(pieces_of_scene(read))
    none = (0, 0.0)
    return {
        label: LabelMatch(*world.get(label, none), *file.get(label, none))
        for label in sorted(world.keys() | file.keys())
    }


def _sum(pieces: Iterable[Piece]) -> dict[str, tuple[int, float]]:
    areas: dict[str, list[float]] = defaultdict(list)
    for piece in pieces:
        areas[piece.label].append(piece.area_m2)
    return {label: (len(of), round(sum(of), 4)) for label, of in areas.items()}


def pieces_of_scene(read: ReadScene | ExportScene) -> Iterable[Piece]:
    """Return the pieces of a scene: its parts and its surfaces."""
    for part in read.parts:
        yield Piece(_key("touched", PieceLabel(part.label, part.zone)), triangle_area_m2(hull_triangles(part)))
    for surface in read.surfaces:
        yield Piece(_key("seen", PieceLabel(surface.label, surface.zone)), triangle_area_m2(surface.triangles_m))


def seen_parts(pieces: Iterable[Piece]) -> Iterable[Piece]:
    """Return what is seen of touched pieces in a world without visible rock: one piece a label and zone."""
    areas: dict[str, float] = defaultdict(float)
    for piece in pieces:
        label, _, zone = piece.label.removeprefix("touched/").partition("/")
        areas[_key("seen", PieceLabel(seen_label(label), zone))] += piece.area_m2
    return itertools.starmap(Piece, areas.items())


def pieces_of_model(model: mujoco.MjModel, zones: list[str]) -> Iterable[Piece]:
    """Return the pieces of a compiled model; `zones` are the names of the floor zones.

    Raises
    ------
    ArtifactError
        If a geom of the model has no label.
    """
    for geom in range(model.ngeom):
        name, group = model.geom(geom).name, int(model.geom_group[geom])
        if group in PART_GROUPS:
            yield Piece(_key("touched", part_label(name, group, zones)), _area_m2(model, geom))
        elif group == GeomGroup.ROUGH_SURFACE and not is_shade(name):
            yield Piece(_key("seen", _seen_label(model, geom, zones)), _area_m2(model, geom))


def _seen_label(model: mujoco.MjModel, geom: int, zones: list[str]) -> PieceLabel:
    name = model.geom(geom).name
    for zone in zones:
        if puddle_geom(zone) == name:
            return water_label(zone)
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        return surface_label(model.mesh(model.geom_dataid[geom]).name, zones)
    raise ArtifactError(f"geom {name}: has no label")


def _area_m2(model: mujoco.MjModel, geom: int) -> float:
    a, b, c = model.geom_size[geom]
    kind = model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return float(8 * (a * b + b * c + c * a))
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return float(4 * a * b)
    mesh = model.geom_dataid[geom]
    first, start = model.mesh_faceadr[mesh], model.mesh_vertadr[mesh]
    faces = model.mesh_face[first : first + model.mesh_facenum[mesh]]
    return triangle_area_m2(model.mesh_vert[start : start + model.mesh_vertnum[mesh]][faces].astype(np.float64))


def triangle_area_m2(triangles: np.ndarray) -> float:
    """Return the area, m2, of triangles (n, 3, 3) m."""
    a, b, c = (triangles[:, k] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _key(sense: str, label: PieceLabel) -> str:
    return "/".join(filter(None, (sense, label.what, label.zone)))
