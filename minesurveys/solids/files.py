"""Triangles of a file: its layers, unit and upright axis, whatever its format is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

from minesurveys.errors import InputError
from minesurveys.formats import format_of
from minesurveys.frames import Unit
from minesurveys.solids.stated_metres import StatedMeshes, in_named_unit


@dataclass(frozen=True)
class Triangles:
    """The triangles of a file: `vertices` (n, 3) in its unit, `faces` (m, 3), and the layer (m,) of each.

    `unit` is None where the file states none; `up` is the axis that points up by the format's rule. `steps` (3,) are
    those in which the format's numbers of 32 bits come, along each axis, and zero of other formats.
    """

    vertices: np.ndarray
    faces: np.ndarray
    layer: np.ndarray
    layers: tuple[str, ...]
    unit: Unit | None
    up: str
    steps: np.ndarray


def read_triangles(path: Path, data: bytes, layers: list[str] | None = None) -> Triangles:
    """Read the triangles of a file's layers; None reads all.

    Raises
    ------
    InputError
        If the file is no mesh of its format, has no triangle, a coordinate is not finite, or a layer is unknown.
    """
    reader = format_of(path).meshes
    if not reader:
        raise InputError(f"{path}: not a format with triangles")
    stated: StatedMeshes = in_named_unit(path, resolve_name(reader)(path, data))
    found = stated.meshes
    names = tuple(dict.fromkeys(mesh.layer for mesh in found))
    unknown = sorted(set(layers or []) - set(names))
    if unknown:
        raise InputError(f"{path}: no layer {', '.join(unknown)}; there are {', '.join(names) or 'none'}")
    chosen = [mesh for mesh in found if layers is None or mesh.layer in layers]
    if not sum(len(mesh.faces) for mesh in chosen):
        raise InputError(f"{path}: has no triangles; a mesh of the workings is wanted")
    if any(mesh.faces.min(initial=0) < 0 or mesh.faces.max(initial=-1) >= len(mesh.vertices) for mesh in chosen):
        raise InputError(f"{path}: a triangle of a corner that the file does not have")
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in chosen)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(chosen, first[:-1], strict=True)])
    # A corner of no triangle, such as a mark at 0 0 0, is no part of the workings.
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int64)
    vertices = np.concatenate([mesh.vertices for mesh in chosen])[used]
    if not np.isfinite(vertices).all():
        raise InputError(f"{path}: a coordinate that is no finite number")
    layer = np.repeat([names.index(mesh.layer) for mesh in chosen], [len(mesh.faces) for mesh in chosen])
    steps = np.max([mesh.steps for mesh in chosen], axis=0)
    return Triangles(vertices, faces, layer, names, stated.unit, stated.up, steps)
