"""The rock as convex parts: one behind every facet of the free space, none in the free space, none left out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import compress

import manifold3d
import numpy as np

from pipeline.geometry.facets.separation import ROUNDING_M, ConvexBodies, Facets
from pipeline.volume.labelled_solid import near_facets, of_facets
from pipeline.volume.rock.depth import is_deeper
from pipeline.volume.rock.faces import ON_PLANE_M
from pipeline.volume.rock.intruding_volume import shared_m3
from pipeline.volume.rock.polygons import polygons_of
from pipeline.volume.rock.ragged import middles_of, parts_of
from pipeline.volume.rock.rays import blocked
from pipeline.volume.rock.shapes import SHAPES, Polygons, shaped
from pipeline.volume.rock.surfaces import RockSurfaces
from pipeline.volume.rock.tiles import Tile
from pipeline.volume.union import Volume

_ALLOWED_M = 1e-7  # volume of a part in the free space, by its area: rounding
_SHALLOW_M = 1e-5  # a facet that is deeper in a part shares more with it than is allowed
_LEAST_M = 1e-6  # a part that is thinner has no volume
THIN_M = 0.0199  # what a body may sink in, 2 cm, less the rounding of parts that are as thick
SLIVER_M2 = 1e-6  # behind a smaller facet the rock may be as thin as it is
_THINNEST = (("moved", 0.02), ("cut", 0.02), ("pyramid", 0.04), ("plate", 0.02))  # have least in the free space
HARDLY_M = 0.001  # what a part may reach into the free space where no shape is in the rock: half of what is certified
_LAST = ("plate", 0.001)  # is no farther in it, whatever is behind the facet
_REACH_M = 0.1  # more than a corner of these is from its facet
_SHAPES_OF_MANY = 2  # rather a part for each facet than a thin one for all


@dataclass(frozen=True)
class ShellPart:
    """One convex part: its corners (k, 3) m, the facets that it lies behind, and its shape."""

    corners: np.ndarray
    facets: list[int]
    shape: str
    depth_m: float  # of its farthest corner behind the facet
    area_m2: float


def build_shell(volume: Volume) -> list[ShellPart]:
    """Return one part behind each convex polygon of facets, in the order of their first facets.

    The first shape counts that has nothing in the free space: the polygon moved 0.3 m into the rock along the ways of
    its corners, or less; the same cut along the bisectors of the rock's edges; a pyramid; a plate along the normal. If
    all have, the shapes of 2 cm are cut at the planes of the facets that reach into them, and the deepest counts that
    is at most 1 mm in the free space; else a plate of 1 mm. A part is in the rock if a plane separates it from each
    facet but its own and its middle is in the rock; where one hardly touches, the volume that it shares decides.
    Facets that are narrower than 10 um have no part: the plane of such a facet is not known.
    """
    shell = _Shell(volume)
    is_wide = _are_wide(volume)
    surfaces = [surface for surface in polygons_of(volume) if is_wide[surface[1]].any()]
    left = shell.begin(RockSurfaces(volume, [surface for surface in surfaces if len(surface[1]) > 1]))
    for kind, depth_m in SHAPES[:_SHAPES_OF_MANY]:
        left = shell.fit(left, kind, depth_m)
    facets = [k for polygons in left for number in polygons.numbers.tolist() for k in shell.facets_of(number)]
    facets += [k for _, (k, *more) in surfaces if not more]
    left = shell.begin(RockSurfaces.of_facets(volume, [k for k in facets if is_wide[k]]))
    for kind, depth_m in SHAPES:
        left = shell.fit(left, kind, depth_m)
    parts, free = shell.apart()
    facets = [k for part in free for k in part.facets]
    facets += [k for polygons in left for k in polygons.numbers.tolist()]
    for polygons in shell.begin(RockSurfaces.of_facets(volume, facets)):
        parts += shell.least(polygons)
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
        fits = ~blocked(self._volume.inside, polygons, kind, depth_m)
        numbers = np.flatnonzero(fits)
        if not len(numbers):
            return fits
        tried = polygons.some(numbers)
        bodies = shaped(tried, kind, depth_m)
        depth = np.einsum("nck,nk->nc", bodies.corners - tried.corners[:, :1], tried.normals).max(axis=1)
        inside, shared = self._inside(bodies), np.zeros(len(bodies))
        is_sliver = tried.areas_m2 <= SLIVER_M2  # of any normal: its part may be free, on no facet
        for ask, are_free in ((~is_sliver & (inside > 0), _none), (is_sliver, self._volume.inside.are_free)):
            some = np.flatnonzero(ask & (inside < _SHALLOW_M))
            shared[some] = shared_m3(self._facets, list(bodies.corners[some]), are_free)
        least = np.where(is_sliver, _LEAST_M, THIN_M)
        good = (inside < _SHALLOW_M) & (depth >= least) & (shared <= _ALLOWED_M * tried.areas_m2)
        good &= _hold_fronts(bodies, tried)
        count = bodies.counts()
        for n in np.flatnonzero(good).tolist():
            self.parts.append(
                ShellPart(
                    bodies.corners[n, : count[n]],
                    self.facets_of(int(tried.numbers[n])),
                    f"{kind} {depth_m:g}",
                    float(depth[n]),
                    float(tried.areas_m2[n]),
                )
            )
        fits[numbers[~good]] = False
        return fits

    def apart(self) -> tuple[list[ShellPart], list[ShellPart]]:
        """Return the parts whose middles are in the rock, and the others: planes do not show these."""
        middles = middles_of(parts_of([part.corners for part in self.parts]))
        free = self._volume.inside.are_free(middles).tolist() if len(middles) else []
        kept = [part for part, is_free in zip(self.parts, free, strict=True) if not is_free]
        return kept, list(compress(self.parts, free))

    def least(self, polygons: Polygons) -> list[ShellPart]:
        """Return for each polygon the deepest part that is hardly in the free space."""
        found: list[list[ShellPart]] = [[] for _ in range(len(polygons))]
        for kind, depth_m in (*_THINNEST, _LAST):
            bodies = shaped(polygons, kind, depth_m)
            contacts = self._facets.crossing(bodies)
            for n, count in enumerate(bodies.counts().tolist()):
                reaching = contacts.facet[contacts.body == n]
                corners = self._cut(bodies.corners[n, :count], polygons.corners[n], reaching)
                depth = float(((corners - polygons.corners[n, 0]) @ polygons.normals[n]).max(initial=0.0))
                if depth < _LEAST_M or not _has_volume(corners):
                    continue
                facets, area = self.facets_of(int(polygons.numbers[n])), float(polygons.areas_m2[n])
                found[n].append(ShellPart(corners, facets, f"{kind} {depth_m:g}", depth, area))
        return [self._deepest(some) or self._flat(polygons, n) for n, some in enumerate(found)]

    def _cut(self, corners: np.ndarray, front: np.ndarray, facets: np.ndarray) -> np.ndarray:
        """Return what of a part is in the rock by the planes of some facets; those that cut its front are left out."""
        body = manifold3d.Manifold.hull_points(corners)
        for facet in facets.tolist():
            way = self._facets.normals[facet]  # into the rock
            level = float(way @ self._facets.corners[facet, 0])
            if (front @ way).min() > level - ROUNDING_M:
                body = body.trim_by_plane(way.tolist(), level)
        return np.asarray(body.to_mesh64().vert_properties)[:, :3]

    def _deepest(self, parts: list[ShellPart]) -> ShellPart | None:
        """Return the part that is deepest behind its facet, of those that are hardly in the free space."""
        for part in sorted(parts, key=lambda part: -part.depth_m):
            if not is_deeper(part.corners, HARDLY_M, self._tile, self._volume.inside, self._facets.corners):
                return part
        return None

    def _flat(self, polygons: Polygons, number: int) -> ShellPart:
        """Return a part of no depth behind a facet without an area."""
        corners = polygons.corners[number]
        corners = np.concatenate([corners, corners + _LAST[1] * polygons.normals[number]])
        facets = self.facets_of(int(polygons.numbers[number]))
        return ShellPart(corners, facets, "none", 0.0, float(polygons.areas_m2[number]))

    def reached(self, polygons: Polygons) -> dict[int, list[int]]:
        """Return for each surface of one facet the facets that its part of 2 cm reaches."""
        found: dict[int, list[int]] = {k: [] for k in polygons.numbers.tolist()}
        contacts = self._facets.crossing(shaped(polygons, *_THINNEST[0]))
        for number, facet in zip(polygons.numbers[contacts.body].tolist(), contacts.facet.tolist(), strict=True):
            found[number].append(facet)
        return found

    @cached_property
    def _tile(self) -> Tile:
        return Tile.of(self._volume.solid)

    def _inside(self, bodies: ConvexBodies) -> np.ndarray:
        """Return how deep (n,) m a facet is in each body."""
        found = np.zeros(len(bodies))
        contacts = self._facets.crossing(bodies, _SHALLOW_M)
        np.maximum.at(found, contacts.body, contacts.depth_m)
        return found


def _has_volume(corners: np.ndarray) -> bool:
    solid = manifold3d.Manifold.hull_points(corners)
    return not solid.is_empty() and solid.volume() > 0


def _are_wide(volume: Volume) -> np.ndarray:
    """Return which facets (f,) are not narrow, as their height over the longest edge is."""
    corners = volume.vertices[volume.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    found: np.ndarray = np.linalg.norm(volume.normals, axis=1) > ON_PLANE_M * longest
    return found


def _hold_fronts(bodies: ConvexBodies, polygons: Polygons) -> np.ndarray:
    """Return which bodies (n,) have their polygon's corners: those of slivers may be cut away from it."""
    found = np.ones(len(bodies), bool)
    for k in range(polygons.corners.shape[1]):
        apart = np.abs(bodies.corners - polygons.corners[:, k : k + 1]).max(axis=2)
        found &= apart.min(axis=1) < ON_PLANE_M
    return found


def _none(places: np.ndarray) -> np.ndarray:
    return np.zeros(len(places), bool)
