"""Surfaces of coplanar facets as polygons, with what shapes of parts behind them are made of."""

from __future__ import annotations

from typing import Self

import numpy as np

from pipeline.volume.mesh_edges import MeshEdges
from pipeline.volume.rock.polygons import ways_into_rock
from pipeline.volume.rock.shapes import Polygons, forward_ways
from pipeline.volume.union import Volume


class RockSurfaces:
    """Convex polygons of facets; the number of each is that of its first facet.

    Attributes
    ----------
    facets : dict
        Of each surface.
    owner : (f,) int64
        Number of the surface of each facet, -1 of other facets.
    """

    def __init__(self, volume: Volume, surfaces: list[tuple[list[int], list[int]]]) -> None:
        """Take surfaces of a volume, each the vertices about it in order and its facets."""
        self.facets = {facets[0]: facets for _, facets in surfaces}
        self.owner = np.full(len(volume.faces), -1)
        for number, facets in self.facets.items():
            self.owner[facets] = number
        self._rings = [ring for ring, _ in surfaces]
        self._volume = volume

    @classmethod
    def of_facets(cls, volume: Volume, facets: list[int]) -> Self:
        """Take some facets of a volume, each as a surface."""
        return cls(volume, [(ring, [k]) for ring, k in zip(volume.faces[facets].tolist(), facets, strict=True)])

    def polygons(self) -> list[Polygons]:
        """Return the surfaces as polygons, those with equally many corners together."""
        volume = self._volume
        normal = volume.normals
        size = np.linalg.norm(normal, axis=1)
        unit = normal / np.maximum(size, 1e-30)[:, None]
        ways, edges = ways_into_rock(volume), MeshEdges.of(volume)
        area = np.bincount(self.owner + 1, size / 2, len(size) + 1)[1:]
        count, first = np.array([len(ring) for ring in self._rings], int), np.array(list(self.facets), int)
        found = []
        for k in np.unique(count):
            numbers = first[count == k]
            rings = np.array([ring for ring in self._rings if len(ring) == k])
            biggest = np.array([max(self.facets[n], key=size.__getitem__) for n in numbers.tolist()])
            beside = unit[edges.facets(np.roll(rings, -1, axis=1), rings)]
            corners = volume.vertices[rings]
            if k > 3:
                corners = _behind_planes(corners, ways[rings], unit[biggest])
            found.append(Polygons(numbers, corners, ways[rings], unit[biggest], beside, area[numbers]))
        return found


def _behind_planes(corners: np.ndarray, ways: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the corners (n, k, 3) m of polygons, moved into the rock by as much as they are off one plane.

    Facets of one plane are in it within some micrometres: the flat between corners of others would be in free space.
    """
    along = np.einsum("nck,nk->nc", corners, normals)
    ahead = forward_ways(ways, normals)
    rate = np.ptp(along, axis=1)[:, None] / np.einsum("nck,nk->nc", ahead, normals)
    return corners + rate[:, :, None] * ahead
