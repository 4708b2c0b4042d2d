"""Walls between two floors that are hardly apart in height, found by rays."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.ray_scene import ray_scene
from pipeline.volume.network import NearLegs
from pipeline.volume.union import Label, Volume

DEEPEST_M = 0.6  # of a ledge between two floors that overlap; deeper ones are as surveyed
_OVERHANG = 0.1  # of a facet's normal, which points out of the free space: what hangs over is no ledge
_BEFORE_M = (1e-3, 0.05)  # before a wall, where floors are looked for; behind it at the first
# Places on a facet by the weights of its corners: its middle first, then near its corners and edges.
_PLACES = np.array([[1, 1, 1], *(0.2 + 1.8 * np.eye(3)), *(1.3 - 1.0 * np.eye(3))])
_PLACES /= _PLACES.sum(axis=1, keepdims=True)
MIDDLE, ALL_PLACES = 1, len(_PLACES)


def walls_on_floors(volume: Volume, is_floor: np.ndarray, stays: np.ndarray) -> np.ndarray:
    """Return the facets (n,) of walls that have a corner on a floor; none of `stays` (f,)."""
    corner = np.zeros(len(volume.vertices), bool)
    corner[volume.faces[is_floor]] = True
    normal = volume.normals
    is_wall = (volume.label == Label.WALL) & (normal[:, 2] < _OVERHANG * np.linalg.norm(normal, axis=1))
    return np.flatnonzero(is_wall & ~is_floor & ~stays & corner[volume.faces].any(axis=1))


def are_steps(volume: Volume, is_floor: np.ndarray, some: np.ndarray, places: int, near: NearLegs) -> np.ndarray:
    """Return which facets (f,), of some (n,), have a place between floors of legs that meet, `DEEPEST_M` apart at most.

    One floor is over the rock behind the place, the other under the free space before it. `places` are tried on each
    facet: `MIDDLE` or `ALL_PLACES`.
    """
    far, hit = _Rays(volume, np.arange(len(volume.faces))).cast(volume, some, places)
    found = np.zeros(len(volume.faces), bool)
    found[some] = _between(far, is_floor[hit], _shots(volume)[hit], near)
    return found


class Steps:
    """Steps between legs that are near each other. Rays are cast once for a facet that nobody cuts.

    The mesh is a volume's or cut from it. Of a cut mesh only facets that were cut, and those whose rays met one that
    was, are looked at again, among the facets near them.
    """

    def __init__(self, volume: Volume, near: NearLegs) -> None:
        """Index the facets; legs meet that are `near` each other."""
        self.near, self._shot = near, _shots(volume)
        self._volume, self._rays = volume, _Rays(volume, np.arange(len(volume.faces)))
        self._row = np.full(len(volume.faces), -1)
        self._far = np.zeros((3, ALL_PLACES, 0), np.float32)
        self._hit = np.zeros((3, ALL_PLACES, 0), np.int32)
        self._cut, self._local = volume, self._rays
        self._cells = _Cells(volume)

    def find(self, cut: Volume, parent: np.ndarray, is_floor: np.ndarray, some: np.ndarray, places: int) -> np.ndarray:
        """Return the same as `are_steps` of a mesh whose facets (f,) are cut from those of `parent` (f,)."""
        was_cut = np.bincount(parent, minlength=len(self._row)) > 1
        whole = ~was_cut[parent[some]]
        row = self._known(parent[some[whole]])
        far, hit = self._far[:, :, row], self._hit[:, :, row]
        again = ~whole
        again[whole] = ((far < DEEPEST_M) & was_cut[hit]).any(axis=(0, 1))
        floor = np.zeros(len(self._row), bool)
        floor[parent[is_floor]] = True
        found = np.zeros(len(cut.faces), bool)
        found[some[whole]] = _between(far[:, :places], floor[hit[:, :places]], self._shot[hit[:, :places]], self.near)
        if again.any():
            if self._cut is not cut:
                self._cut = cut
                self._local = _Rays(cut, np.flatnonzero(self.facets_near(parent[some[again]])[parent]))
            far, hit = self._local.cast(cut, some[again], places)
            found[some[again]] = _between(far, is_floor[hit], _shots(cut)[hit], self.near)
        return found

    def facets_near(self, facets: np.ndarray) -> np.ndarray:
        """Return which facets (f,) of the mesh that was not cut a ray from some of them (n,) can meet, and more."""
        return self._cells.near(facets)

    def _known(self, facets: np.ndarray) -> np.ndarray:
        """Return the rows of some facets, whose rays are cast if they are not known."""
        new = facets[self._row[facets] < 0]
        if len(new):
            self._row[new] = self._far.shape[2] + np.arange(len(new))
            far, hit = self._rays.cast(self._volume, new, ALL_PLACES)
            self._far, self._hit = np.concatenate([self._far, far], axis=2), np.concatenate([self._hit, hit], axis=2)
        found: np.ndarray = self._row[facets]
        return found


class _Rays:
    """Some facets of a mesh as rays up and down meet them."""

    def __init__(self, volume: Volume, facets: np.ndarray) -> None:
        """Index some facets (n,)."""
        self._facets, self._middle = facets, volume.vertices.mean(axis=0)
        self._scene = ray_scene(volume.vertices - self._middle, volume.faces[facets], 1)

    def cast(self, volume: Volume, some: np.ndarray, places: int) -> tuple[np.ndarray, np.ndarray]:
        """Return how far (3, places, n) m it is to the first facet, inf if none is, and its number (3, places, n).

        First up from the rock behind each place of some facets (n,), then down from two places before it where it is
        at most `DEEPEST_M` up.
        """
        at = np.einsum("sc,fcx->sfx", _PLACES[:places], volume.vertices[volume.faces[some]]).reshape(-1, 3)
        normal = volume.normals[some]
        way = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        way = np.tile(way, (places, 1))
        far, hit = np.full((3, len(at)), np.inf, np.float32), np.zeros((3, len(at)), np.int32)
        far[0], hit[0] = self._first(at + _BEFORE_M[0] * way, 1.0)
        near = np.flatnonzero(far[0] < DEEPEST_M)
        for k, beside in enumerate(_BEFORE_M, start=1):
            far[k, near], hit[k, near] = self._first(at[near] - beside * way[near], -1.0)
        return far.reshape(3, places, -1), hit.reshape(3, places, -1)

    def _first(self, places: np.ndarray, up: float) -> tuple[np.ndarray, np.ndarray]:
        rays = np.column_stack([places - self._middle, np.tile([0, 0, up], (len(places), 1))]).astype(np.float32)
        found = self._scene.cast_rays(rays, nthreads=1)
        far, hit = found["t_hit"].numpy(), found["primitive_ids"].numpy().astype(np.int64)
        return far, self._facets[np.where(np.isfinite(far), hit, 0)]


def _between(far: np.ndarray, on_floor: np.ndarray, shot: np.ndarray, near: NearLegs) -> np.ndarray:
    """Return which facets (n,) have a place whose rays (3, places, n) meet floors at most `DEEPEST_M` apart.

    `shot` are the legs that they meet: those over and under the place meet in the survey.
    """
    up, one, other = np.where(on_floor, far.astype(float), np.inf)
    under = np.where(other < one, shot[2], shot[1])
    found: np.ndarray = ((up + np.minimum(one, other) < DEEPEST_M) & near.has(shot[0], under)).any(axis=0)
    return found


def _shots(volume: Volume) -> np.ndarray:
    """Return the leg (f,) that each facet is of."""
    found: np.ndarray = np.array([piece.shot for piece in volume.pieces])[volume.source]
    return found


class _Cells:
    """The facets of a mesh in cells that are longer than a ray from one of them to another."""

    def __init__(self, volume: Volume) -> None:
        """Put each facet in the cell of its middle."""
        corners = volume.vertices[volume.faces]
        reach = DEEPEST_M + _BEFORE_M[1] + float(np.ptp(corners, axis=1).max())
        middle = corners.mean(axis=1)
        place = ((middle - middle.min(axis=0)) / reach).astype(np.int64) + 1
        count = place.max(axis=0) + 2
        around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        self._about = (around[:, 0] * count[1] + around[:, 1]) * count[2] + around[:, 2]
        key = (place[:, 0] * count[1] + place[:, 1]) * count[2] + place[:, 2]
        self._keys, self._cell = np.unique(key, return_inverse=True)

    def near(self, facets: np.ndarray) -> np.ndarray:
        """Return which facets (f,) are in the cells of some (n,) and about them."""
        wanted = self._keys[np.unique(self._cell[facets])][:, None] + self._about
        marked: np.ndarray = np.isin(self._keys, wanted)
        return marked[self._cell]
