"""How often a closed mesh goes about places of a grid: more than once, or less than never, where it crosses itself."""

from __future__ import annotations

import numpy as np

from pipeline.geometry.ray_scene import ray_scene

_ASIDE = (0.0, 0.013, -0.017, 0.019)  # of a cell: a ray that meets an edge is cast again, as its hits do not add up
_ON_M = 1e-5  # of a facet: a place so near to it is on both of its sides, and hits there come in any order


class WindingNumber:
    """The winding number of a closed mesh: the sum of what rays meet on their way up to a place."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Take facets (m, 3) between vertices (n, 3) m, whose normals point out of the space."""
        self._middle = vertices.mean(axis=0)
        a, b, c = np.moveaxis((vertices - self._middle)[faces], 1, 0)
        self._down = -np.sign(np.cross(b - a, c - a)[:, 2]).astype(int)
        self._floor = float(vertices[:, 2].min() - self._middle[2]) - 1.0
        self._tall = float(np.ptp(vertices[:, 2])) + 2.0
        self._scene = ray_scene(vertices - self._middle, faces)

    def at(self, places: np.ndarray, column: np.ndarray, cell_m: float) -> np.ndarray:
        """Return how often (n,) the mesh goes about places (n, 3) m, of vertical lines numbered (n,).

        A place on a facet has the larger number of both sides.
        """
        own = places - self._middle
        _, first, line = np.unique(column, return_index=True, return_inverse=True)
        height = np.clip(own[:, 2] - self._floor, 0.0, self._tall)
        found, left, line = np.zeros(len(places), int), np.arange(len(first)), line.reshape(-1)
        for aside in _ASIDE:
            start = own[first[left], :2] + aside * cell_m
            up = np.tile(np.array([0, 0, self._floor, 0, 0, 1], np.float32), (len(left), 1))
            up[:, :2] = start
            hits = self._scene.list_intersections(up)
            at = hits["ray_ids"].numpy().astype(np.int64) * self._tall + hits["t_hit"].numpy()
            order = np.argsort(at)
            total = np.append(0, np.cumsum(self._down[hits["primitive_ids"].numpy().astype(np.int64)[order]]))
            ends = total[np.searchsorted(at[order], np.arange(len(left) + 1) * self._tall)]
            number = np.full(len(first), -1)
            number[left] = np.arange(len(left))
            rows = np.flatnonzero(number[line] >= 0)
            ray = number[line[rows]]
            around = ray * self._tall + height[rows] + np.array([[-_ON_M], [_ON_M]])
            found[rows] = total[np.searchsorted(at[order], around)].max(axis=0) - ends[ray]
            left = left[ends[1:] != ends[:-1]]
            if not len(left):
                break
        return found
