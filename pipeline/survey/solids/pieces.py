"""The pieces of a mesh: triangles that enclose a space together, whatever they share with those of other pieces."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_SAME_RAD = 1e-6  # between triangles at one edge that lie on each other


def part_pieces(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return vertices of which each belongs to one piece, the triangles, turned alike, and how many were turned.

    Triangles that share edges of two triangles are a piece. Where more meet at an edge, a file that holds one piece
    after another parts them: a piece ends where all its edges have met a second triangle. Other triangles at such an
    edge are joined across the space between their inner sides; a wall between two pieces that is written once is of
    both. Of a piece that is written twice one copy is left.

    Parameters
    ----------
    vertices : (n, 3) float64, m
    faces : (m, 3) int64
        In the file's order.
    """
    count = len(vertices)
    if len(faces) and (np.bincount(edges_of(faces, count)[0]) > 2).any():
        vertices, faces = _parted_by_order(vertices, faces)
        faces = _once(faces)
    faces, flipped = _turned_alike(faces, len(vertices))
    if len(faces) and (np.bincount(edges_of(faces, len(vertices))[0]) > 2).any():
        vertices, faces = _parted_at_edges(vertices, _with_shared_twice(vertices, faces))
    return vertices, faces, flipped


def edges_of(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each side (3 m,) of the triangles a number of its edge, whether it goes up it, and its triangle."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    low, high = ends.min(axis=1), ends.max(axis=1)
    number = np.unique(low * count + high, return_inverse=True)[1].reshape(-1)
    return number, ends[:, 0] < ends[:, 1], np.tile(np.arange(len(faces)), 3)


def joined_by_edges(faces: np.ndarray, count: int) -> np.ndarray:
    """Return the number (m,) of the piece of each triangle; triangles with a common edge are in one."""
    number, _, triangle = edges_of(faces, count)
    order = np.argsort(number, kind="stable")
    same = np.flatnonzero(number[order][1:] == number[order][:-1])
    return _components(triangle[order[same]], triangle[order[same + 1]], len(faces))


def _components(one: np.ndarray, two: np.ndarray, count: int) -> np.ndarray:
    graph = coo_matrix((np.ones(len(one)), (one, two)), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _parted_by_order(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices of their own for each run of joined triangles, in the file's order, that leaves no edge open."""
    part = joined_by_edges(faces, len(vertices))
    order = np.argsort(part, kind="stable")
    faces, part = faces[order], part[order]
    number, _, triangle = edges_of(faces, len(vertices))
    sides = np.lexsort((triangle, number))
    first = np.append(0, np.flatnonzero(np.diff(number[sides])) + 1)
    place = np.arange(len(sides)) - np.repeat(first, np.diff(np.append(first, len(sides))))
    open_sides = np.cumsum(np.bincount(triangle[sides], np.where(place % 2, -1, 1), len(faces))).astype(np.int64)
    starts = np.append(0, np.flatnonzero(np.diff(part)) + 1)
    bounds = np.append(0, open_sides)[np.append(starts, len(faces))]  # open edges of the parts before
    ends = open_sides == bounds[part]
    run = np.append(0, np.cumsum(ends | np.append(np.diff(part) != 0, False))[:-1])
    # A run in which each triangle stands twice is no piece: such files write every triangle twice. A part with open
    # edges is not cut into runs: a triangle that two pieces share stands in one of them only.
    doubled = np.bincount(run[_is_repeated(faces, run)], minlength=run[-1] + 1) == np.bincount(run)
    keep_whole = np.isin(part, part[doubled[run]]) | (np.diff(bounds) > 0)[part]
    run = np.where(keep_whole, part, part[-1] + 1 + run)
    used, corners = np.unique(np.column_stack([np.repeat(run, 3), faces.reshape(-1)]), axis=0, return_inverse=True)
    return vertices[used[:, 1]], corners.reshape(-1, 3)


def _is_repeated(faces: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """Return which triangles (m,) stand more than once in their piece, turned over or not."""
    key = np.column_stack([piece, np.sort(faces, axis=1)])
    _, number, times = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(times[number.reshape(-1)] > 1)


def _once(faces: np.ndarray) -> np.ndarray:
    """Return the triangles without copies: also those turned over in pieces of which each triangle has a copy."""
    piece = joined_by_edges(faces, int(faces.max()) + 1)
    doubled = np.bincount(piece[_is_repeated(faces, piece)], minlength=piece.max() + 1) == np.bincount(piece)
    shift = faces.argmin(axis=1)[:, None] + np.arange(3)
    turned = np.take_along_axis(faces, shift % 3, axis=1)  # from the lowest corner on, the way round kept
    key = np.where(doubled[piece][:, None], np.sort(faces, axis=1), turned)
    return faces[np.sort(np.unique(key, axis=0, return_index=True)[1])]


def _pairs(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs (k, 2) of triangles alone at one edge, and whether both go along it the same way."""
    number, up, triangle = edges_of(faces, count)
    order = np.argsort(number, kind="stable")
    order = order[np.bincount(number)[number[order]] == 2].reshape(-1, 2)
    return triangle[order], up[order[:, 0]] == up[order[:, 1]]


def _turned_alike(faces: np.ndarray, count: int) -> tuple[np.ndarray, int]:
    """Return the triangles with those turned over that go along an edge the way their neighbour does."""
    n = len(faces)
    pairs, differ = _pairs(faces, count)
    # Each triangle stands twice, as it is and turned over; what agrees is one component.
    i, j = pairs.T
    ends = np.concatenate([np.where(differ, j + n, j), np.where(differ, j, j + n)])
    part = _components(np.concatenate([i, i + n]), ends, 2 * n)
    turn = part[:n] > part[n:]
    # A piece keeps the way of most of its triangles.
    piece = np.minimum(part[:n], part[n:])
    share = np.bincount(piece, turn) / np.maximum(np.bincount(piece), 1)
    turn ^= share[piece] > 0.5
    turned = faces.copy()
    turned[turn] = turned[turn][:, ::-1]
    return turned, int(turn.sum())


def _patches(faces: np.ndarray, number: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sides (k, 2) of triangles that are alone at an edge, and the patch (m,) of each triangle they join."""
    order = np.argsort(number, kind="stable")
    two = order[np.bincount(number)[number[order]] == 2].reshape(-1, 2)
    return two, _components(triangle[two[:, 0]], triangle[two[:, 1]], len(faces))


def _with_shared_twice(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the triangles with those turned over, too, of the smallest of three patches that share all their edges."""
    number, _, triangle = edges_of(faces, len(vertices))
    _, patch = _patches(faces, number, triangle)
    times = np.bincount(number)[number]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    area = np.bincount(patch, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    at_three = np.flatnonzero(times == 3)
    three = patch[triangle[at_three[np.argsort(number[at_three], kind="stable")]]].reshape(-1, 3)
    three = three[(np.diff(np.sort(three, axis=1), axis=1) > 0).all(axis=1)]
    smallest = np.bincount(three[np.arange(len(three)), area[three].argmin(axis=1)], minlength=len(area))
    around = np.bincount(patch[triangle[times != 2]], minlength=len(area))
    shared = (around > 0) & (smallest == around)
    return np.concatenate([faces, faces[shared[patch]][:, ::-1]])


def _parted_at_edges(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices of their own for triangles that are not joined, where more than two meet at an edge."""
    number, up, triangle = edges_of(faces, len(vertices))
    two, patch = _patches(faces, number, triangle)
    order = np.argsort(number, kind="stable")
    crowded = order[np.bincount(number)[number[order]] > 2]
    starts = np.append(0, np.flatnonzero(np.diff(number[crowded])) + 1)
    joined = [two]
    for sides in np.split(crowded, starts[1:]):
        angle = _angles(vertices, faces, sides, up[sides])
        joined.append(_joined_inside(sides, angle, up[sides], patch[triangle[sides]]))
    pairs = np.concatenate(joined)
    # Corners (3 m,) of joined triangles at one end of their edge are one vertex.
    corner = np.arange(3 * len(faces)).reshape(-1, 3)
    start, end = corner.T.reshape(-1), np.roll(corner, -1, axis=1).T.reshape(-1)
    low, high = np.where(up, start, end), np.where(up, end, start)
    one, other = pairs.T
    vertex = _components(np.concatenate([low[one], high[one]]), np.concatenate([low[other], high[other]]), corner.size)
    _, first = np.unique(vertex, return_index=True)
    return vertices[faces.reshape(-1)[first]], vertex.reshape(-1, 3).astype(np.int64)


def _angles(vertices: np.ndarray, faces: np.ndarray, sides: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the angle (k,) of triangles about their common edge, counter-clockwise as seen against its way up."""
    m = len(faces)
    row, column = sides % m, sides // m
    start, end = faces[row, column], faces[row, (column + 1) % 3]
    low, high = (start[0], end[0]) if up[0] else (end[0], start[0])
    along = vertices[high] - vertices[low]
    along = along / np.linalg.norm(along)
    to = vertices[faces[row, (column + 2) % 3]] - vertices[low]
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    return np.asarray(np.arctan2(to @ np.cross(along, aside), to @ aside))


def _joined_inside(sides: np.ndarray, angle: np.ndarray, up: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """Return the pairs (k, 2) of sides at one edge between which, about it, is the inner side of both.

    A triangle that goes up the edge has its inner side before its angle, another behind. Of triangles that lie on each
    other those that end a space come first. A space is ended by a triangle of the same `patch` if there is one.
    """
    order = np.argsort(angle)
    gaps = np.diff(angle[order], append=angle[order[0]] + 2 * np.pi)
    order = np.roll(order, -1 - int(gaps.argmax()))
    apart = np.mod(np.diff(angle[order]), 2 * np.pi) > _SAME_RAD
    group = np.empty(len(order), int)
    group[order] = np.append(0, np.cumsum(apart))
    copy = np.where(up, 1, -1) * np.arange(len(sides))
    order = np.lexsort((copy, ~up, group))
    pairs: list[tuple[int, int]] = []
    begun, left = list[int](), order.tolist()
    for _ in range(2):  # a space may go past the angle that the order starts with
        again = []
        for k in left:
            if not up[k]:
                begun.append(k)
            elif begun:
                same = [j for j in begun if patch[j] == patch[k]]
                begun.remove(mate := (same or begun)[-1])
                pairs.append((int(sides[mate]), int(sides[k])))
            else:
                again.append(k)
        left = again
    return np.array(pairs, int).reshape(-1, 2)
