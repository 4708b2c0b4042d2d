"""Meshes of files that state how many metres their unit has: a unit that has a name, or coordinates in metres."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.reading_process import warn_user
from pipeline.params.survey import Unit
from pipeline.survey.vector.shapes import METRES

Mesh = tuple[str, np.ndarray, np.ndarray]
_SAME = 1e-9  # relative; the US survey foot differs from the foot by 2e-6
_NAMES: tuple[Unit, ...] = ("m", "cm", "mm", "ft", "in")


@dataclass(frozen=True)
class StatedMeshes:
    """Meshes as (layer, vertices (n, 3), triangles (m, 3)), metres a unit, and the axis that points up.

    `unit` is None if the file states none; `metres` is then 1.
    """

    meshes: list[Mesh]
    metres: float | None
    up: str = "z"

    @property
    def unit(self) -> Unit | None:
        """The name of the unit; None if the file states none."""
        return None if self.metres is None else name_of(self.metres)


def name_of(metres: float) -> Unit | None:
    """Return the unit of so many metres; None if it is another than m, cm, mm, ft and in."""
    return next((unit for unit in _NAMES if math.isclose(METRES[unit], metres, rel_tol=_SAME)), None)


def in_named_unit(path: Path, found: StatedMeshes) -> StatedMeshes:
    """Return meshes in a unit that has a name: as they are, or in metres with a remark.

    Raises
    ------
    InputError
        If the file states a unit of no positive number of metres.
    """
    metres = found.metres
    if metres is None or name_of(metres):
        return found
    if not (math.isfinite(metres) and metres > 0):
        raise InputError(f"{path}: its unit is {metres:g} m long; want a positive number of metres")
    warn_user(f"{path.name}: states a unit of {metres:.10g} m; its coordinates are read in metres")
    return replace(found, meshes=[(name, v * metres, faces) for name, v, faces in found.meshes], metres=1.0)


def triangles_of(corners: np.ndarray, sizes: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the triangles (m, 3) of polygons; those of more corners need not be convex, and are cut by ears.

    Parameters
    ----------
    corners : (k,) int64
        Vertices of all polygons, one polygon after the other.
    sizes : (p,) int64
        How many corners each polygon has; those of fewer than three are left out.
    vertices : (n, 3) float64
    """
    starts = np.cumsum([0, *sizes[:-1]]) if len(sizes) else np.zeros(0, np.int64)
    found = [corners[starts[sizes == 3, None] + np.arange(3)].reshape(-1, 3)]
    for start, size in zip(starts[sizes > 3].tolist(), sizes[sizes > 3].tolist(), strict=True):
        found.append(_cut(corners[start : start + size], vertices))
    return np.concatenate(found)


def _cut(ring: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the triangles (m, 3) of one polygon, looked at along the axis that it faces most."""
    from ezdxf.math import Vec2
    from ezdxf.math.triangulation import mapbox_earcut_2d

    points = vertices[ring]
    facing = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    across = int(np.abs(facing).argmax())
    plane = np.roll(np.delete(points, across, axis=1), across == 1, axis=1)  # right-handed about the axis
    row = {(x, y): vertex for (x, y), vertex in zip(plane.tolist(), ring.tolist(), strict=True)}
    cut = [[row[point.x, point.y] for point in triangle] for triangle in mapbox_earcut_2d(Vec2.list(plane.tolist()))]
    triangles = np.array(cut, np.int64).reshape(-1, 3)
    return triangles if facing[across] > 0 else triangles[:, ::-1]
