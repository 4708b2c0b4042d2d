"""A reader of OctoMap's binary trees that knows nothing of the pipeline's writer."""

from __future__ import annotations

import numpy as np

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
_INNER, _DEPTH = 3, 16


class BinaryTree:
    """An OctoMap tree by the states of its leaves, each by its level and key."""

    def __init__(self, data: bytes) -> None:
        head, separator, body = data.partition(b"\ndata\n")
        assert head.startswith(b"# Octomap OcTree binary file\nid OcTree\n")
        assert separator
        fields = dict(line.split(" ", 1) for line in head.decode().splitlines()[1:])
        self.resolution_m = float(fields["res"])
        self.leaves: dict[tuple[int, int, int, int], int] = {}
        words = iter(np.frombuffer(body, dtype="<u2").tolist())
        self.nodes = 0
        if fields["size"] != "0":
            self._read(words, 0, 0, 0, 0)
        assert next(words, None) is None
        assert self.nodes == int(fields["size"])

    def _read(self, words, level: int, x: int, y: int, z: int) -> None:
        word = next(words)
        self.nodes += 1
        children = [(word >> (2 * child)) & 3 for child in range(8)]
        for child, state in enumerate(children):
            key = (2 * x + (child & 1), 2 * y + (child >> 1 & 1), 2 * z + (child >> 2))
            if state == _INNER:
                self._read(words, level + 1, *key)
            elif state != UNKNOWN:
                self.nodes += 1
                self.leaves[level + 1, *key] = state

    def query(self, points: np.ndarray) -> np.ndarray:
        """Return the state at each of (n, 3) points, m."""
        voxels = np.floor(np.asarray(points) / self.resolution_m).astype(int) + 2 ** (_DEPTH - 1)
        above = [[(_DEPTH - up, *(voxel >> up).tolist()) for up in range(_DEPTH)] for voxel in voxels]
        return np.array([next((self.leaves[k] for k in keys if k in self.leaves), UNKNOWN) for keys in above])

    def volume_m3(self, state: int) -> float:
        """Return the volume of all leaves in one state, m3."""
        return sum((self.resolution_m * 2 ** (_DEPTH - key[0])) ** 3 for key, s in self.leaves.items() if s == state)
