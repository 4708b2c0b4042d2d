"""Shots that follow each other: which chains go on in another, and how the sections of each stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.survey.passages.sections import sections_of

_INSIDE = 0.8  # of a shot's length that bends may take from its inner wall
_NO_AREA_M2 = 1e-12
_NO_RUN_M = 1e-3
_DIGITS = 6  # of a metre, in sections that are compared, as worlds state them
_PLUMB = np.tan(np.radians(5.0))  # run over rise: no bearing is read along such a shot, and none can be computed


@dataclass(frozen=True)
class Chain:
    """Stations that follow each other, by number, their places (n, 3) m, sections (n, 4) m, and how these are known."""

    stations: list[int]
    places_m: np.ndarray
    lrud_m: np.ndarray
    known: np.ndarray

    def reversed(self) -> Chain:
        """Return the chain the other way round."""
        sections = (rows[::-1, [1, 0, 2, 3]] for rows in (self.lrud_m, self.known))
        return Chain(self.stations[::-1], self.places_m[::-1], *sections)

    def followed_by(self, other: Chain) -> Chain:
        """Return the chain and one that begins where it ends; the higher of their roofs counts there."""
        lrud = np.concatenate([self.lrud_m[:-1], np.maximum(self.lrud_m[-1:], other.lrud_m[:1]), other.lrud_m[1:]])
        places = np.concatenate([self.places_m, other.places_m[1:]])
        known = np.concatenate([self.known, other.known[1:]])
        return Chain(self.stations + other.stations[1:], places, lrud, known)


def continued(chains: list[Chain]) -> list[Chain]:
    """Return the chains; two that end at a station are one if they have a section there that no other leg has.

    A passage that was measured goes on in legs that nobody measured: two tubes would have a gap where it bends. Of a
    section count the walls and the floor. However legs are parted into chains, the same go on.
    """
    found, ending = dict(enumerate(chains)), dict[tuple[int, float, float, float], list[int]]()
    for number, chain in found.items():
        rounded = chain.lrud_m.round(_DIGITS).tolist()
        for k, (station, (left, right, _, down)) in enumerate(zip(chain.stations, rounded, strict=True)):
            legs = [number] * ((k > 0) + (k < len(chain.stations) - 1))
            ending.setdefault((station, min(left, right), max(left, right), down), []).extend(legs)
    of = list(found)  # by number, that of the chain that it is a part of now
    for (station, *_), ends in ending.items():
        one, other = (of[number] for number in ends) if len(ends) == 2 else (0, 0)
        if one == other:
            continue
        first, second = found[one], found[other]
        if first.stations[0] == station:
            one, other, first, second = other, one, second, first
        if first.stations[-1] != station:
            first = first.reversed()
        if second.stations[0] != station:
            second = second.reversed()
        if not (first.lrud_m[-1] - second.lrud_m[0])[:2].round(_DIGITS).any():
            found[one] = first.followed_by(second)
            del found[other]
            of = [one if number == other else number for number in of]
    return list(found.values())


def sections_of_chains(chains: list[Chain]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return for each chain what is to the left (n - 1, 2, 2) at both ends of each shot, and which stations share that.

    A shot within 5 deg of plumb has no direction of its own: two that meet would lie on both sides of a wall that they
    share. It takes that of the shot before it in its chain, else of the one after. Where a chain has no other shots, it
    is that of a leg that it meets, by the section there; north is ahead where there is none.
    """
    found = [_sections(chain.places_m, chain.lrud_m[:, :2]) for chain in chains]
    lefts = [_lefts(chain.places_m) for chain in chains]
    beside: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for chain, left in zip(chains, lefts, strict=True):
        for k in np.flatnonzero(np.isfinite(left[:, 0])).tolist():
            for end in (k, k + 1):
                beside.setdefault(chain.stations[end], []).append((left[k], chain.lrud_m[end, :2]))
    for chain, (across, _), left in zip(chains, found, lefts, strict=True):
        directed = np.flatnonzero(np.isfinite(left[:, 0]))
        first = left[directed[0]] if len(directed) else _met(chain, beside)
        for k in np.flatnonzero(np.isnan(left[:, 0])).tolist():
            left[k] = left[k - 1] if k else first
            across[k] = left[k]
    return found


def _lefts(at: np.ndarray) -> np.ndarray:
    """Return the unit vectors (n - 1, 2) to the left of the shots between places (n, 3); NaN of shots near plumb."""
    step = np.diff(at, axis=0)
    run = np.linalg.norm(step[:, :2], axis=1, keepdims=True)
    left = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(run, _NO_RUN_M)
    return np.where(run > np.maximum(_PLUMB * np.abs(step[:, 2:]), _NO_RUN_M), left, np.nan)


def _met(chain: Chain, beside: dict[int, list[tuple[np.ndarray, np.ndarray]]]) -> np.ndarray:
    """Return the left (2,) of a chain of plumb shots: that of the first leg it meets, turned as their sections are."""
    for station, walls in zip(chain.stations, chain.lrud_m[:, :2], strict=True):
        for left, theirs in beside.get(station, []):
            return left if np.abs(walls - theirs).sum() <= np.abs(walls - theirs[::-1]).sum() else -left
    return np.array([0.0, 1.0])


def _sections(at: np.ndarray, walls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vectors to the left (n - 1, 2, 2) at both ends of each shot of a chain, and which stations share one.

    Shots share a section as `sections_of` has it, if that leaves a length to both walls. Steep shots have their own.
    """
    step = np.diff(at[:, :2], axis=0)
    run = np.linalg.norm(step, axis=1)
    steep = np.abs(np.diff(at[:, 2])) > run
    may_share = np.zeros(len(at), bool)
    lost = np.zeros(len(step))  # of each shot's length, at the wall on the inside of its bends
    for k in range(1, len(step)):
        both, chord = slice(k - 1, k + 1), at[k + 1, :2] - at[k - 1, :2]
        area = np.abs(step[both, 0] * chord[1] - step[both, 1] * chord[0])
        short = walls[k].max() * area / np.maximum(run[both] * np.hypot(*chord), _NO_AREA_M2)
        if not steep[both].any() and (lost[both] + short < _INSIDE * run[both]).all():
            may_share[k] = True
            lost[both] += short
    return sections_of(at[:, :2], walls, may_share)
