"""Heights of shared floors: those of the survey along the legs, between the sections' elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import spsolve

from pipeline.volume.height_field.overlapping_floors import SharedFloors
from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.height_field.surface import FloorSurface, surface_of
from pipeline.volume.network import SurveyNetwork
from pipeline.volume.union import Solid

_FIX = 1e4  # weight of a leg's floor against the smoothness of the floor
_HOLD = 10.0  # the same of the sections' floors where a leg passes, or a floor is near, that does not share it
_PULL = 0.3  # the same elsewhere, a m2: what a leg does to the floor ends within a few metres
_PARTED = 10.0  # the same of a floor over or under one that it is parted from: they are as far apart as stated
_PULL_LEAST = 1e-7
_PASS_M = 2.0  # over or under a floor: a leg that is so near lies on it, cuts it, or it rises to the leg elsewhere
_PRISM = 1e-3  # weight of a prism's floor against that of a leg
_RIM_M = 0.25  # of a leg's weight at its outline, where it is the least
_ON_LINE_M = 0.002  # seen from above: a place so near a leg is on it
_LEAST_M2 = 1e-6  # of a triangle in plan, twice
_LEAST_M = 0.02  # of an edge in plan
_LOW = 0.02  # of a triangle's height over its longest edge: of lower ones only the springs are right


@dataclass(frozen=True)
class HeightField:
    """Heights (n,) m of a surface's vertices, and the least and the largest of the sections' there.

    `tall_m` is the least height of a passage over the floor there.
    """

    surface: FloorSurface
    heights_m: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray
    tall_m: np.ndarray


def solve_heights(network: SurveyNetwork, pieces: list[Solid]) -> HeightField:
    """Return the floors of all pieces that are flat enough to drive on, with the survey's heights along the legs.

    Where legs share a floor, its slopes are as near as can be to those of a mean of the sections' floors, in which each
    leg counts by how far the place is inside its outline. So a floor has no kink where a leg's outline ends.
    """
    floors = SectionFloors.of(network, pieces)
    shared = SharedFloors(network, pieces, floors)
    surface = surface_of(network, pieces, floors, shared)
    corners, n = surface.corners, len(surface.plan_m)
    triangle, piece = surface.of_pieces
    stated = np.stack([floors.heights_at(piece, surface.places[spot]) for spot in surface.spots[triangle].T], axis=1)
    low, high, tall = np.full(n, np.inf), np.full(n, -np.inf), np.full(n, np.inf)
    np.minimum.at(low, corners[triangle], stated)
    np.maximum.at(high, corners[triangle], stated)
    np.minimum.at(tall, corners[triangle], floors.tall_m[piece][:, None])
    mean = _mean_floors(surface, pieces, floors, stated)
    count = np.bincount(corners.ravel(), minlength=n)
    target = np.bincount(corners.ravel(), mean.ravel(), n) / np.maximum(count, 1)
    stiff, slopes = _stiffness(surface, mean)
    a, b, c = np.moveaxis(surface.places[surface.spots], 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 6
    pull = np.where(surface.parted, _PARTED, _PULL)[surface.patch]
    weight = _PULL_LEAST + np.bincount(corners.ravel(), np.repeat(pull * area, 3), n)
    held, passing = _on_legs(network, pieces, surface, shared, target)
    weight[list(passing)] = _HOLD
    weight[corners[surface.held[surface.patch]]] = _HOLD
    fixed, heights = np.array(list(held), int), np.array(list(held.values()))
    weight[fixed], target[fixed] = _FIX, heights
    level = float(target.mean()) if n else 0.0
    diagonal = csr_matrix((weight, (range(n), range(n))), shape=(n, n))
    found = spsolve((stiff + diagonal).tocsc(), slopes + weight * (target - level)) + level if n else target
    found[fixed] = heights
    return HeightField(surface, found, low, high, tall)


def _mean_floors(surface: FloorSurface, pieces: list[Solid], floors: SectionFloors, stated: np.ndarray) -> np.ndarray:
    """Return the mean (t, 3) m, at the triangles' corners, of the sections' floors (k, 3) m of the patches' pieces."""
    triangle, piece = surface.of_pieces
    rings = shapely.get_exterior_ring(floors.outlines)
    shapely.prepare(rings)
    kind = np.array([1.0 if is_leg(one) else _PRISM for one in pieces])[piece]
    found = np.zeros(surface.spots.shape)
    for corner, spot in enumerate(surface.spots[triangle].T):
        inside = shapely.distance(rings[piece], shapely.points(surface.places[spot]))
        weight = (inside + _RIM_M) * kind
        sums = [np.bincount(triangle, some, len(found)) for some in (weight * stated[:, corner], weight)]
        found[:, corner] = sums[0] / sums[1]
    return found


def _stiffness(surface: FloorSurface, mean: np.ndarray) -> tuple[csr_matrix, np.ndarray]:
    """Return the Laplacian (n, n) of the surface seen from above, and what it is of heights (t, 3) m at the corners."""
    places, corners, n = surface.places[surface.spots], surface.corners, len(surface.plan_m)
    a, b, c = np.moveaxis(places, 1, 0)
    double = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    longest = np.maximum.reduce([np.sum((p - q) ** 2, axis=1) for p, q in ((a, b), (b, c), (c, a))])
    rows, cols, values, slopes = [], [], [], np.zeros(n)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        p, q, r = places[:, i], places[:, j], places[:, k]
        cot = np.sum((p - r) * (q - r), axis=1) / np.maximum(double, _LEAST_M2) / 2
        spring = 1 / np.maximum(np.linalg.norm(p - q, axis=1), _LEAST_M)
        # Obtuse triangles have negative weights, which are right; of slivers only the springs are.
        weight = np.where(double > _LOW * longest, cot, spring)
        one, two = corners[:, i], corners[:, j]
        rows += [one, two, one, two]
        cols += [two, one, one, two]
        values += [-weight, -weight, weight, weight]
        step = weight * (mean[:, i] - mean[:, j])
        slopes += np.bincount(one, step, n) - np.bincount(two, step, n)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    return coo_matrix(entries, (n, n)).tocsr(), slopes


def _on_legs(
    network: SurveyNetwork, pieces: list[Solid], surface: FloorSurface, shared: SharedFloors, mean_m: np.ndarray
) -> tuple[dict[int, float], set[int]]:
    """Return the vertices on legs that share their floor, with the survey's heights, and those that others pass.

    A leg that comes down to another has the height of its ramp. A leg passes a floor if it is at most 2 m over or under
    it.
    """
    held: dict[int, float] = {}
    passing = set()
    for vertex, patch, leg, height in _vertices_on_legs(network, pieces, surface, shared):
        if leg in surface.pieces[patch]:
            held[vertex] = min(held.get(vertex, np.inf), height)
        elif abs(height - mean_m[vertex]) < _PASS_M:
            passing.add(vertex)
    return held, passing


def _vertices_on_legs(
    network: SurveyNetwork, pieces: list[Solid], surface: FloorSurface, shared: SharedFloors
) -> Iterator[tuple[int, int, int, float]]:
    """Yield a vertex, its patch, a leg that it is on seen from above, and the leg's floor there, m."""
    legs = np.array([n for n, piece in enumerate(pieces) if piece.is_drivable and is_leg(piece)], int)
    ends = network.ways_m[[pieces[n].shot for n in legs]]
    tree = shapely.STRtree(shapely.linestrings(ends[:, :, :2]))
    spot, row = tree.query(shapely.points(surface.places), predicate="dwithin", distance=_ON_LINE_M)
    way = ends[row, 1] - ends[row, 0]
    run = np.maximum((way[:, :2] ** 2).sum(axis=1), 1e-12)
    share = np.clip(((surface.places[spot] - ends[row, 0, :2]) * way[:, :2]).sum(axis=1) / run, 0, 1)
    heights = ends[row, 0, 2] + share * way[:, 2] - shared.descents.under(legs[row], surface.places[spot])[0]
    wanted: dict[int, list[tuple[int, float]]] = {}
    for k, leg, height in zip(spot.tolist(), legs[row].tolist(), heights.tolist(), strict=True):
        wanted.setdefault(k, []).append((leg, height))
    corner = np.flatnonzero(np.isin(surface.spots.ravel(), np.unique(spot)))
    vertices, spots, patches = (
        x.ravel()[corner] for x in (surface.corners, surface.spots, np.repeat(surface.patch, 3))
    )
    for vertex, k, patch in np.unique(np.column_stack([vertices, spots, patches]), axis=0).tolist():
        for leg, height in wanted[k]:
            yield vertex, patch, leg, height
