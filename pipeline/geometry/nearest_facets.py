"""The nearest of many triangles, and how far it is, in 64 bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.geometry.ray_scene import ray_scene

WITHIN_M = 3e-4  # within 300 m of the middle: distances are no smaller than the true ones, and larger by no more
# Open3D's closest point of a triangle with a side L and a height H over it is off along L by up to 2e-8 L^3 / H^2, as
# `findings/open3d-distance-to-long-triangles-off.sh` measures: by metres for needles.
_LONGEST_M = 1e4  # L^3 / H^2 of a piece: off by 0.2 mm
_CUTS = 7.0  # pieces of half a needle of the length that a single piece of its height may have
_FLAT_M = 1e-4  # H of a triangle that is a line
_BLOCK = 1 << 18  # triangles or places at a time
_LEAST = 1e-30  # squared length of a side


@dataclass(frozen=True)
class Nearest:
    """Of each place the distance (n,) m from its nearest triangle, that one's number (n,), and its place (n, 3) m."""

    distance_m: np.ndarray
    facet: np.ndarray
    place_m: np.ndarray


class NearestFacets:
    """Finds the nearest of triangles; those that Open3D measures badly are searched in pieces.

    A distance is that from a triangle in 64 bits, so it is never too small. Pieces are off by so little in 32 bits that
    no other triangle is nearer by more than `WITHIN_M`.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, threads: int = 0) -> None:
        """Index triangles (m, 3) between vertices (n, 3) m; so many threads search, 0: all."""
        self._vertices, self._faces, self._threads = vertices, faces, threads
        self._middle = vertices.mean(axis=0, dtype=np.float64)
        found = [
            _pieces_of(vertices[faces[k : k + _BLOCK]] - self._middle, k) for k in range(0, max(len(faces), 1), _BLOCK)
        ]
        pieces, owners = zip(*found, strict=True)
        self._owner = np.concatenate(owners)
        corners = np.concatenate(pieces).reshape(-1, 3)
        self._scene: Any = ray_scene(corners, np.arange(len(corners)).reshape(-1, 3), threads)

    @classmethod
    def of(cls, triangles: np.ndarray) -> NearestFacets:
        """Index triangles (m, 3, 3) m."""
        return cls(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))

    def query(self, places: np.ndarray) -> Nearest:
        """Return what is nearest to places (n, 3) m."""
        about = self._about(places)
        piece = self._scene.compute_closest_points(about, nthreads=self._threads)["primitive_ids"].numpy()
        facet = self._owner[piece.astype(np.int64)]
        nearest = np.empty((len(places), 3))
        for start in range(0, len(places), _BLOCK):
            some = slice(start, start + _BLOCK)
            nearest[some] = closest_points(self._vertices[self._faces[facet[some]]], places[some])
        return Nearest(np.linalg.norm(nearest - places, axis=1), facet, nearest)

    def rough_distances(self, places: np.ndarray) -> np.ndarray:
        """Return the distances (n,) float32 m from pieces as Open3D measures them, within `WITHIN_M`: much faster."""
        found: np.ndarray = self._scene.compute_distance(self._about(places), nthreads=self._threads).numpy()
        return found

    def _about(self, places: np.ndarray) -> np.ndarray:
        return np.asarray(places - self._middle, np.float32)


def closest_points(triangles: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the point (n, 3) of each triangle (n, 3, 3) that is nearest to its place (n, 3), m."""
    sides, away = np.roll(triangles, -1, axis=1) - triangles, places[:, None] - triangles
    share = np.einsum("nij,nij->ni", away, sides) / np.maximum(np.einsum("nij,nij->ni", sides, sides), _LEAST)
    on_sides = triangles + np.clip(share, 0, 1)[:, :, None] * sides
    far = np.square(on_sides - places[:, None]).sum(axis=2)
    found: np.ndarray = on_sides[np.arange(len(places)), far.argmin(axis=1)]
    normal = np.cross(sides[:, 0], sides[:, 1])
    square = np.einsum("nj,nj->n", normal, normal)
    over = (np.einsum("nij,nj->ni", np.cross(sides, away), normal) > 0).all(axis=1) & (square > 0)
    height = np.einsum("nj,nj->n", away[over, 0], normal[over]) / square[over]
    found[over] = places[over] - height[:, None] * normal[over]
    return found


def _pieces_of(triangles: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Return pieces (k, 3, 3) m, in 32 bits, of triangles with numbers from `first`, and the numbers (k,) of theirs.

    A triangle without a height is a line: one whose last two corners are the same, as Open3D takes it. Needles are cut
    at the foot of their height, and each half across, closer together towards its tip.
    """
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    turned = ((sides.argmax(axis=1)[:, None] + np.arange(3)) % 3)[:, :, None]
    triangles, length = np.take_along_axis(triangles, turned, axis=1), sides.max(axis=1)
    start, end, tip = np.moveaxis(triangles, 1, 0)
    height = np.linalg.norm(np.cross(end - start, tip - start), axis=1) / np.maximum(length, _LEAST)
    flat = height <= _FLAT_M
    triangles[flat, 2] = end[flat]
    needle = np.flatnonzero(~flat & (length**3 > _LONGEST_M * height**2))
    kept = np.setdiff1d(np.arange(len(triangles)), needle)
    start, end, tip, length = start[needle], end[needle], tip[needle], length[needle]
    foot = start + (np.einsum("nj,nj->n", tip - start, end - start) / length**2)[:, None] * (end - start)
    pieces, owners = [triangles[kept]], [kept]
    for point in (start, end):
        half = np.linalg.norm(foot - point, axis=1)
        count = np.maximum(np.ceil(_CUTS * half / np.cbrt(_LONGEST_M * height[needle] ** 2)), 1).astype(np.int64)
        own = np.repeat(np.arange(len(needle)), count)
        number = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count)
        near, far = (((number + one) / count[own])[:, None] ** 3 for one in (0, 1))
        low, high = (foot - point)[own], (tip - point)[own]
        corners = [point[own] + step for step in (near * low, far * low, far * high, near * high)]
        pieces += [np.stack(corners[:3], axis=1), np.stack([corners[k] for k in (0, 2, 3)], axis=1)[number > 0]]
        owners += [needle[own], needle[own[number > 0]]]
    return np.concatenate(pieces).astype(np.float32), first + np.concatenate(owners)
