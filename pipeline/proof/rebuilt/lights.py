"""Place a world's lights again along its lines, by the distance that its own lights show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ArtifactError
from pipeline.geometry.polyline import arc_length
from pipeline.mjcf.scene import SpotLight, place_lights

_NEAR_M = 0.002  # in plan, of a light from its line: places have three decimals
_TRIED = range(-4, 5)  # of a distance that is read off two rounded places, in mm
_LENGTH = 1e-4
_LEAST_M, _LONGEST_M = 0.5, 1e9  # distances
_HIGHEST_M = 1000.0
_WIDEST_DEG = 90.0
_ON_FLOOR_M = 1e-9  # height of lights on the floor, which other heights are read off
_MOST = 100  # lights of a line that a configuration can state
_LINES = 3  # the longest ones, whose lights show their distance best
_HALVED = 60
_DIGITS = 3


def remake_lights(
    model: Path, stated: Sequence[SpotLight], choices: Iterable[list[np.ndarray]], off_m: float, turned: float
) -> list[SpotLight]:
    """Return the lights as the builder places them along one of several choices of lines.

    Pitch and cut-off angle are those of the first light, the height is the largest over the floor, and the distance is
    read off the lights of one line: in whole millimetres, if those give the places. Places in plan and directions are
    the stated ones where they are near enough.

    Parameters
    ----------
    model : Path
        For messages.
    stated : sequence of SpotLight
    choices : iterable of lists of (n, 4) m, mine frame
        Lines as `place_lights` takes them.
    off_m, turned : float
        How far a place and each number of a direction may be off.

    Raises
    ------
    ArtifactError
        If they are not over the floor, look up, or no distance along any choice gives their places.
    """
    if not stated:
        return []
    places, ways = (np.array([getattr(light, name) for light in stated]) for name in ("place_m", "direction"))
    if not (np.abs(np.linalg.norm(ways, axis=1) - 1) <= _LENGTH).all():
        raise ArtifactError(f"{model}: a light whose direction has not the length 1")
    cutoff, pitch = stated[0].cutoff_deg, math.degrees(math.asin(min(1.0, max(-1.0, -float(ways[0, 2])))))
    if not (pitch >= 0 and 0 < cutoff <= _WIDEST_DEG):
        raise ArtifactError(
            f"{model}: lights look up by {-pitch:.1f} deg, or are {cutoff:g} deg wide; want 0 to 90 deg down and at "
            f"most {_WIDEST_DEG:g} deg"
        )
    best = _LONGEST_M
    for lines in choices:
        for spacing, most in dict.fromkeys(_spacings(lines, places[:, :2])):
            on_floor = place_lights(lines, spacing, _ON_FLOOR_M, pitch, cutoff, most)
            if len(on_floor) != len(stated):
                continue
            height = float((places[:, 2] - [light.place_m[2] for light in on_floor]).max()) + _ON_FLOOR_M
            if not 0 < height <= _HIGHEST_M:
                continue
            made = place_lights(lines, spacing, height, pitch, cutoff, most)
            off = float(np.linalg.norm(np.array([light.place_m for light in made]) - places, axis=1).max())
            turns = np.abs(np.array([light.direction for light in made]) - ways)
            best = min(best, off)
            if off <= off_m and turns.max() <= turned and turns[:, 2].max() <= _LENGTH:
                return [_in_plan(one, light) for one, light in zip(stated, made, strict=True)]
    raise ArtifactError(
        f"{model}: {len(stated)} lights: not at even distances along the drifts, at one height, and along them (the "
        f"best even distance leaves {best:.3f} m, want at most {off_m:g} m)"
    )


def _in_plan(stated: SpotLight, made: SpotLight) -> SpotLight:
    """Return a light where it is stated in plan: its line's distance was read off rounded places."""
    return replace(made, place_m=(*stated.place_m[:2], made.place_m[2]), direction=stated.direction)


def _spacings(lines: list[np.ndarray], found: np.ndarray) -> Iterator[tuple[float, int | None]]:
    """Yield distances and greatest numbers a line that lights at places (n, 2) m may have been placed with."""
    lengths = np.array([float(arc_length(line[:, :2])[-1]) for line in lines])
    if not lines:
        return
    if len(found) == len(lines):  # one light a line: its middle, whatever the distance
        yield float(lengths.max()) + 1.0, None
    for most in (None, *range(2, _MOST + 1)):
        numbers = _numbers(lengths, len(found), most)
        if numbers is None or numbers.max() < (most or 2):
            continue
        first = np.concatenate([[0], np.cumsum(numbers)])
        longest = np.argsort(-numbers, kind="stable")[:_LINES]
        for line in longest[numbers[longest] > 1].tolist():
            for spacing in _spacings_along(lines[line], found[first[line] : first[line + 1]]):
                if _counts(lengths, spacing, most).sum() == len(found):
                    yield spacing, most


def _numbers(lengths: np.ndarray, total: int, most: int | None) -> np.ndarray | None:
    """Return how many lights lines of these lengths (n,) m have, at most so many each, if they have a number in all.

    There is one answer: no line has more lights at a longer distance.
    """
    low, high = _LEAST_M, float(lengths.max()) + 1.0
    for _ in range(_HALVED):
        spacing = (low + high) / 2
        numbers = _counts(lengths, spacing, most)
        if numbers.sum() == total:
            return numbers
        low, high = (spacing, high) if numbers.sum() > total else (low, spacing)
    return None


def _counts(lengths: np.ndarray, spacing: float, most: int | None) -> np.ndarray:
    """Return how many lights lines of these lengths (n,) m have at a distance, m, at most so many each."""
    counts = (lengths // spacing).astype(np.int64) + 1
    return counts if most is None else np.minimum(counts, most)


def _spacings_along(line: np.ndarray, found: np.ndarray) -> Iterator[float]:
    """Yield the distances at which lights at places (n, 2) m may stand along a line (k, 4) m: n is 2 or more."""
    along = arc_length(line[:, :2])
    for place in found[[0, -1]]:
        begin, step = line[:-1, :2], np.diff(line[:, :2], axis=0)
        share = ((place - begin) * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), _ON_FLOOR_M)
        share = share.clip(0, 1)
        near = np.linalg.norm(begin + share[:, None] * step - place, axis=1) <= _NEAR_M
        for distance in np.unique((along[:-1] + share * np.diff(along))[near].round(_DIGITS + 1)).tolist():
            spacing = abs(along[-1] - 2 * distance) / (len(found) - 1)
            whole = {round(spacing + more / 1000, _DIGITS) for more in _TRIED}
            yield from (one for one in [*sorted(whole, key=lambda one: abs(one - spacing)), spacing] if one > _LEAST_M)
