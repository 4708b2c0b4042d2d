"""The mesh of the rough surface: every point of the lattice, or fewer where faces are flat."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import fast_simplification
import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import GeometryError

_DIGITS = 4  # 0.1 mm, as the lattice's points
_LEAST_FACES = 64  # a tile with fewer is kept as it is


@dataclass(frozen=True)
class Simplification:
    """Keep about a share of the lattice's faces, tile by tile; points on the borders of tiles and the floor stay."""

    kept_share: float
    tile_m: float


@dataclass(frozen=True)
class SurfaceMesh:
    """A mesh over a lattice: `vertices` (k, 3) m, `faces` (m, 3), `piece` (m,) as the lattice's.

    `source` (k,) is the number of the lattice point that is nearest to each vertex.
    """

    vertices: np.ndarray
    faces: np.ndarray
    piece: np.ndarray
    source: np.ndarray

    def place_of(self, count: int) -> np.ndarray:
        """Return the vertices (count,) that are the lattice's first `count` points, which are on the floor."""
        place = np.full(count, -1)
        on_floor = np.flatnonzero((self.source < count) & (self.vertices[:, 2] == 0))
        place[self.source[on_floor]] = on_floor
        if (place < 0).any():
            raise GeometryError("surface: the mesh has lost a point of the walls' line on the floor")
        return place


class Faceted(Protocol):
    """A lattice, or another fine mesh: points (n, 3) m, faces (m, 3), and the piece (m,) of each, a small number."""

    @property
    def vertices(self) -> np.ndarray:
        """Return the points (n, 3) m."""

    @property
    def faces(self) -> np.ndarray:
        """Return the faces (m, 3)."""

    @property
    def piece(self) -> np.ndarray:
        """Return the number (m,) of the piece that each face belongs to."""


_F = TypeVar("_F", bound=Faceted)


class Mesher(Generic[_F]):
    """Make meshes of a lattice again and again, and each time only in the tiles whose points have moved."""

    def __init__(self, lattice: _F, simplification: Simplification | None = None, digits: int | None = _DIGITS) -> None:
        """Divide the lattice's faces into tiles; without a simplification, meshes have every point of the lattice.

        Points are rounded to these digits, m, or with None not at all. Points of two tiles that are then equal are one.
        """
        self.lattice, self.simplification, self._digits = lattice, simplification, digits
        if simplification:
            centre = lattice.vertices[lattice.faces].mean(axis=1)[:, :2]
            cell = np.floor((centre - centre.min(axis=0)) / simplification.tile_m).astype(np.int64)
            place = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
            tile = (int(lattice.piece.max()) + 1) * place + lattice.piece  # no face joins wall and roof
            self._order = np.argsort(tile.astype(np.min_scalar_type(tile.max())), kind="stable")
            self._first = np.flatnonzero(np.diff(tile[self._order], prepend=-1))
            self._tiles = np.split(self._order, self._first[1:])
            self._local = [_local_faces(lattice.faces[tile]) for tile in self._tiles]
            self._mesh = np.zeros((0, 3)), np.zeros((0, 3), np.int32)
            self._share = np.full(len(self._tiles), simplification.kept_share)
            self._made = self._share  # with which each tile was last made
            self._parts: list[tuple[np.ndarray, np.ndarray]] = [(np.zeros((0, 3)), np.zeros((0, 3), int))] * len(
                self._tiles
            )

    def mesh(self, vertices: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the mesh of the displaced points (n, 3) m: its vertices and faces, and (m,) which faces are new.

        `moved` (n,) states which points have moved since the last call. Tiles that were refined since are new, too.
        """
        faces = self.lattice.faces
        moved_faces = moved[faces].any(axis=1)
        if self.simplification is None:
            return vertices, faces, moved_faces
        new = np.logical_or.reduceat(moved_faces[self._order], self._first) | (self._share != self._made)
        self._made = self._share.copy()
        for k in np.flatnonzero(new).tolist():
            self._parts[k] = _simplified(vertices, *self._local[k], float(self._share[k]), self._digits)
        changed = np.repeat(new, [len(part) for _, part in self._parts])
        self._mesh = self._joined()
        return *self._mesh, changed

    def surface(self, vertices: np.ndarray) -> SurfaceMesh:
        """Return the mesh of the last call of `mesh`, which had the displaced points (n, 3) m, with its sources."""
        if self.simplification is None:
            return SurfaceMesh(vertices, self.lattice.faces, self.lattice.piece, np.arange(len(vertices)))
        points, faces = self._mesh
        _, source = cKDTree(vertices).query(points, workers=2)
        return SurfaceMesh(points, faces, self.piece, source)

    @property
    def piece(self) -> np.ndarray:
        """Return the piece (m,) of each face of the last call of `mesh`."""
        if self.simplification is None:
            return self.lattice.piece
        pieces = [self.lattice.piece[tile[0]] for tile in self._tiles]
        return np.repeat(pieces, [len(part) for _, part in self._parts]).astype(np.uint8)

    def refine(self, places: np.ndarray, times: float = 2.0) -> bool:
        """Keep so many times more faces in the tiles at places (k, 3) m; return whether one had not all of them."""
        refined = False
        if self.simplification and len(places):
            nearest = self._points.query(places)[1]
            point = np.zeros(len(self.lattice.vertices), bool)
            point[nearest] = True
            near = [bool(point[self.lattice.faces[tile]].any()) for tile in self._tiles]
            refined = bool((self._share[near] < 1).any())
            self._share[near] = np.minimum(1.0, times * np.maximum(self._share[near], self.simplification.kept_share))
        return refined

    @cached_property
    def _points(self) -> cKDTree:
        """Index the lattice's points."""
        return cKDTree(self.lattice.vertices)

    def _joined(self) -> tuple[np.ndarray, np.ndarray]:
        """Join the tiles at their borders, whose points are the lattice's own."""
        points = np.concatenate([p for p, _ in self._parts])
        first = np.cumsum([0, *(len(p) for p, _ in self._parts)])
        faces = np.concatenate([f + at for (_, f), at in zip(self._parts, first, strict=False)])
        units = points if self._digits is None else np.rint(points * 10**self._digits).astype(np.int64)
        order = np.lexsort(units.T[::-1])  # stable: of equal points the first is kept
        new = np.any(np.diff(units[order], axis=0, prepend=units[order[:1]] - 1) != 0, axis=1)
        number = np.empty(len(points), np.int32)
        number[order] = np.cumsum(new) - 1
        return points[order[new]], number[faces]


def _local_faces(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (k,) that faces (m, 3) of the lattice use, and the faces (m, 3) by places in that list."""
    used, local = np.unique(faces, return_inverse=True)
    return used, local.reshape(-1, 3).astype(np.int32)


def _simplified(
    vertices: np.ndarray, used: np.ndarray, faces: np.ndarray, share: float, digits: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) m and faces (m, 3) of one tile with about a share of its faces."""
    if len(faces) < _LEAST_FACES or share >= 1:
        return vertices[used], faces
    points, kept = fast_simplification.simplify(vertices[used], faces, 1 - share, preserve_border=True)
    return points if digits is None else np.round(points, digits) + 0.0, kept  # + 0.0: no negative zeros
