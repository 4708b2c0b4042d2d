"""The rock as convex parts: one behind every facet of the free space, none in the free space, none left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import manifold3d
import numpy as np

from pipeline.volume.rock.polygons import polygons_of, ways_into_rock
from pipeline.volume.rock.shapes import SHAPES, Polygons, shaped
from pipeline.volume.rock.tiles import Tiles
from pipeline.volume.separation import ConvexBodies, Facets
from pipeline.volume.union import Volume

_ALLOWED_M = 1e-7  # volume of a part in the free space, by its area: rounding
_SHALLOW_M = 1e-5  # a facet that is deeper in a part shares more with it than is allowed
_LEAST_M = 1e-6  # a part that is thinner has no volume
THIN_M = 0.0199  # what a body may sink in, 2 cm, less the rounding of parts that are as thick
SLIVER_M2 = 1e-6  # behind a smaller facet the rock may be as thin as it is
_THINNEST = (("moved", 0.02), ("cut", 0.02), ("pyramid", 0.04), ("plate", 0.02))  # have least in the free space
_SHAPES_OF_MANY = 2  # rather a part for each facet than a thin one for all

Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class ShellPart:
    """One convex part: its corners (k, 3) m, the facets that it lies behind, its shape, and what of it is free, m3."""

    corners: np.ndarray
    facets: list[int]
    shape: str
    depth_m: float  # of its farthest corner behind the facet
    area_m2: float
    intrusion_m3: float


def build_shell(volume: Volume, progress: Progress = iter) -> list[ShellPart]:
    """Return one part behind each convex polygon of facets.

    The first shape counts that has nothing in the free space: the polygon moved 0.3 m into the rock along the ways of
    its corners, or less; the same cut along the bisectors of the rock's edges; a pyramid; a plate along the normal. If
    all have, it is the one with the least. A part is in the rock if a plane separates it from each facet but its own;
    a boolean decides where one hardly touches. That holds for a mesh that does not cross itself.
    """
    shell = _Shell(volume)
    steps = progress(range(_SHAPES_OF_MANY + len(SHAPES)))
    surfaces = polygons_of(volume)
    left = [surface for surface in surfaces if len(surface[1]) > 1]
    for step in steps:
        if step == _SHAPES_OF_MANY:
            left = [([int(v) for v in volume.faces[k]], [k]) for _, facets in left for k in facets]
            left += [surface for surface in surfaces if len(surface[1]) == 1]
        left = shell.fit(left, *SHAPES[step if step < _SHAPES_OF_MANY else step - _SHAPES_OF_MANY])
    return shell.parts + [shell.least(surface) for surface in left]


def facets_without_part(volume: Volume, some: np.ndarray | None = None) -> dict[int, list[int]]:
    """Return the facets behind which no part of 2 cm is in the rock, each with those that the best part reaches.

    With `some`, a mask (f,), only these are tried.
    """
    shell = _Shell(volume)
    chosen = range(len(volume.faces)) if some is None else np.flatnonzero(some).tolist()
    left = [([int(v) for v in volume.faces[k]], [k]) for k in chosen]
    for kind, depth_m in _THINNEST:
        left = shell.fit(left, kind, depth_m)
    thin = [k for _, (k,) in left if shell.area_m2([k]) > SLIVER_M2]
    return shell.reached([([int(v) for v in volume.faces[k]], [k]) for k in thin])


class _Shell:
    """The parts that were found, and what tests others."""

    def __init__(self, volume: Volume) -> None:
        """Index the free space."""
        self.parts: list[ShellPart] = []
        self._volume, self._ways = volume, ways_into_rock(volume)
        self._facets, self._tiles = Facets(volume.vertices, volume.faces), Tiles(volume.solid)
        normal = volume.normals
        self._size = np.linalg.norm(normal, axis=1)
        self._unit = normal / np.maximum(self._size, 1e-30)[:, None]
        self._beside = {(f[i], f[(i + 1) % 3]): k for k, f in enumerate(volume.faces.tolist()) for i in range(3)}

    def fit(self, surfaces: list[tuple[list[int], list[int]]], kind: str, depth_m: float) -> list:
        """Add the parts of one shape that are in the rock; return the surfaces that need another shape."""
        self._own(surfaces)
        left = []
        for polygons in self._polygons(surfaces):
            bodies = shaped(polygons, kind, depth_m)
            depth = np.einsum("nck,nk->nc", bodies.corners - polygons.corners[:, :1], polygons.normals).max(axis=1)
            inside = self._inside(bodies)
            for n, number in enumerate(polygons.numbers.tolist()):
                _, facets = surfaces[number]
                area = self.area_m2(facets)
                shared = 0.0
                if 0 < inside[n] < _SHALLOW_M:
                    shared = self._tiles.shared_m3(manifold3d.Manifold.hull_points(bodies.corners[n]))
                least = THIN_M if area > SLIVER_M2 else _LEAST_M
                if inside[n] >= _SHALLOW_M or depth[n] < least or shared > _ALLOWED_M * area:
                    left.append(surfaces[number])
                    continue
                self.parts.append(
                    ShellPart(bodies.corners[n], facets, f"{kind} {depth_m:g}", float(depth[n]), area, shared)
                )
        return left

    def least(self, surface: tuple[list[int], list[int]]) -> ShellPart:
        """Return the part of the shape that has least in the free space, of those of 2 cm if there are any."""
        ring, facets = surface
        area = self.area_m2(facets)
        polygon = next(self._polygons([surface]))
        best: ShellPart | None = None
        for kind, depth_m in _THINNEST:
            corners = shaped(polygon, kind, depth_m).corners[0]
            depth = float(((corners - polygon.corners[0, 0]) @ polygon.normals[0]).max())
            solid = manifold3d.Manifold.hull_points(corners)
            if depth < _LEAST_M or solid.is_empty() or solid.volume() <= 0:
                continue
            shared = self._tiles.shared_m3(solid)
            if best is None or (depth < THIN_M, shared) < (best.depth_m < THIN_M, best.intrusion_m3):
                best = ShellPart(corners, facets, f"{kind} {depth_m:g}", depth, area, shared)
        if best is None:  # a facet without an area
            corners = self._volume.vertices[ring]
            return ShellPart(
                np.concatenate([corners, corners + _THINNEST[0][1] * polygon.normals[0]]),
                facets,
                "none",
                0.0,
                area,
                0.0,
            )
        return best

    def area_m2(self, facets: list[int]) -> float:
        """Return the area of some facets."""
        return float(self._size[facets].sum() / 2)

    def reached(self, surfaces: list[tuple[list[int], list[int]]]) -> dict[int, list[int]]:
        """Return for each surface of one facet the facets that its part of 2 cm reaches."""
        self._own(surfaces)
        found: dict[int, list[int]] = {k: [] for _, (k,) in surfaces}
        for polygons in self._polygons(surfaces):
            contacts = self._facets.crossing(shaped(polygons, *_THINNEST[0]))
            for body, facet in zip(contacts.body.tolist(), contacts.facet.tolist(), strict=True):
                found[surfaces[polygons.numbers[body]][1][0]].append(facet)
        return found

    def _inside(self, bodies: ConvexBodies) -> np.ndarray:
        """Return how deep (n,) m a facet is in each body."""
        found = np.zeros(len(bodies))
        contacts = self._facets.crossing(bodies, _SHALLOW_M)
        np.maximum.at(found, contacts.body, contacts.depth_m)
        return found

    def _own(self, surfaces: list[tuple[list[int], list[int]]]) -> None:
        owner = self._facets.owner
        owner[:] = -1
        for number, (_, facets) in enumerate(surfaces):
            owner[facets] = number

    def _polygons(self, surfaces: list[tuple[list[int], list[int]]]) -> Iterator[Polygons]:
        """Return the surfaces as polygons, those with equally many corners together."""
        counts = np.array([len(ring) for ring, _ in surfaces], int)
        for k in np.unique(counts):
            numbers = np.flatnonzero(counts == k)
            rings = np.array([surfaces[n][0] for n in numbers])
            following = np.roll(rings, -1, axis=1)
            beside = np.array(
                [
                    [self._beside[b, a] for a, b in zip(*pair, strict=True)]
                    for pair in zip(rings.tolist(), following.tolist(), strict=True)
                ]
            )
            biggest = np.array([max(surfaces[n][1], key=lambda f: float(self._size[f])) for n in numbers])
            yield Polygons(
                numbers, self._volume.vertices[rings], self._ways[rings], self._unit[biggest], self._unit[beside]
            )
