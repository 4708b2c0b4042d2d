"""The arch of a drawn area's roof, which its visible rock has: collision keeps the plane of the drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.geometry.facets.cut import cut_facets
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.geometry.ray_scene import ray_scene

_APART_M = 0.3  # between the points of an arch: with 0.5 the default as a volume is too smooth at 50 cm (0.796 of 0.8)
_MOST = 1 / 3  # of the height under a roof, that its arch may take at the walls
_LIFT_M = 1e-3  # from a roof, where rays begin
_PLUMB_M = 0.01  # from a roof's edge in plan to the corner of the wall under it: a shaft's wall goes up from its edge


@dataclass(frozen=True)
class Arch:
    """How far a roof is lower at its walls, m, and how far from them, m, it is as high as it was drawn."""

    rise_m: float
    half_span_m: float


def arched(volume: VolumeFacets, arch: Arch) -> VolumeFacets:
    """Return the volume of drawn areas with roofs that are lower near the walls under them, as in a level mine.

    The drop at a distance d from the walls is `rise_m` (1 - t)^2, with t = d / `half_span_m` up to 1. It is at most a
    third of the height under the roofs. Roofs are cut for it; floors and walls stay, but for the upper edge of walls.
    """
    roof, springs = volume.label == FacetLabel.ROOF, _springs(volume)
    if not len(springs):
        return volume
    vertices, faces, facet = cut_facets(volume.vertices, volume.faces, np.where(roof, _APART_M, np.inf))
    top = np.unique(faces[roof[facet]])
    number = 2 * np.arange(len(springs))
    lines = np.column_stack([number, number + 1, number + 1])
    away_m = NearestFacets(volume.vertices[springs].reshape(-1, 3), lines, 1).query(vertices[top]).distance_m
    t = np.minimum(away_m / arch.half_span_m, 1.0)
    vertices = vertices.copy()
    vertices[top, 2] -= min(arch.rise_m, _MOST * _height_m(volume, roof)) * (1 - t) ** 2
    return VolumeFacets(vertices, faces.astype(np.int32), volume.label[facet], volume.leg[facet])


def _springs(volume: VolumeFacets) -> np.ndarray:
    """Return the edges (e, 2) between a roof and a plumb wall under it."""
    roof, wall = (volume.faces[volume.label == label] for label in (FacetLabel.ROOF, FacetLabel.WALL))
    sides = [(wall[:, k], wall[:, (k + 1) % 3], wall[:, (k + 2) % 3]) for k in range(3)]
    a, b, c = (np.concatenate(ends).astype(np.int64) for ends in zip(*sides, strict=True))
    high, low = volume.vertices[[a, b]], volume.vertices[c]
    way = high[1, :, :2] - high[0, :, :2]
    aside = np.abs(way[:, 0] * (low[:, 1] - high[0, :, 1]) - way[:, 1] * (low[:, 0] - high[0, :, 0]))
    plumb = aside <= _PLUMB_M * np.hypot(*way.T)
    under = (low[:, 2] < high[:, :, 2].min(axis=0)) & plumb
    keys = (np.minimum(a, b) * len(volume.vertices) + np.maximum(a, b))[under]
    one, other = roof.astype(np.int64), np.roll(roof, -1, axis=1).astype(np.int64)
    edges = (np.minimum(one, other) * len(volume.vertices) + np.maximum(one, other)).ravel()
    return np.column_stack(np.divmod(np.intersect1d(keys, edges), len(volume.vertices)))


def _height_m(volume: VolumeFacets, roof: np.ndarray) -> float:
    """Return the median height, m, under the middles of roofs: an area's roof is as high everywhere."""
    middles = volume.vertices[volume.faces[roof]].mean(axis=1)
    origin = volume.vertices.mean(axis=0)
    down = np.broadcast_to([0.0, 0.0, -1.0], middles.shape)
    rays = np.concatenate([middles - origin - [0, 0, _LIFT_M], down], axis=1).astype(np.float32)
    hit = ray_scene(volume.vertices - origin, volume.faces, 1).cast_rays(rays, nthreads=1)["t_hit"].numpy()
    return round(float(np.median(hit)) + _LIFT_M, 2)  # rays have 32 bits
