"""Split the long edges of a mesh, so that a fold can bend it; neighbours stay joined."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_ROUNDS = 20  # each halves the longest edges


def split_edges(
    points: np.ndarray, faces: np.ndarray, wants: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, d) and faces (m, 3) whose edges are halved until none wants it.

    Each round halves an edge for all its faces alike, so that neighbours stay joined.

    Parameters
    ----------
    points : (n, d)
    faces : (m, 3) int
    wants : callable
        Whether edges (k,) between points (k, d) and (k, d) are to be halved.
    """
    for _ in range(_ROUNDS):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, of_face = np.unique(edges, axis=0, return_inverse=True)
        long = wants(points[unique[:, 0]], points[unique[:, 1]])
        if not long.any():
            break
        number = np.full(len(unique), -1)
        number[long] = len(points) + np.arange(long.sum())
        points = np.concatenate([points, points[unique[long]].mean(axis=1)])
        middle = number[of_face.reshape(-1, 3)]  # of the edges 0-1, 1-2 and 2-0 of each face
        cuts = (middle >= 0).sum(axis=1)
        made = [faces[cuts == 0]]
        for one in range(3):
            a, b, c = faces[:, one], faces[:, (one + 1) % 3], faces[:, (one + 2) % 3]
            ab, bc, ca = (middle[:, (one + k) % 3] for k in range(3))
            alone = (cuts == 1) & (ab >= 0)
            made += [np.column_stack([a, ab, c])[alone], np.column_stack([ab, b, c])[alone]]
            two = (cuts == 2) & (ca < 0)
            made += [np.column_stack(f)[two] for f in ((ab, b, bc), (a, ab, bc), (a, bc, c))]
            if one == 0:
                all_ = cuts == 3
                made += [np.column_stack(f)[all_] for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        faces = np.concatenate(made)
    return points, faces
