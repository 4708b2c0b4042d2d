"""The arch of a drawn area's roof, which its visible rock has: collision keeps the plane of the drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.geometry.facets.cut import cut_facets
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.geometry.ray_scene import ray_scene

_APART_M = 0.3  # between the points of an arch: its planes are within 5 mm of the curve
_MOST = 1 / 3  # of the height under a roof, that its arch may take at the walls
_LIFT_M = 1e-3  # from a roof, where rays begin
_DEEPEST_M = 5.0  # under a roof as drawn, where it is seen; a floor's height is between it and the roof under it
_PLUMB_M = 0.01  # from a roof's edge in plan to the corner of the wall under it: a shaft's wall goes up from its edge


@dataclass(frozen=True)
class Arch:
    """How far a roof is lower at its walls, m, and how far from them, m, it is as high as it was drawn."""

    rise_m: float
    half_span_m: float


def arched(volume: VolumeFacets, arch: Arch) -> VolumeFacets:
    """Return the volume of drawn areas with roofs that are lower near the walls under them, as in a level mine.

    The drop at a distance d from the walls is `rise_m` (1 - t)^2, with t = d / `half_span_m` up to 1. It is at most a
    third of the height under the roofs. Roofs are planes between points about `_APART_M` apart, so that the ridge
    between two near walls is blunt. Corners of roofs drop first, so that walls stay plumb facets; then the points of
    roofs that touch no wall get the drop of their own place. They move up or down alone, so that no roof folds, and the
    mesh stays closed. Its first points are the volume's own.
    """
    vertices, faces = volume.vertices, volume.faces
    roof, wall = volume.label == FacetLabel.ROOF, volume.label == FacetLabel.WALL
    springs = _springs(vertices, faces[roof], faces[wall])
    if not len(springs):
        return volume
    height_m = _height_m(vertices, faces, roof)
    drops = _Drops(vertices[springs], Arch(min(arch.rise_m, _MOST * height_m), arch.half_span_m), height_m)
    lowered, top = vertices.copy(), np.unique(faces[roof])
    lowered[top, 2] -= drops.of_roofs(vertices[top])
    between = np.setdiff1d(faces[wall], faces[~wall])
    lowered[between, 2] -= drops.of_walls(vertices[between])
    points, triangles, facet = cut_facets(lowered, faces, np.where(roof, _APART_M, np.inf))
    points, (inner, drawn) = points.copy(), _on_roofs(points, vertices, faces, (triangles, facet), roof)
    points[inner, 2] = drawn[:, 2] - drops.of_roofs(drawn)
    return VolumeFacets(points, triangles.astype(np.int32), volume.label[facet], volume.leg[facet])


def cut_as_seen(
    mesh: tuple[np.ndarray, np.ndarray], roof: np.ndarray, apart_m: np.ndarray, volume: VolumeFacets, seen: VolumeFacets
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut the facets of a volume as `cut_facets` does, but where they are seen under its arch.

    Corners of facets drop before walls and roofs are cut, so that walls have as many rows as are in their height under
    the arch, and no needles. Points of roofs that touch no wall then lie on the roofs that are seen.

    Parameters
    ----------
    mesh : (n, 3) float64 m, (m, 3) int
        Vertices and faces, closed, with corners of the volume's.
    roof : (m,) bool
        Which facets are roofs.
    apart_m : (m,) float64, m
    volume, seen : VolumeFacets
        The volume, and what `arched` makes of it.
    """
    vertices, faces = mesh
    own = cKDTree(volume.vertices).query(vertices)[1]
    lowered = vertices + (seen.vertices[own] - volume.vertices[own])
    points, triangles, facet = cut_facets(lowered, faces, apart_m)
    points, (inner, drawn) = points.copy(), _on_roofs(points, vertices, faces, (triangles, facet), roof)
    roofs = seen.faces[seen.label == FacetLabel.ROOF]
    origin = seen.vertices.mean(axis=0)  # rays are cast in 32 bits
    down = np.broadcast_to([0.0, 0.0, -1.0], drawn.shape)
    rays = np.concatenate([drawn - origin + [0, 0, _LIFT_M], down], axis=1).astype(np.float32)
    found = ray_scene(seen.vertices - origin, roofs, 1).cast_rays(rays, nthreads=1)
    hit = found["t_hit"].numpy() < _DEEPEST_M
    under = roofs[found["primitive_ids"].numpy()[hit].astype(np.int64)]
    points[inner[hit], 2] = _heights(seen.vertices, under, drawn[hit, :2])
    return points, triangles, facet


def _on_roofs(
    points: np.ndarray,
    vertices: np.ndarray,
    faces: np.ndarray,
    cut: tuple[np.ndarray, np.ndarray],
    roof: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (k,) of points of roofs that touch no wall, and where (k, 3) m they are on facets as drawn."""
    triangles, facet = cut
    of_roof = roof[facet]
    inner = np.setdiff1d(triangles[of_roof], triangles[~of_roof])
    own = np.zeros(len(points), np.int64)
    own[triangles[of_roof]] = facet[of_roof, None]
    drawn = points[inner]
    drawn[:, 2] = _heights(vertices, faces[own[inner]], drawn[:, :2])
    return inner, drawn


class _Drops:
    """How much lower places are seen than they are drawn: by their distance from springs, the roofs' edges at walls."""

    def __init__(self, springs_m: np.ndarray, arch: Arch, height_m: float) -> None:
        """Take the ends of the springs (e, 2, 3) m, and the height of roofs over floors, m."""
        number = 2 * np.arange(len(springs_m))
        lines = np.column_stack([number, number + 1, number + 1])
        self._springs, self._arch, self._height_m = NearestFacets(springs_m.reshape(-1, 3), lines, 1), arch, height_m

    def of_roofs(self, places: np.ndarray) -> np.ndarray:
        """Return the drops (n,) m of places (n, 3) m on roofs."""
        return self._at(self._springs.query(places).distance_m) if len(places) else np.zeros(0)

    def of_walls(self, places: np.ndarray) -> np.ndarray:
        """Return the drops (n,) m of places (n, 3) m on walls: under a spring by their share of the height."""
        if not len(places):
            return np.zeros(0)
        over = self._springs.query(places).place_m - places
        across, under_m = np.hypot(*over[:, :2].T), np.maximum(over[:, 2], 0.0)
        away_m = np.hypot(across, np.minimum(over[:, 2], 0.0))
        return self._at(away_m) * np.maximum(1 - under_m / self._height_m, 0.0)

    def _at(self, away_m: np.ndarray) -> np.ndarray:
        found: np.ndarray = self._arch.rise_m * (1 - np.minimum(away_m / self._arch.half_span_m, 1.0)) ** 2
        return found


def _springs(vertices: np.ndarray, roof: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """Return the edges (e, 2) between facets of roofs (r, 3) and plumb ones of walls (w, 3) under them."""
    sides = [(wall[:, k], wall[:, (k + 1) % 3], wall[:, (k + 2) % 3]) for k in range(3)]
    a, b, c = (np.concatenate(ends).astype(np.int64) for ends in zip(*sides, strict=True))
    high, low = vertices[[a, b]], vertices[c]
    way = high[1, :, :2] - high[0, :, :2]
    aside = np.abs(way[:, 0] * (low[:, 1] - high[0, :, 1]) - way[:, 1] * (low[:, 0] - high[0, :, 0]))
    plumb = aside <= _PLUMB_M * np.hypot(*way.T)
    under = (low[:, 2] < high[:, :, 2].min(axis=0)) & plumb
    keys = (np.minimum(a, b) * len(vertices) + np.maximum(a, b))[under]
    one, other = roof.astype(np.int64), np.roll(roof, -1, axis=1).astype(np.int64)
    edges = (np.minimum(one, other) * len(vertices) + np.maximum(one, other)).ravel()
    return np.column_stack(np.divmod(np.intersect1d(keys, edges), len(vertices)))


def _height_m(vertices: np.ndarray, faces: np.ndarray, roof: np.ndarray) -> float:
    """Return the median height, m, under the middles of roofs: an area's roof is as high everywhere."""
    middles, origin = vertices[faces[roof]].mean(axis=1), vertices.mean(axis=0)
    down = np.broadcast_to([0.0, 0.0, -1.0], middles.shape)
    rays = np.concatenate([middles - origin - [0, 0, _LIFT_M], down], axis=1).astype(np.float32)
    hit = ray_scene(vertices - origin, faces, 1).cast_rays(rays, nthreads=1)["t_hit"].numpy()
    return round(float(np.median(hit)) + _LIFT_M, 2)  # rays have 32 bits


def _heights(vertices: np.ndarray, facets: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Return the heights (n,) m of the planes of facets (n, 3) over places (n, 2) m."""
    normal, corner = _normals(vertices, facets), vertices[facets[:, 0]]
    aside = ((xy - corner[:, :2]) * normal[:, :2]).sum(axis=1)
    found: np.ndarray = corner[:, 2] - aside / normal[:, 2]
    return found


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)
