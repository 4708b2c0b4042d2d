"""How floors follow the survey: their heights along its legs, the steps between them, and what lies elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.height_field.leg_lines import drop, leg_floor_samples, way_samples
from pipeline.volume.height_field.overlapping_floors import SharedFloors
from pipeline.volume.height_field.section_floors import SectionFloors, is_leg
from pipeline.volume.mesh_edges import MeshEdges
from pipeline.volume.network import NEAR_M, SurveyNetwork
from pipeline.volume.slivers import SHORT_M
from pipeline.volume.union import STEEPEST, Solid, Volume, pieces_of

_SAMPLE_M = 0.25
_OFF_M = 0.01  # of the floor from the survey, and of a step: what is more is listed
_ABOVE_M = 0.1  # over a surveyed floor, from where the floor is looked for
_STEP_REACH_M = 0.05  # beyond the edge of a floor's facet, where the next floor is looked for
_STEP_MOST_M = 0.5  # a ledge that is higher is a wall
_OVER_M = 0.3  # over an edge, where it is free for a robot
ON_WALL_M = 0.005  # in rock: stations may be on a wall, which is where it was within 4 mm
_ENDS = (0.02, 0.98)  # of an edge, where its step is measured beside its middle
_ROUNDING = 1e-6  # of a slope
_TRACK_M = 0.25  # of wheels, beside a leg
_STOREY_M = 2.0  # between two floors that are over each other
_WAY_M = 0.5  # beside a surveyed floor: a robot that follows the leg drives there


@dataclass(frozen=True)
class FloorPlace:
    """Where something was measured: the legs, and the place, m, from the middle of the survey."""

    legs: str
    place_m: list[float]


@dataclass(frozen=True)
class FloorFigures:
    """How the floor follows the survey, m: largest and median error; largest step on the legs' ways, and elsewhere.

    A leg's way is what is within 0.5 m of its surveyed floor. Steps where legs meet and other steps are measured apart.
    `error_at` and `step_at` are where the largest error and the largest step of legs that meet are.
    """

    error_m: float  # without those that lie in another working
    median_m: float
    over_1cm: float  # share of the samples on the floor that are farther from it than 1 cm, without the same
    over_floor: float  # share of the legs' samples that have floor under them, the others are over other passages
    way_step_m: float  # on the way of a drivable leg
    step_m: float  # where legs meet
    other_step_m: float
    steep_share: float  # of the floor's area over 20 deg
    tracks_m: float  # 0.25 m beside the legs, over or under what the sections state: the largest
    steepest: float  # rise over run along the legs and 0.25 m beside them, where all sections state one floor
    share_built: float  # of all the surveyed length
    elsewhere: tuple[InOtherWorking, ...]
    elsewhere_share: float  # of the samples
    ledges: tuple[Ledge, ...]
    error_at: FloorPlace
    step_at: FloorPlace | None


@dataclass(frozen=True)
class InOtherWorking:
    """A leg that lies in the deeper working of another, so that the floor under it is the other's.

    `share` is that of the leg's samples, `off_m` the floor's largest height over the survey, which is at `place_m`.
    `is_assumed` says whether nobody measured the other's roof.
    """

    leg: str
    other: str
    share: float
    off_m: float
    place_m: list[float]
    is_assumed: bool


@dataclass(frozen=True)
class Ledge:
    """A step of more than 1 cm between the floors of two legs: the largest, its place, and the length of all edges.

    `meet` says whether the legs are near each other along the survey.
    """

    leg: str
    other: str
    step_m: float
    length_m: float
    place_m: list[float]
    meet: bool


def measure_floor(volume: Volume, network: SurveyNetwork) -> FloorFigures:
    """Measure the floor along the drivable legs, and the steps beside its facets.

    A place lies in another working if the section of another leg holds it, whose floor is deeper by more than 1 cm.
    There one floor cannot have both heights. Such places are listed where it is more than 1 cm off, or has a hole.
    Listed, too, but judged are places where a leg comes down to another that it meets: between both heights. On a facet
    too steep to drive on, a place is where the floor is within 3 mm seen from above, as far as slivers move a corner.
    """
    shots = np.flatnonzero(network.grades <= STEEPEST)
    places, owner = leg_floor_samples(network, shots, _SAMPLE_M)
    hit, height = drop(volume.vertices, volume.faces, places + np.array([0, 0, _ABOVE_M]))
    off = height - places[:, 2]
    pieces = pieces_of(network)
    floors = SectionFloors.of(network, pieces)
    section = _other_working(network, pieces, floors, places, owner)
    under, lower = SharedFloors(network, pieces, floors).descents.under(owner, places[:, :2])
    beyond = np.maximum(off, -off - under).clip(0)
    on_floor = (hit >= 0) & (volume.label[hit] == FacetLabel.FLOOR) & (beyond < _STEP_MOST_M)
    slope = _steepness(volume.normals[hit])
    beyond = (beyond - np.where(slope > STEEPEST, SHORT_M * slope, 0.0)).clip(0)
    other = np.where(section < 0, lower, section)
    listed = (hit >= 0) & (other >= 0) & (np.abs(off) > _OFF_M)
    judged = np.flatnonzero(on_floor & ~(listed & (section >= 0)))
    error, worst = beyond[judged], judged[beyond[judged].argmax()]
    ledges, steps, step_at = _steps(volume, network, places)
    area = np.linalg.norm(volume.normals, axis=1) * (volume.label == FacetLabel.FLOOR)
    steep = area[-volume.normals[:, 2] < np.cos(np.radians(20)) * area].sum()
    return FloorFigures(
        float(error.max()),
        float(np.median(error)),
        float((error > _OFF_M).mean()),
        float(on_floor.mean()),
        *steps,
        float(steep / area.sum()),
        *_tracks(volume, network, floors, shots),
        _share_built(volume, network),
        (*_in_other_working(network, places, owner, other, listed, off),),
        float(listed.mean()),
        ledges,
        _place(network, [owner[worst]], places[worst]),
        step_at,
    )


def _place(network: SurveyNetwork, legs: list[int], place: np.ndarray) -> FloorPlace:
    return FloorPlace(" and ".join(dict.fromkeys(map(network.leg_name, legs))), place.tolist())


def _tracks(volume: Volume, network: SurveyNetwork, floors: SectionFloors, shots: np.ndarray) -> tuple[float, float]:
    """Return how far the floor where wheels go is from what the sections of drivable legs state, and how steep it is.

    Sections may state several floors of one place, as where two legs part; between these the floor is as stated.
    """
    off, slope = [0.0], [0.0]
    for aside_m in (0.0, -_TRACK_M, _TRACK_M):
        places = leg_floor_samples(network, shots, _SAMPLE_M, aside_m)[0]
        hit, height = drop(volume.vertices, volume.faces, places + np.array([0, 0, _STEP_MOST_M]))
        on_floor = (hit >= 0) & (volume.label[hit] == FacetLabel.FLOOR) & (np.abs(height - places[:, 2]) < _STEP_MOST_M)
        place, piece = floors.over(shots, places, _STOREY_M, _STOREY_M)
        stated = floors.heights_at(piece, places[place, :2])
        near = np.abs(stated - places[place, 2]) < _STOREY_M
        low, high = places[:, 2].copy(), places[:, 2].copy()
        np.minimum.at(low, place[near], stated[near])
        np.maximum.at(high, place[near], stated[near])
        beyond = np.maximum(height - high, low - height)[on_floor]
        one = on_floor & (high - low < _OFF_M)
        off.append(float(beyond.max(initial=0.0)))
        slope.append(float(_steepness(volume.normals[hit[one]]).max(initial=0.0)))
    return max(off), max(slope)


def _steepness(normals: np.ndarray) -> np.ndarray:
    """Return the rise over run (n,) of floors' facets by their normals (n, 3), which point into the rock."""
    return np.asarray(np.hypot(normals[:, 0], normals[:, 1]) / np.maximum(-normals[:, 2], 1e-12))


def _share_built(volume: Volume, network: SurveyNetwork) -> float:
    """Return the share of the surveyed length that is in the free space."""
    places, owner = way_samples(network, _SAMPLE_M)
    inside = volume.inside.distance_m(places) > -ON_WALL_M
    weight = network.lengths_m[owner] / np.bincount(owner)[owner]
    return float(weight[inside].sum() / weight.sum())


def _other_working(
    network: SurveyNetwork, pieces: list[Solid], floors: SectionFloors, places: np.ndarray, owner: np.ndarray
) -> np.ndarray:
    """Return the leg (n,) in whose working each place lies, -1 for its own.

    A prism on a station is the working of the legs near it.
    """
    some = np.flatnonzero([not piece.is_plumb for piece in pieces])
    place, piece = floors.over(some, places, floors.tallest_m, 0.0)
    leg = np.array([one.shot for one in pieces])[piece]
    is_other = np.where(
        np.array([is_leg(one) for one in pieces])[piece],
        leg != owner[place],
        ~network.near_legs(NEAR_M).has(leg, owner[place]),
    )
    deeper = places[place, 2] - floors.heights_at(piece, places[place, :2])
    good = np.flatnonzero(is_other & (deeper > _OFF_M) & (deeper <= floors.tall_at(piece, places[place, :2])))
    good = good[np.argsort(deeper[good], kind="stable")]  # the deepest is last
    found = np.full(len(places), -1)
    found[place[good]] = leg[good]
    return found


def _in_other_working(
    network: SurveyNetwork,
    places: np.ndarray,
    owner: np.ndarray,
    other: np.ndarray,
    listed: np.ndarray,
    off: np.ndarray,
) -> Iterator[InOtherWorking]:
    """Return an entry for each pair of legs."""
    pairs, number = np.unique(np.column_stack([owner, other])[listed], axis=0, return_inverse=True)
    count = np.bincount(owner)
    for k, (leg, working) in enumerate(pairs.tolist()):
        these = np.flatnonzero(listed)[number == k]
        worst = these[np.argmax(np.abs(off[these]))]
        names = network.leg_name(leg), network.leg_name(working)
        is_assumed = bool(network.roof_assumed[working].any())
        share = len(these) / int(count[leg])
        yield InOtherWorking(*names, share, float(off[worst]), places[worst].tolist(), is_assumed)


def _steps(
    volume: Volume, network: SurveyNetwork, ways: np.ndarray
) -> tuple[tuple[Ledge, ...], tuple[float, float, float], FloorPlace | None]:
    """Return the steps over 1 cm, the largest, m: on the ways, where legs meet, elsewhere; and the place of the second.

    A step is from a floor's facet down or up to another floor 5 cm beyond its edge, the least between their planes on
    the way: floors that meet in a kink have none. Both facets are flat enough to drive on: where a ledge begins, the
    floor about its end is steeper, and no robot comes there. Legs meet that are within 5 m of each other along the
    survey.
    """
    floor = volume.label == FacetLabel.FLOOR
    drivable = _steepness(volume.normals) <= STEEPEST + _ROUNDING
    mesh = MeshEdges.of(volume)
    edges = np.column_stack([mesh.start, mesh.end, mesh.facet])[mesh.is_rim & floor[mesh.facet]]
    a, b = volume.vertices[edges[:, 0]], volume.vertices[edges[:, 1]]
    along = (b - a)[:, :2]
    length = np.linalg.norm(along, axis=1)
    keep = length > 0.02
    edges, a, b, along, length = (x[keep] for x in (edges, a, b, along, length))
    middle, third = (a + b) / 2, volume.vertices[volume.faces[edges[:, 2]]].mean(axis=1)
    out = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    out *= np.sign(np.sum(out * (middle - third)[:, :2], axis=1))[:, None]
    hit, step = _across(volume, floor, edges[:, 2], middle, out)
    for share in _ENDS:  # what is a wall at an end is the end of a wall
        step = np.maximum(step, _across(volume, floor, edges[:, 2], a + share * (b - a), out)[1])
    good = (hit >= 0) & (step < _STEP_MOST_M) & drivable[edges[:, 2]] & drivable[hit] & _open(volume, middle, out)
    shot = np.array([piece.shot for piece in volume.pieces])[volume.source]
    pairs = np.column_stack([shot[edges[good, 2]], shot[hit[good]]])
    step, length, middle = step[good], length[good], middle[good]
    on_way = cKDTree(ways).query(middle, distance_upper_bound=_WAY_M)[0] < _WAY_M
    meets = network.near_legs(NEAR_M).has(*pairs.T)
    ledges = []
    for leg, other in np.unique(np.sort(pairs[step > _OFF_M], axis=1), axis=0).tolist():
        these = np.flatnonzero((np.sort(pairs, axis=1) == (leg, other)).all(axis=1) & (step > _OFF_M))
        most = these[np.argmax(step[these])]
        names = network.leg_name(leg), network.leg_name(other)
        size = float(step[most]), float(length[these].sum())
        ledges.append(Ledge(*names, *size, middle[most].tolist(), bool(meets[most])))
    largest = [float(step[some].max(initial=0.0)) for some in (on_way, meets, ~meets)]
    worst = np.argmax(np.where(meets, step, -1.0)) if meets.any() else None
    at = None if worst is None else _place(network, pairs[worst].tolist(), middle[worst])
    return tuple(ledges), (largest[0], largest[1], largest[2]), at


def _across(
    volume: Volume, floor: np.ndarray, facet: np.ndarray, places: np.ndarray, out: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the floor (n,) beyond places on the edges of floors, -1 where none is, and the step (n,) m to it.

    Where free space goes deeper than `_STEP_MOST_M` the step is infinite.
    """
    beyond = places + np.column_stack([out * _STEP_REACH_M, np.full(len(out), _STEP_MOST_M)])
    hit, height = drop(volume.vertices, volume.faces, beyond)
    rise, next_rise = (_slope_along(volume.normals[k], out) * _STEP_REACH_M for k in (facet, hit))
    here, there = height - next_rise - places[:, 2], height - places[:, 2] - rise
    step = np.where(here * there < 0, 0.0, np.minimum(np.abs(here), np.abs(there)))
    over = places + np.column_stack([out * _STEP_REACH_M, np.full(len(out), _OVER_M)])
    free = (hit >= 0) & floor[hit] & volume.inside.rays_say_free(over)
    deep = (hit >= 0) & (height < places[:, 2] - _STEP_MOST_M)
    return np.where(free, hit, -1), np.where(free, step, np.where(deep, np.inf, 0.0))


def _open(volume: Volume, middle: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Return across which edges (n,) no wall stands between the two floors: the tip of a pillar is no step."""
    centre = volume.vertices.mean(axis=0)
    scene, way = ray_scene(volume.vertices - centre, volume.faces, 1), np.column_stack([out, np.zeros(len(out))])
    rays = np.column_stack([middle - centre - 1e-3 * way + np.array([0, 0, _OVER_M]), way]).astype(np.float32)
    return np.asarray(scene.cast_rays(rays, nthreads=1)["t_hit"].numpy() > _STEP_REACH_M)


def _slope_along(normals: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Return the rise over run (n,) of facets in horizontal directions (n, 2)."""
    return np.asarray(-np.sum(normals[:, :2] * out, axis=1) / np.minimum(normals[:, 2], -1e-12))
