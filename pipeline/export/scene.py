"""What a file of another format holds of a world: convex parts, visible surfaces, lights, and the facts of the record.

All places are in the mine frame, m.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from minexplore.bundle import TriangleMesh
from pipeline.errors import GeometryError
from pipeline.types import Points3

Files = dict[str, bytes]  # by name, relative to the export's folder
UNITS = {"length": "m", "angle": "rad", "mass": "kg", "time": "s"}


@dataclass(frozen=True)
class ConvexPart:
    """A convex collision part: `corners_m` (n, 3) about `centre_m` (3,); a level box has the eight corners of one.

    `friction` is the sliding friction; a format that carries none reads None.
    """

    name: str
    label: str
    zone: str
    friction: float | None
    centre_m: np.ndarray
    corners_m: Points3
    is_box: bool

    @property
    def vertices_m(self) -> Points3:
        """Return the corners (n, 3) m in the mine frame."""
        return self.corners_m + self.centre_m

    @property
    def half_m(self) -> np.ndarray:
        """Return half the size (3,) m of the box around the corners."""
        return np.ptp(self.corners_m, axis=0) / 2


@dataclass(frozen=True)
class Surface:
    """A mesh that is seen and not touched."""

    name: str
    label: str
    zone: str
    material: str
    mesh: TriangleMesh

    @property
    def triangles_m(self) -> np.ndarray:
        """Return the triangles (n, 3, 3) m."""
        return np.asarray(self.mesh.vertices, np.float64)[self.mesh.faces]


@dataclass(frozen=True)
class Material:
    """Colour (red, green, blue, alpha), which multiplies the rock's texture if `textured`; all from 0 to 1."""

    name: str
    rgba: tuple[float, float, float, float]
    textured: bool
    shininess: float


@dataclass(frozen=True)
class Light:
    """A spot light: unit direction, and half the angle of its cone."""

    name: str
    place_m: np.ndarray
    direction: np.ndarray
    cutoff_deg: float
    rgb: tuple[float, float, float]


@dataclass(frozen=True)
class WorldFacts:
    """What `world.json` says of the whole world, its units, and the licence, which its exporter states."""

    name: str
    format: str
    world_sha256: str
    frames: dict[str, str]
    units: dict[str, str]
    T_world_mine: list[list[float]]
    height_m: float
    areas: dict[str, float]
    licence: str

    def to_json(self) -> dict[str, Any]:
        """Return the facts as plain values."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class ExportScene:
    """A world to be written; `texture` is a PNG, or None in a world without visible rock."""

    facts: WorldFacts
    parts: list[ConvexPart]
    surfaces: list[Surface]
    materials: dict[str, Material]
    lights: list[Light]
    texture: bytes | None


@dataclass(frozen=True)
class ReadScene:
    """A world as a format's own loader reads it; `lights` is None if the format has none."""

    facts: dict[str, Any]
    parts: list[ConvexPart]
    surfaces: list[Surface]
    lights: int | None


def box_corners(half_m: np.ndarray) -> Points3:
    """Return the corners (8, 3) m of a level box about its middle."""
    return half_m * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def placed_part(
    name: str, label: str, zone: str, friction: float | None, vertices_m: Points3, is_box: bool = False
) -> ConvexPart:
    """Return a part of vertices (n, 3) m of the mine frame."""
    centre = (vertices_m.min(axis=0) + vertices_m.max(axis=0)) / 2
    return ConvexPart(name, label, zone, friction, centre, vertices_m - centre, is_box)


def hull_of(part: ConvexPart) -> tuple[Points3, np.ndarray]:
    """Return the hull of a part's corners, about its centre: vertices (n, 3) m, and faces (m, 3) that face outwards.

    Raises
    ------
    GeometryError
        If the corners lie in one plane.
    """
    try:
        hull = ConvexHull(part.corners_m)
    except QhullError as error:
        raise GeometryError(f"{part.name}: no convex body of {len(part.corners_m)} corners") from error
    kept = np.sort(hull.vertices)
    a, b, c = (hull.points[hull.simplices[:, k]] for k in range(3))
    inwards = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    return part.corners_m[kept], np.searchsorted(kept, faces)


def hull_triangles(part: ConvexPart) -> np.ndarray:
    """Return the triangles (n, 3, 3) m of a part's hull in the mine frame; errors as `hull_of`."""
    vertices, faces = hull_of(part)
    return (vertices + part.centre_m)[faces]
