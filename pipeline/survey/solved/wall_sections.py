"""Sections of passages where splays hit their walls, between stations and beyond the ends of passages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from minesurveys.frames import Source
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.solved.splay_hits import AT_STATION_M, ShotSplays, SplayHits

_APART_M = 0.15  # between sections, at least
_SHOULDER = 0.6  # of a section's height, up to which it is as wide as at its station
_STEEPER = 0.2  # rise over length of a splay more than that of another: it may hit the roof
_INSIDE_M = 0.1  # a wall so much nearer than one that a splay passed is no wall of the passage
_NEAR_M = 5.0  # along the survey, from a station without a measured wall to hits that it is interpolated between
_STEEPEST = 1.0  # rise over run, of the ways down from the floors of stations to what splays passed
_FADE_M = 2.0  # along the survey from a measured wall to an assumed one, at least


def with_hits(legs: list[SurveyLeg], hits: SplayHits, names: list[str]) -> list[SurveyLeg]:
    """Return legs with sections where splays hit their walls, also beyond ends; `names` are those of the nodes."""
    by_name: dict[tuple[str, str], ShotSplays] = {}
    for (a, b), found in hits.shots.items():
        run = float(np.linalg.norm((hits.places_m[b] - hits.places_m[a])[:2]))
        by_name[names[a], names[b]] = found
        by_name[names[b], names[a]] = found.turned(run)
    legs_at = Counter(name for leg in legs for pair in pairwise(leg.stations) for name in pair)
    ends = {name for name, count in legs_at.items() if count == 1}
    return [_with_hits(_with_faces(leg, by_name, ends), by_name) if _has_splays(leg, by_name) else leg for leg in legs]


def _has_splays(leg: SurveyLeg, shots: dict[tuple[str, str], ShotSplays]) -> bool:
    """Return whether splays say anything of a leg."""
    return not leg.is_plumb and any(pair in shots for pair in pairwise(leg.stations))


def _with_faces(leg: SurveyLeg, shots: dict[tuple[str, str], ShotSplays], ends: set[str]) -> SurveyLeg:
    """Return a leg that goes on to the farthest place that splays hit ahead of its ends."""
    for _ in range(2):
        before, last = leg.stations[-2:]
        step = leg.positions_m[-1] - leg.positions_m[-2]
        run = float(np.linalg.norm(step))
        found = shots.get((before, last), ShotSplays())
        ahead = max((hit.along_m - run for hit in found.hits), default=0.0) if last in ends else 0.0
        if ahead > AT_STATION_M:
            assert leg.heights_m is not None
            name = f"{last} and {ahead:.2f} m on"
            shots[last, name] = ShotSplays(
                [replace(hit, along_m=hit.along_m - run) for hit in found.hits if hit.along_m > run],
                [(along - run, aside, rise) for along, aside, rise in found.free if along > run],
            )
            shots[name, last] = shots[last, name].turned(ahead)
            known = leg.known[-1:].copy()
            known[:, :2] = Source.ASSUMED
            leg = replace(
                leg,
                stations=[*leg.stations, name],
                positions_m=np.concatenate([leg.positions_m, [leg.positions_m[-1] + ahead * step / run]]),
                walls_m=np.concatenate([leg.walls_m, leg.walls_m[-1:]]),
                heights_m=np.concatenate([leg.heights_m, leg.heights_m[-1:]]),
                sources=np.concatenate([leg.known, known]).astype(np.uint8),
                between=np.append(~leg.surveyed, True),
            )
        leg = _turned(leg)
    return leg


def _turned(leg: SurveyLeg) -> SurveyLeg:
    """Return a leg the other way round."""
    assert leg.heights_m is not None
    return replace(
        leg,
        stations=leg.stations[::-1],
        positions_m=leg.positions_m[::-1],
        walls_m=leg.walls_m[::-1, ::-1],
        heights_m=leg.heights_m[::-1],
        sources=leg.known[::-1, [1, 0, 2, 3]],
        between=~leg.surveyed[::-1],
    )


Knot = tuple[float, float, int]  # m along a leg in plan, m to the wall, and its source


def _with_hits(leg: SurveyLeg, shots: dict[tuple[str, str], ShotSplays]) -> SurveyLeg:
    """Return a leg with sections where splays hit its walls."""
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1)))
    walls, known = leg.walls_m.copy(), leg.known.copy()
    sides: list[list[Knot]] = []
    everywhere = [
        (at[k] + t, w, rise)
        for k, pair in enumerate(pairwise(leg.stations))
        for t, w, rise in shots.get(pair, ShotSplays()).free
        if 0 <= t <= at[k + 1] - at[k]
    ]
    free = np.array(everywhere).reshape(-1, 3)
    for side, sign in enumerate((1, -1)):
        hits = list[Knot]()
        for k, pair in enumerate(pairwise(leg.stations)):
            found, run = shots.get(pair, ShotSplays()), at[k + 1] - at[k]
            own = [(one.along_m, sign * one.aside_m, one.tilt) for one in found.hits if sign * one.aside_m > 0]
            hits += [(at[k] + t, w, Source.MEASURED) for t, w in _walls_of(own, run, not leg.surveyed[k + 1])]
        _fill(at, walls[:, side], known[:, side], hits, ~leg.surveyed)
        stations = [(s, w, int(o)) for s, w, o in zip(at.tolist(), walls[:, side], known[:, side], strict=True)]
        sides.append(list(_faded(sorted([*stations, *hits]))))
    floor = _floor_of(leg, at, free)
    extra = _apart(at, [*sides, floor])
    return _roofed(_refined(leg, at, extra, sides, floor, known), free)


def _floor_of(leg: SurveyLeg, at: np.ndarray, free: np.ndarray) -> list[Knot]:
    """Return how far the floor is down along a leg, so that it is not over places (n, 3) m that splays passed.

    The places are along the leg, to its left and over it. The floors of stations stay, as legs that meet share them;
    between them the floor goes down at 45 deg at most, and over places of steep shots it stays.
    """
    assert leg.heights_m is not None
    down = np.nan_to_num(leg.heights_m[:, 2])
    shot = np.searchsorted(at, free[:, 0]).clip(1, len(at) - 1) - 1
    is_flat = np.abs(np.diff(leg.heights_m[:, 0])) <= np.diff(at)
    low = free[is_flat[shot]][:, [0, 2]] * (1, -1)
    own = np.flatnonzero(leg.surveyed)
    near = own[np.abs(low[:, :1] - at[own]).argmin(axis=1)]
    apart = np.abs(low[:, 0] - at[near])
    low[:, 1] = np.minimum(low[:, 1], down[near] + _STEEPEST * apart)
    low, knots = low[apart >= _APART_M], sorted(zip(at.tolist(), down.tolist(), strict=True))
    while len(low):
        short = low[:, 1] - np.interp(low[:, 0], *np.array(knots).T)
        where, depth = low[short.argmax()].tolist()
        if short.max() < _INSIDE_M:
            break
        knots = sorted([*knots, (where, depth)])
        low = low[np.abs(low[:, 0] - where) >= _APART_M]
    return [(where, depth, int(Source.INTERPOLATED)) for where, depth in knots]


def _roofed(leg: SurveyLeg, free: np.ndarray) -> SurveyLeg:
    """Return a leg whose roofs that nobody measured are over places (n, 3) m in the free space.

    The places are along the leg, to its left and over it. Such a roof is no measured one: it is at least so high.
    """
    assert leg.heights_m is not None
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1)))
    down = np.nan_to_num(leg.heights_m[:, 2])
    least = np.full(len(at), np.nan)
    for along, aside, rise in free[free[:, 2] > 0]:
        left, right = (np.interp(along, at, leg.walls_m[:, side]) for side in (0, 1))
        half = max((left + right) / 2, _INSIDE_M)
        share = min(abs(aside - (left - right) / 2) / half, 1.0)
        over = np.interp(along, at, down)
        most = 1.0 - (1.0 - _SHOULDER) * max(0.0, 2 * share - 1.0)
        k = int(np.searchsorted(at, along).clip(1, len(at) - 1))
        for near in (k - 1, k):
            least[near] = np.fmax(least[near], (over + rise) / most - down[near])
    heights, sources = leg.heights_m.copy(), leg.known.astype(np.uint8)
    raised = np.isfinite(least) & (sources[:, 2] < Source.MEASURED)
    heights[raised, 1] = np.fmax(heights[raised, 1], least[raised])
    return replace(leg, heights_m=heights, sources=sources)


def _walls_of(hits: list[tuple[float, float, float]], run_m: float, is_face: bool) -> Iterator[tuple[float, float]]:
    """Yield where one side's wall is along a shot, and how far aside, of hits; the most level ones first count.

    One that is nearer than the wall that more level ones hit before and behind it is of the roof. At a face hits count
    up to the end of the shot.
    """
    taken: list[tuple[float, float, float]] = []
    most = run_m - _APART_M * (not is_face)
    for along, aside, tilt in sorted(hits, key=lambda one: one[2]):
        if not _APART_M <= along <= most or any(abs(along - other[0]) < _APART_M for other in taken):
            continue
        level = np.array([(t, w) for t, w, other in sorted(taken) if other < tilt - _STEEPER]).reshape(-1, 2).T
        if level.size and level[0, 0] < along < level[0, -1] and np.interp(along, *level) > aside + _INSIDE_M:
            continue
        taken.append((along, aside, tilt))
        yield along, aside


def _fill(at: np.ndarray, walls: np.ndarray, known: np.ndarray, hits: list[Knot], is_face: np.ndarray) -> None:
    """Fill in walls (n,) of stations that are assumed, of hits near them on either side; of a face, of the nearest."""
    knots = sorted(
        [(s, w) for s, w, o in zip(at, walls, known, strict=True) if o == Source.MEASURED]
        + [(s, w) for s, w, _ in hits]
    )
    if not knots:
        return
    where, width = np.array(knots).T
    for k in np.flatnonzero(known == Source.ASSUMED):
        before, after = where[where <= at[k]], where[where >= at[k]]
        near = [side for side in (at[k] - before[-1:], after[:1] - at[k]) if len(side) and side[0] <= _NEAR_M]
        if len(near) == 2 or is_face[k]:
            walls[k], known[k] = np.interp(at[k], where, width), Source.INTERPOLATED


def _faded(knots: list[Knot]) -> Iterator[Knot]:
    """Yield knots in order, with further ones where a measured wall ends on the way to an assumed one."""
    for one, two in pairwise(knots):
        yield one
        reach = max(_FADE_M, 2 * abs(one[1] - two[1]))
        if two[0] - one[0] > reach + _APART_M:
            if one[2] == Source.MEASURED and two[2] == Source.ASSUMED:
                yield one[0] + reach, two[1], Source.ASSUMED
            if two[2] == Source.MEASURED and one[2] == Source.ASSUMED:
                yield two[0] - reach, one[1], Source.ASSUMED
    yield knots[-1]


def _apart(at: np.ndarray, sides: list[list[Knot]]) -> list[float]:
    """Return where sections are between stations at some lengths (n,) along a leg, so that they are apart."""
    found: list[float] = []
    for where, _, _ in sorted((knot for knots in sides for knot in knots), key=lambda knot: -knot[2]):
        if np.abs(at - where).min() > _APART_M / 2 and all(abs(where - other) > _APART_M / 4 for other in found):
            found.append(where)
    return found


def _refined(
    leg: SurveyLeg, at: np.ndarray, extra: list[float], sides: list[list[Knot]], floor: list[Knot], known: np.ndarray
) -> SurveyLeg:
    """Return a leg with places between its stations at some lengths along it, and its floor as deep as stated."""
    assert leg.heights_m is not None
    where = np.sort(np.concatenate([at, extra]))
    row = np.searchsorted(at, where, side="right") - 1
    is_station = np.abs(at[row] - where) < 1e-9
    first, last = row.clip(max=len(at) - 2), row.clip(max=len(at) - 2) + 1
    share = ((where - at[first]) / (at[last] - at[first]))[:, None]
    positions = leg.positions_m[first] * (1 - share) + leg.positions_m[last] * share
    heights = leg.heights_m[first] * (1 - share) + leg.heights_m[last] * share
    heights[:, 2] = np.interp(where, *np.array(floor).T[:2])
    heights[is_station, :2] = leg.heights_m[row[is_station], :2]
    sources = np.minimum(known[first], known[last])
    sources = np.where(sources == Source.MEASURED, Source.INTERPOLATED, sources)
    wide = np.zeros((len(where), 2))
    for side in (0, 1):
        s, w, o = np.array(sides[side]).T
        wide[:, side] = np.interp(where, s, w)
        measured = np.abs(s[None] - where[:, None]).min(axis=1) < 1e-3
        nearest = np.abs(s[None] - where[:, None]).argmin(axis=1)
        ends = np.minimum(
            o[np.searchsorted(s, where, side="right").clip(1) - 1], o[np.searchsorted(s, where).clip(max=len(s) - 1)]
        )
        sources[:, side] = np.where(measured, o[nearest], np.minimum(ends, Source.INTERPOLATED))
    sources[is_station, 2:] = known[row[is_station], 2:]
    names = [
        leg.stations[k] if station else f"{leg.stations[k]} to {leg.stations[k + 1]} at {s - at[k]:.2f} m"
        for k, s, station in zip(row.tolist(), where.tolist(), is_station.tolist(), strict=True)
    ]
    return replace(
        leg,
        stations=names,
        positions_m=positions,
        walls_m=wide,
        heights_m=heights,
        sources=sources.astype(np.uint8),
        between=~(is_station & leg.surveyed[row]),
    )
