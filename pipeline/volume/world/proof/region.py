"""The parts of a mine that bodies are thrown in, if the whole has too many collision parts for one model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.rock.ragged import parts_of
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume

_REACH_M = 4.0  # a robot at 3 m/s goes 2.4 m in a throw


@dataclass(frozen=True)
class Region:
    """Collision parts about a place, and which facets (f,) are so far inside that bodies before them meet no others."""

    parts: list[ShellPart]
    targets: np.ndarray


def region_of(volume: Volume, parts: list[ShellPart], most: int, rng: np.random.Generator) -> Region:
    """Return the `most` parts nearest to a floor that is drawn at random, or all if there are no more.

    Where these reach so little that no facet is a target, as in a scan of small facets, there are more.
    """
    if len(parts) <= most:
        return Region(parts, np.ones(len(volume.faces), bool))
    area = np.linalg.norm(volume.normals, axis=1) * (volume.label == FacetLabel.FLOOR)
    about, facet = _PartsAbout(volume, parts), int(rng.choice(len(area), p=area / area.sum()))
    while not (found := about.region(facet, most)).targets.any():
        most *= 2
    return found


def regions_over(volume: Volume, parts: list[ShellPart], most: int) -> Iterator[Region]:
    """Return regions of about `most` parts in which each facet is a target once.

    A region is about the first facet that was in none; where this one is too large for it, it has more parts.
    """
    about, left = _PartsAbout(volume, parts), np.ones(len(volume.faces), bool)
    while left.any():
        facet, count = int(left.argmax()), most
        found = about.region(facet, count)
        while not found.targets[facet]:
            count *= 2
            found = about.region(facet, count)
        yield Region(found.parts, found.targets & left)
        left &= ~found.targets


def parts_about(boxes_m: tuple[np.ndarray, np.ndarray], ways_m: np.ndarray, about_m: float | np.ndarray) -> np.ndarray:
    """Return the parts (k,) whose boxes, least and greatest corners (p, 3) m, come near ways (n, w, 3) m."""
    (low, high), near = boxes_m, np.zeros(len(boxes_m[0]), bool)
    for way in ways_m:
        near |= ((low < way.max(axis=0) + about_m) & (high > way.min(axis=0) - about_m)).all(axis=1)
    return np.flatnonzero(near)


class _PartsAbout:
    """The parts and facets of a volume by their distance from a place: half the edge of the box about it."""

    def __init__(self, volume: Volume, parts: list[ShellPart]) -> None:
        """Take the boxes of parts."""
        self._parts, self._corners = parts, volume.vertices[volume.faces]
        self._low, self._high = parts_of([part.corners for part in parts]).boxes_m

    def region(self, facet: int, most: int) -> Region:
        """Return the `most` parts nearest to the middle of a facet, or all if there are no more."""
        if len(self._parts) <= most:
            return Region(self._parts, np.ones(len(self._corners), bool))
        middle = self._corners[facet].mean(axis=0)
        apart = np.maximum(self._low - middle, middle - self._high).max(axis=1)
        order = np.argsort(apart, kind="stable")
        inside = np.abs(self._corners - middle).max(axis=(1, 2)) < float(apart[order[most]]) - _REACH_M
        return Region([self._parts[k] for k in order[:most]], inside)
