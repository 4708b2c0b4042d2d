"""Solids through the sections of legs that follow each other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import manifold3d
import numpy as np

from pipeline.geometry.facets.crossings import CROSSING_M, crossing_facets

_LEAST_STEP_M = 1.0  # between sections along a leg, which is cut into pieces as long as wide: their triangles are good
_OVERLAP_M = 0.01  # of hulls that follow each other: solids that only touch are what booleans are worst at


@dataclass(frozen=True)
class Tube:
    """Rows of sections (n, k, 3), each row's first the last of the row before, and the number of each row's piece."""

    sections: list[np.ndarray]
    shots: list[int]

    def some(self, start: int, end: int) -> Tube:
        """Return the tube of some of the rows."""
        return Tube(self.sections[start:end], self.shots[start:end])

    def mesh(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return its vertices (v, 3) m, facets (f, 3), and where the facets of each row begin and the last's end."""
        rings = np.concatenate([self.sections[0], *(row[1:] for row in self.sections[1:])])
        count, k = len(rings), rings.shape[1]
        i, j = np.arange(k), (np.arange(k) + 1) % k
        wall = np.concatenate([np.column_stack([i, j + k, j]), np.column_stack([i, i + k, j + k])])
        cap = np.column_stack([np.zeros(k - 2, int), np.arange(1, k - 1), np.arange(2, k)])
        faces = [wall + k * n for n in range(count - 1)]
        faces[0] = np.concatenate([cap, faces[0]])
        faces[-1] = np.concatenate([faces[-1], cap[:, ::-1] + k * (count - 1)])
        ends = np.cumsum([len(row) - 1 for row in self.sections])
        sizes = np.cumsum([0, *map(len, faces)])
        return rings.reshape(-1, 3), np.concatenate(faces), sizes[[0, *ends]]


def sections_between(sections: np.ndarray, lrud: np.ndarray) -> np.ndarray:
    """Return the two sections (2, k, 3) with others between them, as far apart as the leg is wide."""
    length = float(np.linalg.norm(sections.mean(axis=1)[1] - sections.mean(axis=1)[0]))
    count = max(1, round(length / max(_LEAST_STEP_M, float(lrud[:, :2].sum(axis=1).max()))))
    share = np.linspace(0, 1, count + 1)[:, None, None]
    return np.asarray(sections[0] * (1 - share) + sections[1] * share)


def sections_along(sections: np.ndarray, lrud: np.ndarray) -> np.ndarray:
    """Return sections (n, k, 3) with others between each and the next."""
    rows = [sections_between(np.stack(pair), lrud) for pair in pairwise(sections)]
    return np.concatenate([rows[0], *(row[1:] for row in rows[1:])])


def solids_through(tubes: list[Tube], numbers: dict[int, int]) -> list[manifold3d.Manifold]:
    """Return the solids through tubes; enter the number of each piece by manifold3d's.

    Legs that would cross others of their tube, as between skew sections of different widths, are the hulls of their
    sections.
    """
    found = []
    for tube, crossing in zip(tubes, _crossing_rows(tubes), strict=True):
        found += _parted(tube, numbers, crossing) if crossing else [_solid(tube, numbers)]
    return found


def _crossing_rows(tubes: list[Tube]) -> list[set[int]]:
    """Return of each tube the rows whose facets cross others of it."""
    if not tubes:
        return []
    vertices, faces, runs = zip(*(tube.mesh() for tube in tubes), strict=True)
    first = np.cumsum([0, *map(len, vertices)])
    tube = np.repeat(np.arange(len(tubes)), [*map(len, faces)])
    start = np.cumsum([0, *map(len, faces)])
    joined = np.concatenate(faces) + first[tube][:, None]
    found = [set[int]() for _ in tubes]
    for facet in np.unique(crossing_facets(np.concatenate(vertices), joined, CROSSING_M, of=tube)).tolist():
        k = int(tube[facet])
        found[k].add(int(np.searchsorted(runs[k], facet - start[k], side="right")) - 1)
    return found


def _solid(tube: Tube, numbers: dict[int, int]) -> manifold3d.Manifold:
    """Return the solid through a tube that does not cross itself; enter its numbers."""
    vertices, faces, runs = tube.mesh()
    first = manifold3d.Manifold.reserve_ids(len(tube.shots))
    numbers |= {first + n: shot for n, shot in enumerate(tube.shots)}
    mesh = manifold3d.Mesh64(
        vertices,
        faces.astype(np.uint64),
        run_index=3 * runs,
        run_original_id=first + np.arange(len(tube.shots)),
    )
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError:
        raise ValueError(f"volume: legs {tube.shots}: {solid.status()}")
    return solid


def _parted(tube: Tube, numbers: dict[int, int], crossing: set[int]) -> list[manifold3d.Manifold]:
    """Return the hulls of the legs that cross others of their tube, and the tubes between them."""
    found, start = [], 0
    for n in [*sorted(crossing), len(tube.shots)]:
        if n > start:
            found += solids_through([tube.some(start, n)], numbers)
        found += _hulls(tube.some(n, n + 1), numbers)
        start = n + 1
    return found


def _hulls(tube: Tube, numbers: dict[int, int]) -> list[manifold3d.Manifold]:
    """Return the hulls of sections that follow each other, a little longer than these, so that they overlap."""
    found = []
    for row, shot in zip(tube.sections, tube.shots, strict=True):
        for one, two in pairwise(row):
            ahead = two.mean(axis=0) - one.mean(axis=0)
            ahead *= _OVERLAP_M / max(float(np.linalg.norm(ahead)), _OVERLAP_M)
            found.append(manifold3d.Manifold.hull_points(np.concatenate([one - ahead, two + ahead])).as_original())
            numbers[found[-1].original_id()] = shot
    return found
