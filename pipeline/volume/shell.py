"""The rock as convex parts: one behind every facet of the free space, none in the free space, none left out."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from pipeline.volume.keyed import near_facets, of_facets
from pipeline.volume.rock.inside import Inside
from pipeline.volume.rock.polygons import polygons_of
from pipeline.volume.rock.rays import RaysIntoRock
from pipeline.volume.rock.shapes import SHAPES, Polygons, shaped
from pipeline.volume.rock.shared import shared_m3
from pipeline.volume.rock.surfaces import RockSurfaces
from pipeline.volume.separation import ConvexBodies, Facets
from pipeline.volume.union import Volume

_ALLOWED_M = 1e-7  # volume of a part in the free space, by its area: rounding
_SHALLOW_M = 1e-5  # a facet that is deeper in a part shares more with it than is allowed
_LEAST_M = 1e-6  # a part that is thinner has no volume
THIN_M = 0.0199  # what a body may sink in, 2 cm, less the rounding of parts that are as thick
SLIVER_M2 = 1e-6  # behind a smaller facet the rock may be as thin as it is
_THINNEST = (("moved", 0.02), ("cut", 0.02), ("pyramid", 0.04), ("plate", 0.02))  # have least in the free space
_REACH_M = 0.1  # more than a corner of these is from its facet
_SHAPES_OF_MANY = 2  # rather a part for each facet than a thin one for all


@dataclass(frozen=True)
class ShellPart:
    """One convex part: its corners (k, 3) m, the facets that it lies behind, its shape, and what of it is free, m3."""

    corners: np.ndarray
    facets: list[int]
    shape: str
    depth_m: float  # of its farthest corner behind the facet
    area_m2: float
    intrusion_m3: float


def build_shell(volume: Volume) -> list[ShellPart]:
    """Return one part behind each convex polygon of facets, in the order of their first facets.

    The first shape counts that has nothing in the free space: the polygon moved 0.3 m into the rock along the ways of
    its corners, or less; the same cut along the bisectors of the rock's edges; a pyramid; a plate along the normal. If
    all have, it is the one with the least. A part is in the rock if a plane separates it from each facet but its own;
    where one hardly touches, the volume that it shares decides. That holds for a mesh that does not cross itself.
    """
    shell = _Shell(volume)
    surfaces = polygons_of(volume)
    left = shell.begin(RockSurfaces(volume, [surface for surface in surfaces if len(surface[1]) > 1]))
    for kind, depth_m in SHAPES[:_SHAPES_OF_MANY]:
        left = shell.fit(left, kind, depth_m)
    facets = [k for polygons in left for number in polygons.numbers.tolist() for k in shell.facets_of(number)]
    facets += [k for _, (k, *more) in surfaces if not more]
    left = shell.begin(RockSurfaces.of_facets(volume, facets))
    for kind, depth_m in SHAPES:
        left = shell.fit(left, kind, depth_m)
    parts = shell.parts + [part for polygons in left for part in shell.least(polygons)]
    return sorted(parts, key=lambda part: part.facets[0])


def facets_without_part(
    volume: Volume, some: np.ndarray | None = None, least_m2: float = SLIVER_M2
) -> dict[int, list[int]]:
    """Return the facets behind which no part of 2 cm is in the rock, each with those that the best part reaches.

    Facets of `least_m2`, m2, and less are not tried. With `some`, a mask (f,), only these are tried.
    """
    tried = np.linalg.norm(volume.normals, axis=1) / 2 > least_m2
    numbers = np.arange(len(volume.faces))
    if some is not None:
        tried &= some
        corners, beside, others = volume.vertices[volume.faces], tried.copy(), np.flatnonzero(~tried)
        beside[others] = near_facets(corners[others], corners[tried], _REACH_M)
        numbers = np.flatnonzero(beside)
        volume = of_facets(volume, numbers)
    shell = _Shell(volume)
    left = shell.begin(RockSurfaces.of_facets(volume, np.flatnonzero(tried[numbers]).tolist()))
    for kind, depth_m in _THINNEST:
        left = shell.fit(left, kind, depth_m)
    found: dict[int, list[int]] = {}
    for polygons in left:
        for facet, reached in shell.reached(polygons).items():
            found[int(numbers[facet])] = numbers[reached].tolist()
    return found


class _Shell:
    """The parts that were found, and what tests others."""

    def __init__(self, volume: Volume) -> None:
        """Index the free space."""
        self.parts: list[ShellPart] = []
        self._facets, self._volume = Facets(volume.vertices, volume.faces), volume
        self._space: Inside | None = None
        self._rays = RaysIntoRock(volume.vertices, volume.faces)

    def begin(self, surfaces: RockSurfaces) -> list[Polygons]:
        """Take the surfaces that parts are to be found for; return them as polygons."""
        self._surfaces = surfaces
        self._facets.owner[:] = surfaces.owner
        return surfaces.polygons()

    def facets_of(self, number: int) -> list[int]:
        """Return the facets of a surface."""
        return self._surfaces.facets[number]

    def fit(self, left: list[Polygons], kind: str, depth_m: float) -> list[Polygons]:
        """Add the parts of one shape that are in the rock; return the polygons that need another shape."""
        return [one for polygons in left if len(one := polygons.some(~self._fits(polygons, kind, depth_m)))]

    def _fits(self, polygons: Polygons, kind: str, depth_m: float) -> np.ndarray:
        """Add the parts of one shape that are in the rock; return of which polygons (n,)."""
        fits = ~self._rays.blocked(polygons, kind, depth_m)
        numbers = np.flatnonzero(fits)
        if not len(numbers):
            return fits
        tried = polygons.some(numbers)
        bodies = shaped(tried, kind, depth_m)
        depth = np.einsum("nck,nk->nc", bodies.corners - tried.corners[:, :1], tried.normals).max(axis=1)
        inside, shared = self._inside(bodies), np.zeros(len(bodies))
        is_sliver = tried.areas_m2 <= SLIVER_M2  # of any normal: its part may be free, on no facet
        for ask, are_free in ((~is_sliver & (inside > 0), _none), (is_sliver, self._are_free)):
            some = np.flatnonzero(ask & (inside < _SHALLOW_M))
            shared[some] = shared_m3(self._facets, list(bodies.corners[some]), are_free)
        least = np.where(is_sliver, _LEAST_M, THIN_M)
        good = (inside < _SHALLOW_M) & (depth >= least) & (shared <= _ALLOWED_M * tried.areas_m2)
        count = bodies.counts()
        for n in np.flatnonzero(good).tolist():
            self.parts.append(
                ShellPart(
                    bodies.corners[n, : count[n]],
                    self.facets_of(int(tried.numbers[n])),
                    f"{kind} {depth_m:g}",
                    float(depth[n]),
                    float(tried.areas_m2[n]),
                    float(shared[n]),
                )
            )
        fits[numbers[~good]] = False
        return fits

    def least(self, polygons: Polygons) -> list[ShellPart]:
        """Return the part of the shape that has least in the free space of each, of those of 2 cm if there are any."""
        best: dict[int, ShellPart] = {}
        least = np.where(polygons.areas_m2 > SLIVER_M2, THIN_M, 0.0).tolist()
        for kind, depth_m in _THINNEST:
            bodies = shaped(polygons, kind, depth_m)
            corners = [body[:count] for body, count in zip(bodies.corners, bodies.counts().tolist(), strict=True)]
            some = np.flatnonzero([_has_volume(body) for body in corners]).tolist()
            shared = shared_m3(self._facets, [corners[n] for n in some], self._are_free).tolist()
            for n, free_m3 in zip(some, shared, strict=True):
                depth = float(((corners[n] - polygons.corners[n, 0]) @ polygons.normals[n]).max())
                area, facets = float(polygons.areas_m2[n]), self.facets_of(int(polygons.numbers[n]))
                part = ShellPart(corners[n], facets, f"{kind} {depth_m:g}", depth, area, free_m3)
                if depth >= _LEAST_M and (n not in best or _is_better(part, best[n], least[n])):
                    best[n] = part
        return [best.get(n) or self._flat(polygons, n) for n in range(len(polygons))]

    def _flat(self, polygons: Polygons, number: int) -> ShellPart:
        """Return a part of no depth behind a facet without an area."""
        corners = polygons.corners[number]
        corners = np.concatenate([corners, corners + _THINNEST[0][1] * polygons.normals[number]])
        facets = self.facets_of(int(polygons.numbers[number]))
        return ShellPart(corners, facets, "none", 0.0, float(polygons.areas_m2[number]), 0.0)

    def reached(self, polygons: Polygons) -> dict[int, list[int]]:
        """Return for each surface of one facet the facets that its part of 2 cm reaches."""
        found: dict[int, list[int]] = {k: [] for k in polygons.numbers.tolist()}
        contacts = self._facets.crossing(shaped(polygons, *_THINNEST[0]))
        for number, facet in zip(polygons.numbers[contacts.body].tolist(), contacts.facet.tolist(), strict=True):
            found[number].append(facet)
        return found

    def _are_free(self, places: np.ndarray) -> np.ndarray:
        """Return which places (n, 3) m are in the free space of a whole volume."""
        self._space = self._space or Inside(self._volume)
        return self._space.are_free(places)

    def _inside(self, bodies: ConvexBodies) -> np.ndarray:
        """Return how deep (n,) m a facet is in each body."""
        found = np.zeros(len(bodies))
        contacts = self._facets.crossing(bodies, _SHALLOW_M)
        np.maximum.at(found, contacts.body, contacts.depth_m)
        return found


def _has_volume(corners: np.ndarray) -> bool:
    solid = manifold3d.Manifold.hull_points(corners)
    return not solid.is_empty() and solid.volume() > 0


def _is_better(one: ShellPart, other: ShellPart, least_m: float) -> bool:
    """Return whether a part has less in the free space than another; one that is less deep than `least_m` is worse."""
    return (one.depth_m < least_m, one.intrusion_m3) < (other.depth_m < least_m, other.intrusion_m3)


def _none(places: np.ndarray) -> np.ndarray:
    return np.zeros(len(places), bool)
