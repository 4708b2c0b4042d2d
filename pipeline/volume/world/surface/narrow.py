"""How narrow the passages of a volume are: the balls that fit in the middles of its legs' sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.volume.union import Volume
from pipeline.volume.world.topology import LegNetwork

_APART_M = 1.0  # along the legs
_MIDDLE = (0.25, 0.75)  # of a leg: at its ends others meet it, or it ends
_ROUNDS, _FIRST_M = 30, 0.5  # of centring, and its first step
_LEAST_M = 0.2  # of a ball's first radius: nearer to a wall, the direction of the wall is uncertain
_AS_NARROW = 1.1  # of the narrowest


@dataclass(frozen=True)
class Balls:
    """Middles (n, 3) m, mine frame, and radii (n,) m of balls that touch the facets of a volume."""

    middles_m: np.ndarray
    radii_m: np.ndarray

    @property
    def narrowest(self) -> Balls:
        """Return the balls of the narrowest passage, and of those up to a tenth wider."""
        some = self.radii_m <= _AS_NARROW * self.radii_m.min(initial=np.inf)
        return Balls(self.middles_m[some], self.radii_m[some])


@dataclass(frozen=True)
class Narrowest:
    """The middle (3,) m of the smallest ball in the passages, and how far it is from walls and roofs, m."""

    middle_m: np.ndarray
    wall_m: float

    @classmethod
    def of(cls, balls: Balls, volume: Volume | VolumeFacets) -> Narrowest | None:
        """Return the middle of the smallest of the balls in a volume; None without balls."""
        if not len(balls.radii_m):
            return None
        middle, walls = balls.middles_m[balls.radii_m.argmin()], volume.faces[volume.label != FacetLabel.FLOOR]
        return cls(middle, float(NearestFacets(volume.vertices, walls, 1).query(middle[None]).distance_m[0]))

    def kept(self, vertices: np.ndarray, faces: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the share of the distance to walls and roofs that rock leaves, and the nearest place (3,) m of it."""
        nearest = NearestFacets(vertices, faces, 1).query(self.middle_m[None])
        return float(nearest.distance_m[0]) / self.wall_m, nearest.place_m[0]


NO_BALLS = Balls(np.zeros((0, 3)), np.zeros(0))


def places_along(legs: LegNetwork) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 3) m along the legs, half-way up, and the unit vectors (n, 3) of their legs."""
    places, ways = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for leg in legs.legs:
        a, b = np.array(legs.stations_m[leg.start]), np.array(legs.stations_m[leg.end])
        (_, _, up, down), (_, _, far_up, far_down) = leg.lrud_m
        a, b = a + [0, 0, (up - down) / 2], b + [0, 0, (far_up - far_down) / 2]  # noqa: RUF005
        share = np.linspace(*_MIDDLE, max(1, round(leg.length_m / 2 / _APART_M)))[:, None]
        places.append(a * (1 - share) + b * share)
        ways.append(np.repeat((b - a)[None] / np.linalg.norm(b - a), len(share), axis=0))
    return np.concatenate(places), np.concatenate(ways)


def balls_along(volume: Volume | VolumeFacets, legs: LegNetwork) -> Balls:
    """Return a ball for each place along the legs.

    A leg may run beside a wall. Its places move across it, away from the nearest facet, as long as that gets farther:
    the ball is as wide as the passage.
    """
    places, ways = places_along(legs)
    facets = NearestFacets(volume.vertices, volume.faces, 1)
    radii, away = _away(facets, places, ways)
    kept = radii > _LEAST_M
    places, ways, radii, away = places[kept], ways[kept], radii[kept], away[kept]
    step = np.full(len(places), _FIRST_M)
    for _ in range(_ROUNDS):
        tried = places + step[:, None] * away
        found, onwards = _away(facets, tried, ways)
        better = found > radii
        places, radii, away = (
            np.where(better[:, None], tried, places),
            np.where(better, found, radii),
            np.where(better[:, None], onwards, away),
        )
        step = np.where(better, step, step / 2)
    return Balls(places, radii)


def _away(facets: NearestFacets, places: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances (n,) m of places from the nearest facet, and the way (n, 3) from it, across the legs."""
    nearest = facets.query(places)
    away = places - nearest.place_m
    across = away - (away * ways).sum(axis=1, keepdims=True) * ways
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    return nearest.distance_m, across
