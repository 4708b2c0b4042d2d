"""Which facets of the free space each collision part lies behind, by their planes alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume
from pipeline.volume.world.content import LabelledParts

_ON_PLANE_M = 1e-5  # corners of a part's face from the plane of a facet
_LEAST_M2 = 1e-6  # of a facet that must have a part behind its middle
_INSIDE = 1e-6  # of a part's face, beyond its edges


@dataclass(frozen=True)
class Fronts:
    """The parts as `pipeline.volume.enclosure` measures them, and the area, m2, of facets without a part behind them.

    A part that lies behind no facet is among them with no area.
    """

    parts: list[ShellPart]
    bare_m2: float


def fronts_of(volume: Volume, parts: LabelledParts) -> Fronts:
    """Find the face of each part that lies on the plane of a facet, with all of the part behind it.

    Of several planes the one with the largest face counts. A facet has a part behind it if its middle is on the face of
    one that lies behind its plane.
    """
    normal = volume.normals
    size = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(size, 1e-30)[:, None]
    triangles = volume.vertices[volume.faces]
    middle = triangles.mean(axis=1)
    near = _near_facets(triangles, parts)
    covered = np.zeros(len(unit), bool)
    found = []
    for number in range(len(parts)):
        corners, facets = parts[number], near[number]
        depth = np.einsum("fcx,fx->fc", corners[None] - middle[facets][:, None], unit[facets])
        on = np.abs(depth) < _ON_PLANE_M
        behind = (depth.min(axis=1) > -_ON_PLANE_M) & (on.sum(axis=1) > 2)
        best, front, deep = 0.0, 0, 0.0
        for k in np.flatnonzero(behind).tolist():
            across = _across(unit[facets[k]])
            face = shapely.convex_hull(shapely.multipoints((corners[on[k]] - middle[facets[k]]) @ across.T))
            covered[facets[k]] |= bool(face.distance(shapely.Point(0, 0)) < _INSIDE)
            if face.area > best:
                best, front, deep = float(face.area), int(facets[k]), float(depth[k].max())
        found.append(ShellPart(corners, [front], "built", deep, best, 0.0))
    bare = ~covered & (size / 2 > _LEAST_M2)
    return Fronts(found, float(size[bare].sum() / 2))


def _near_facets(triangles: np.ndarray, parts: LabelledParts) -> list[np.ndarray]:
    """Return for each part the facets whose boxes meet its own."""
    low, high = triangles.min(axis=1) - _ON_PLANE_M, triangles.max(axis=1) + _ON_PLANE_M
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    spans = np.array([(one.min(axis=0), one.max(axis=0)) for one in map(parts.__getitem__, range(len(parts)))])
    spans = spans.reshape(-1, 2, 3)
    part, facet = tree.query(shapely.box(spans[:, 0, 0], spans[:, 0, 1], spans[:, 1, 0], spans[:, 1, 1]))
    meets = (low[facet, 2] <= spans[part, 1, 2]) & (high[facet, 2] >= spans[part, 0, 2])
    part, facet = part[meets], facet[meets]
    order = np.lexsort((facet, part))
    return np.split(facet[order], np.searchsorted(part[order], np.arange(1, len(parts))))


def _across(normal: np.ndarray) -> np.ndarray:
    """Return two unit vectors (2, 3) across a unit normal."""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, aside)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])
