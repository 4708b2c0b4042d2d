"""The map of a robot that flies: free, unknown and rock cells of the volume, and the task's cubes that it has seen."""

from __future__ import annotations

import itertools

import numpy as np

FINE = 4  # fine cells along a cube: 0.5 m of 2 m
UNKNOWN, FREE, ROCK = 0, 1, 2
_GROWTH = 8  # cubes added when a map becomes too small
_ALL_ROUND = np.array([way for way in itertools.product((-1, 0, 1), repeat=3) if any(way)])
_SIDES = np.array([way for way in _ALL_ROUND.tolist() if sum(map(abs, way)) == 1])


class VolumeMap:
    """A map that grows as it is needed, in the mine frame.

    `fine[i, j, k]` covers low * cell_m + (i, j, k) * fine_m, `seen` the task's cubes; both have axes east, north, up.
    """

    def __init__(self, cell_m: float) -> None:
        """Start with an empty map."""
        self.cell_m, self.fine_m = cell_m, cell_m / FINE
        self.low = np.zeros(3, dtype=int)  # the first cube
        self.seen = np.zeros((0, 0, 0), dtype=bool)
        self.fine = np.zeros((0, 0, 0), dtype=np.uint8)
        self._near_rock = np.zeros((0, 0, 0), dtype=bool)  # fine cells that rock is beside

    def add(self, place: np.ndarray, directions: np.ndarray, ranges: np.ndarray, far_m: float) -> None:
        """Add beams (n, 3) from a place (3,) m; a range (n,) of `far_m` is a beam that hit nothing."""
        ends = place + directions * ranges[:, None]
        self._grow_to(np.vstack([ends, place]))
        steps = np.arange(0.0, far_m, self.fine_m / 2)
        reach = np.minimum(steps, np.maximum(ranges - self.fine_m / 4, 0.0)[:, None])
        passed = self.at((place + directions[:, None, :] * reach[..., None]).reshape(-1, 3))
        self.seen[tuple(passed.T // FINE)] = True
        before = self.fine[tuple(passed.T)]
        self.fine[tuple(passed.T)] = np.where(before == ROCK, ROCK, FREE)
        hit = ranges < far_m - 0.05
        rock = self.at(ends[hit] + directions[hit] * (self.fine_m / 4))
        self.fine[tuple(rock.T)] = ROCK
        self._near_rock[tuple((rock[:, None] + _ALL_ROUND).reshape(-1, 3).T)] = True

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the fine cells (n, 3) about places (n, 3) m."""
        return np.floor(places / self.fine_m + 1e-9).astype(int) - self.low * FINE

    def centres(self, cells: np.ndarray) -> np.ndarray:
        """Return the centres (n, 3) m of fine cells (n, 3)."""
        return (cells + 0.5 + self.low * FINE) * self.fine_m

    def _grow_to(self, places: np.ndarray) -> None:
        """Enlarge the map so that places (n, 3) m and the cubes round theirs lie inside."""
        cubes = np.floor(places / self.cell_m).astype(int)
        least, most = cubes.min(axis=0) - 2, cubes.max(axis=0) + 3
        high = self.low + self.seen.shape
        if self.seen.size and (least >= self.low).all() and (most <= high).all():
            return
        if not self.seen.size:
            self.low = high = cubes[-1]
        low = np.where(least < self.low, least - _GROWTH, self.low)
        high = np.where(most > high, most + _GROWTH, high)
        for name, factor in (("seen", 1), ("fine", FINE), ("_near_rock", FINE)):
            old = getattr(self, name)
            new = np.zeros((high - low) * factor, dtype=old.dtype)
            at = (self.low - low) * factor
            new[tuple(slice(a, a + n) for a, n in zip(at.tolist(), old.shape, strict=True))] = old
            setattr(self, name, new)
        self.low = low

    def path_to_frontier(self, place: np.ndarray, escape_m: float, closed: set[tuple[int, ...]]) -> np.ndarray | None:
        """Return a shortest path (n, 3) m, over free cells away from rock, to the nearest one beside an unseen cube.

        Parameters
        ----------
        place : (3,) m
            Where it begins.
        escape_m : float
            Around the place, within which cells beside rock are allowed too.
        closed : set of (3,)
            Cubes, counted from the mine frame's origin, that are no goals.
        """
        strides = np.array([self.fine.shape[1] * self.fine.shape[2], self.fine.shape[2], 1])
        steps, start = _ALL_ROUND @ strides, self.at(place[None])[0]
        wanted = self._wanted(closed)
        free, clear = self.fine.reshape(-1) == FREE, self._near_rock.reshape(-1) == 0
        near = int(np.ceil(escape_m / self.fine_m))
        about = np.stack(np.meshgrid(*[np.arange(s - near, s + near + 1) for s in start.tolist()], indexing="ij"), -1)
        inside = ((about >= 0) & (about < self.fine.shape)).all(axis=-1)
        clear[about[inside] @ strides] = True
        levels, edge = [], np.array([start @ strides])
        parents = edge
        free[edge] = False
        while len(edge):
            levels.append((edge, parents))
            goals = self._are_goals(edge, wanted, strides)
            if goals.any():
                return self._trace(levels, edge[goals][0])
            ahead = (edge[:, None] + steps).ravel()  # the map has closed borders: no step leaves it
            allowed = free[ahead] & clear[ahead]
            edge, first = np.unique(ahead[allowed], return_index=True)
            parents = np.repeat(levels[-1][0], len(steps))[allowed][first]
            free[edge] = False
        return None

    def _wanted(self, closed: set[tuple[int, ...]]) -> np.ndarray:
        """Return which cubes are not seen and may be goals."""
        wanted = ~self.seen
        for cube in closed:
            at = np.array(cube) - self.low
            if ((at >= 0) & (at < wanted.shape)).all():
                wanted[tuple(at)] = False
        return wanted

    def _are_goals(self, cells: np.ndarray, wanted: np.ndarray, strides: np.ndarray) -> np.ndarray:
        """Return which flat cells (n,) have an unknown one of a wanted cube beside them."""
        beside = cells[:, None] + _SIDES @ strides
        place = np.unravel_index(beside, self.fine.shape)
        unknown = self.fine.reshape(-1)[beside] == UNKNOWN
        return np.asarray((unknown & wanted[tuple(axis // FINE for axis in place)]).any(axis=1))

    def _trace(self, levels: list[tuple[np.ndarray, np.ndarray]], cell: int) -> np.ndarray:
        """Return the centres (n, 3) m from the first level's cell to one of the last level's."""
        cells = []
        for edge, parents in reversed(levels):
            cells.append(int(cell))
            cell = parents[np.searchsorted(edge, cell)]
        return self.centres(np.column_stack(np.unravel_index(cells[::-1], self.fine.shape)))

    def unseen_beside(self, place: np.ndarray) -> list[tuple[int, ...]]:
        """Return the cubes beside that about a place (3,) m, and that one, that are not seen."""
        cube = self.at(place[None])[0] // FINE
        beside = [cube, *(cube + _SIDES)]
        return [tuple((at + self.low).tolist()) for at in beside if not self.seen[tuple(at)]]
