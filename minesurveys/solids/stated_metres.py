"""Meshes of files that state how many metres their unit has: a unit that has a name, or coordinates in metres."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from minesurveys.coordinates.map_axes import metres_of_unit
from minesurveys.errors import InputError
from minesurveys.frames import METRES, Unit
from minesurveys.remarks import warn_user

_HEAD, _STL_HEAD = 10_000, 80  # bytes in which comments state a unit
_COMMENTS = re.compile(rb"^(?:#|comment\b|obj_info\b).*$", re.MULTILINE)
_UNITS = re.compile(rb"\bunits?\s*[=:]\s*[\"']?([a-z]+)", re.IGNORECASE)
_SAME = 1e-9  # relative; the US survey foot differs from the foot by 2e-6
_NAMES: tuple[Unit, ...] = ("m", "cm", "mm", "ft", "in")


class LayerMesh(NamedTuple):
    """Vertices (n, 3) and triangles (m, 3) of a layer, and the steps (3,) in which numbers of 32 bits come, else 0."""

    layer: str
    vertices: np.ndarray
    faces: np.ndarray
    steps: np.ndarray = np.zeros(3)


@dataclass(frozen=True)
class StatedMeshes:
    """Meshes, metres a unit, None if the file states none, and the axis that points up."""

    meshes: list[LayerMesh]
    metres: float | None
    up: str = "z"

    @property
    def unit(self) -> Unit | None:
        """The name of the unit; None if the file states none."""
        return None if self.metres is None else name_of(self.metres)


def name_of(metres: float) -> Unit | None:
    """Return the unit of so many metres; None if it is another than m, cm, mm, ft and in."""
    return next((unit for unit in _NAMES if math.isclose(METRES[unit], metres, rel_tol=_SAME)), None)


def metres_in_comments(path: Path, data: bytes, suffix: str) -> float | None:
    """Return metres a unit that a comment of an OBJ, PLY or STL file states, with a remark; None if there is none.

    The formats have none. Programs write `# File units = inches`, `comment unit: mm`, or `UNITS=mm` in STL's header.
    """
    lines = data[:_STL_HEAD] if suffix == ".stl" else b"\n".join(_COMMENTS.findall(data[:_HEAD]))
    stated = _UNITS.search(lines)
    metres = None if stated is None else metres_of_unit(stated[1].decode("latin-1"))
    unit = None if metres is None else name_of(metres)
    if unit is None:
        return None
    warn_user(
        f"a comment states the unit {unit}, which is used",
        of=path.name,
        option="--unit",
        advice="--unit states another",
    )
    return METRES[unit]


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
    warn_user(f"states a unit of {metres:.10g} m; its coordinates are read in metres", of=path.name)
    return replace(found, meshes=[m._replace(vertices=m.vertices * metres) for m in found.meshes], metres=1.0)
