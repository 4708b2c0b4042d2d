"""The part of a mine that bodies are thrown in, if the whole has too many collision parts for one model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Label, Volume

_REACH_M = 4.0  # a robot at 3 m/s goes 2.4 m in a throw


@dataclass(frozen=True)
class Region:
    """Collision parts about a place, and which facets (f,) are so far inside that bodies before them meet no others."""

    parts: list[ShellPart]
    targets: np.ndarray


def region_of(volume: Volume, parts: list[ShellPart], most: int, rng: np.random.Generator) -> Region:
    """Return the `most` parts nearest to a floor that is drawn at random, or all if there are no more."""
    if len(parts) <= most:
        return Region(parts, np.ones(len(volume.faces), bool))
    triangles = volume.vertices[volume.faces]
    area = np.linalg.norm(volume.normals, axis=1) * (volume.label == Label.FLOOR)
    middle = triangles[rng.choice(len(area), p=area / area.sum())].mean(axis=0)
    spans = np.array([(part.corners.min(axis=0), part.corners.max(axis=0)) for part in parts])
    apart = np.maximum(spans[:, 0] - middle, middle - spans[:, 1]).max(axis=1)  # of a box about the place
    order = np.argsort(apart, kind="stable")
    radius = float(apart[order[most]])
    inside = np.abs(triangles - middle).max(axis=(1, 2)) < radius - _REACH_M
    return Region([parts[k] for k in order[:most]], inside)
