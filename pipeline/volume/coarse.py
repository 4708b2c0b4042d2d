"""Floors with few facets: vertices go where the floor moves by less than a few millimetres."""

from __future__ import annotations

from dataclasses import dataclass, replace

import manifold3d
import numpy as np

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.facets.crossings import CROSSING_M, crosses_more
from pipeline.volume.height_field.plan_weights import second_and_third
from pipeline.volume.labelled_solid import keyed, near_facets, volume_of
from pipeline.volume.mesh_edges import MeshEdges, ranges
from pipeline.volume.union import Volume

_OFF_M = 0.01  # of the floor from where it was, in height
_LEG_OFF_M = 0.007  # of the floor from the survey along its legs, which may be 1 cm
_ASIDE_M = 0.002  # of a floor's rim in plan, and of the walls over it
_LOW_M = 0.01  # of a facet's height over its longest edge, at least
_LEVEL = 0.5  # of a floor facet's normal, at least; a steeper one is a ledge, which stays
_TURN = 0.95  # of the cosine between a wall facet's normals before and after
_OUTSIDE = -0.02  # of a weight in a facet: a place is in it or hardly beside it
_ROUNDS, _TRIES = 60, 3
_TOGETHER = 20_000  # vertices and where they may go
_GOING = np.dtype([("gone", int), ("stays", int), ("cost", float)])  # a vertex that becomes another


@dataclass(frozen=True)
class FloorSamples:
    """Heights (n,) m of a floor at places (n, 2) m seen from above, by how much it may be off, and the facets there."""

    places: np.ndarray
    heights: np.ndarray
    most_off: np.ndarray
    facets: np.ndarray


def coarse_floors(volume: Volume, hit: np.ndarray, weights: np.ndarray, surveyed: np.ndarray) -> Volume:
    """Return the volume without the vertices of floors that their shape does not need.

    The floor stays within 1 cm of its height at each vertex and middle of a facet, and within 7 mm of the survey along
    the legs. Its rim stays where it is in plan. A floor from which a wall goes down stays as it is along that wall.

    Parameters
    ----------
    volume : Volume
    hit : (n,) int64
        Facets under places along the legs.
    weights : (n, 3) float64
        Of the facets' corners at these places.
    surveyed : (n,) float64, m
        Heights of the surveyed floors there.
    """
    samples = _samples(volume, hit, weights, surveyed)
    kept = np.zeros(len(volume.faces), bool)
    before = volume.vertices, volume.faces
    for _ in range(_TRIES):
        found = _without_vertices(volume, samples, kept)
        crossing = crosses_more(found.vertices, found.faces, before, CROSSING_M)
        if not len(crossing):
            return found
        kept |= near_facets(volume.vertices[volume.faces], found.vertices[found.faces[crossing]], _OFF_M)
    return volume


def _samples(volume: Volume, hit: np.ndarray, weights: np.ndarray, surveyed: np.ndarray) -> FloorSamples:
    """Return the vertices and middles of floor facets, and the places along the legs.

    All of these: between every fifth, 25 cm apart, Wheal Pell's floor was 10 mm off the survey.
    """
    floor = np.flatnonzero(volume.label == FacetLabel.FLOOR)
    vertex, first = np.unique(volume.faces[floor], return_index=True)
    corners = volume.vertices[volume.faces]
    on_legs = np.einsum("nc,nck->nk", weights, corners[hit])
    places = np.concatenate([volume.vertices[vertex], corners[floor].mean(axis=1), on_legs])
    off = np.full(len(places), _OFF_M)
    legs = slice(len(places) - len(hit), None)
    off[legs] = np.maximum(_LEG_OFF_M, np.abs(places[legs, 2] - surveyed))
    places[legs, 2] = surveyed
    facets = np.concatenate([floor[first // 3], floor, hit])
    return FloorSamples(places[:, :2], places[:, 2], off, facets)


def _without_vertices(volume: Volume, samples: FloorSamples, kept: np.ndarray) -> Volume:
    mesh = _Floors(volume, samples, kept)
    for _ in range(_ROUNDS):
        if not mesh.thin_out():
            break
    used, faces = np.unique(mesh.faces[mesh.alive], return_inverse=True)
    vertices = volume.vertices[used]
    found = replace(
        volume,
        vertices=vertices,
        faces=faces.reshape(-1, 3),
        source=volume.source[mesh.alive],
        label=volume.label[mesh.alive],
    )
    one = keyed(found, vertices, found.label)
    return volume_of(one, volume) if one.solid.status() == manifold3d.Error.NoError else volume


@dataclass(frozen=True)
class _Settled:
    """Samples about vertices that go: the vertex's number, the new facet, and how far off as a share of the most."""

    number: np.ndarray
    sample: np.ndarray
    facet: np.ndarray
    share: np.ndarray


@dataclass(frozen=True)
class _Shape:
    """Of triangles: twice the area times the normal (n, 3), its size (n,), height (n,) m over the longest edge."""

    normal: np.ndarray
    size: np.ndarray
    height: np.ndarray


def _shape(corners: np.ndarray) -> _Shape:
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    size = np.sqrt((normal**2).sum(axis=1))
    longest = np.sqrt(np.maximum.reduce([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))]))
    return _Shape(normal, size, size / np.maximum(longest, 1e-30))


def _beside(places: np.ndarray, one: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return how far (n,) m vertices are from the line between two others, seen from above; inf if not between."""
    way, step = (places[b] - places[a])[:, :2], (places[one] - places[a])[:, :2]
    square = np.maximum((way**2).sum(axis=1), 1e-30)
    share = (way * step).sum(axis=1) / square
    off = np.abs(way[:, 0] * step[:, 1] - way[:, 1] * step[:, 0]) / np.sqrt(square)
    found: np.ndarray = np.where((share > 0) & (share < 1), off, np.inf)
    return found


class _Floors:
    """A closed mesh of which vertices of floors go: each becomes one of its neighbours."""

    def __init__(self, volume: Volume, samples: FloorSamples, kept: np.ndarray) -> None:
        """Begin with a volume's mesh; the vertices of `kept` facets stay."""
        self._places, self.faces = volume.vertices, volume.faces.copy()
        self.alive = np.ones(len(self.faces), bool)
        self._label, self._samples, self._of_sample = volume.label, samples, samples.facets.copy()
        normal, is_floor = volume.normals, volume.label == FacetLabel.FLOOR
        steep = is_floor & (-normal[:, 2] < _LEVEL * np.linalg.norm(normal, axis=1))
        self._may_go = np.zeros(len(self._places), bool)
        self._may_go[self.faces[is_floor]] = True
        self._may_go[self.faces[steep | kept]] = False
        self._may_go[self.faces[is_floor & self._over_drops()]] = False
        self._changed = np.ones(len(self._places), bool)  # beside a vertex: it is to be tried again
        self._known = np.zeros(0, _GOING)

    def _over_drops(self) -> np.ndarray:
        """Return the facets (f,) at the ends of edges from which a wall goes down: a floor's slope is a step there."""
        edges = MeshEdges(self.faces, np.flatnonzero(self.alive), self._label, len(self._places))
        height = self._places[:, 2]
        hangs = edges.is_rim & (self._label[edges.facet] != FacetLabel.FLOOR)
        hangs &= height[edges.third] < np.minimum(height[edges.start], height[edges.end]) - _OFF_M
        over = np.zeros(len(self._places), bool)
        over[edges.start[hangs]] = over[edges.end[hangs]] = True
        found: np.ndarray = over[self.faces].any(axis=1)
        return found

    def thin_out(self) -> int:
        """Let vertices go that are not beside each other, those first that move the floor least; return how many."""
        edges = MeshEdges(self.faces, np.flatnonzero(self.alive), self._label, len(self._places))
        order = np.argsort(self._of_sample, kind="stable")
        self._by_facet = order, np.searchsorted(self._of_sample[order], np.arange(len(self.faces) + 1))
        tries = self._tries(edges)
        cost = np.full(len(tries), np.inf)
        for start in range(0, len(tries), _TOGETHER):
            cost[start : start + _TOGETHER] = self._cost(edges, tries[start : start + _TOGETHER])
        known = self._known[~self._changed[self._known["gone"]]]
        found = np.zeros(int((cost <= 1).sum()), _GOING)
        found["gone"], found["stays"] = edges.start[tries[cost <= 1]], edges.end[tries[cost <= 1]]
        found["cost"] = cost[cost <= 1]
        self._known = np.sort(np.concatenate([known, found]), order=("cost", "gone", "stays"))
        chosen, beside = edges.apart(edges.find(self._known["gone"], self._known["stays"]))
        self._changed[:] = False
        self._changed[beside] = self._changed[edges.start[chosen]] = True
        self._collapse(edges, chosen)
        return len(chosen)

    def _tries(self, edges: MeshEdges) -> np.ndarray:
        """Return the edges along which a vertex may go: within floors, or along their straight rims."""
        rims = np.bincount(edges.start[edges.is_rim], minlength=len(self._places))
        found = np.flatnonzero((self._may_go & self._changed)[edges.start] & ((rims[edges.start] == 0) | edges.is_rim))
        found = found[rims[edges.start[found]] <= 2]
        number, edge = edges.around(found)
        both = edges.find(edges.end[found[number]], edges.end[edge]) >= 0
        found = found[np.bincount(number[both], minlength=len(found)) == 2]
        number, edge = edges.around(found)
        other = edges.is_rim[edge] & (edge != found[number])
        gone, stays, next_one = edges.start[edge[other]], edges.end[found[number[other]]], edges.end[edge[other]]
        bent = number[other][_beside(self._places, gone, stays, next_one) > _ASIDE_M]
        return np.delete(found, bent[edges.is_rim[found[bent]]])

    def _cost(self, edges: MeshEdges, tries: np.ndarray) -> np.ndarray:
        """Return what share (n,) of what is allowed the floor is off without a vertex; inf where facets turn over."""
        number, corners, facet, is_floor = self._new_facets(edges, tries)
        bad = self._turned(corners, facet, is_floor)
        bad[~is_floor] |= self._off_walls(edges, tries, number[~is_floor], corners[~is_floor])
        cost = np.zeros(len(tries))
        cost[number[bad]] = np.inf
        fits = np.flatnonzero(cost == 0)
        number, corners, facet, is_floor = self._new_facets(edges, tries[fits])
        settled = self._settle(edges, tries[fits], number[is_floor], corners[is_floor], facet[is_floor])
        np.maximum.at(cost, fits[settled.number], settled.share)
        return cost

    def _new_facets(self, edges: MeshEdges, tries: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return for the facets that change their try, their new corners (n, 3), their number, and which are floor."""
        number, edge = edges.around(tries)
        stays = edges.end[tries[number]]
        changes = (edges.end[edge] != stays) & (edges.third[edge] != stays)
        number, edge = number[changes], edge[changes]
        corners = np.column_stack([stays[changes], edges.end[edge], edges.third[edge]])
        facet = edges.facet[edge]
        return number, corners, facet, self._label[facet] == FacetLabel.FLOOR

    def _turned(self, corners: np.ndarray, facet: np.ndarray, is_floor: np.ndarray) -> np.ndarray:
        """Return which new facets (n,) turn over or are low."""
        new, old = (_shape(self._places[c]) for c in (corners, self.faces[facet]))
        low = new.height < np.where(is_floor, _LOW_M, np.minimum(_LOW_M, old.height))
        level = -new.normal[:, 2] > _LEVEL * new.size
        same = (new.normal * old.normal).sum(axis=1) > _TURN * new.size * old.size
        found: np.ndarray = low | ~np.where(is_floor, level, same)
        return found

    def _off_walls(self, edges: MeshEdges, tries: np.ndarray, number: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Return which new facets (n,) of walls have a corner of the old ones off their plane."""
        new = _shape(self._places[corners])
        row, edge = edges.around(tries[number])
        wall = self._label[edges.facet[edge]] != FacetLabel.FLOOR
        row, edge = row[wall], edge[wall]
        found = np.zeros(len(number), bool)
        for vertex in (edges.start[edge], edges.end[edge], edges.third[edge]):
            step = self._places[vertex] - self._places[corners[row, 0]]
            off = np.abs((step * new.normal[row]).sum(axis=1)) > _ASIDE_M * new.size[row]
            found[row[off]] = True
        return found

    def _settle(
        self, edges: MeshEdges, tries: np.ndarray, number: np.ndarray, corners: np.ndarray, facet: np.ndarray
    ) -> _Settled:
        """Find the new facet that each sample about the vertices lies in."""
        order, first = self._by_facet
        of_try, edge = edges.around(tries)
        row, at = ranges(first[edges.facet[edge]], first[edges.facet[edge] + 1])
        of_try, sample = of_try[row], order[at]
        starts = np.searchsorted(number, np.arange(len(tries) + 1))
        row, new = ranges(starts[of_try], starts[of_try + 1])
        v, w = second_and_third(self._places[corners], new, self._samples.places[sample[row]])
        inside = np.minimum(np.minimum(v, w), 1 - v - w)
        best = _first_largest(row, inside)
        v, w, sample, new = v[best], w[best], sample[row[best]], new[best]
        weights = np.column_stack([1 - v - w, v, w])
        off = (weights * self._places[corners[new], 2]).sum(axis=1) - self._samples.heights[sample]
        share = np.abs(off) / self._samples.most_off[sample]
        share[inside[best] < _OUTSIDE] = np.inf
        return _Settled(of_try[row[best]], sample, facet[new], share)

    def _collapse(self, edges: MeshEdges, chosen: np.ndarray) -> None:
        number, corners, facet, is_floor = self._new_facets(edges, chosen)
        settled = self._settle(edges, chosen, number[is_floor], corners[is_floor], facet[is_floor])
        self._of_sample[settled.sample] = settled.facet
        self.alive[edges.facet[edges.around(chosen)[1]]] = False
        self.faces[facet], self.alive[facet] = corners, True


def _first_largest(row: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return where the largest value of each run of equal numbers stands, the first of equals."""
    starts = np.flatnonzero(np.diff(row, prepend=-1))
    if not len(starts):
        return starts
    largest = np.maximum.reduceat(values, starts)
    at = np.flatnonzero(values == np.repeat(largest, np.diff(starts, append=len(row))))
    found: np.ndarray = at[np.unique(row[at], return_index=True)[1]]
    return found
