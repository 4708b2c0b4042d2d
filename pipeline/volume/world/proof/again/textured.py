"""Whether the texture of a volume's rock lies where the builder lays it: along walls and up, or level."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.bundle import mesh_file
from pipeline.errors import ArtifactError
from pipeline.types import Mesh
from pipeline.volume.world.surface.show import is_painted
from pipeline.volume.world.surface.texture import texture_axes

_AWAY_M = 0.75  # from its place before the rock was displaced; 0.40 in Wheal Pell
_REPEAT_M = (0.2, 1e5)  # that a picture may cover
_STRETCH = (0.1, 6.0)  # texture a metre of rock, along the way that it changes most; 0.23 to 3.7 in Wheal Pell
_SMALL_M2, _THIN_M = 1e-4, 0.01  # faces that are smaller or narrower show nothing of it
_DIGITS = 4  # of a length that is read off
_TINY = 1e-12


def require_textured(folder: Path, chunks: Mapping[str, Mesh]) -> None:
    """Compare the texture coordinates of rock with the places of its vertices.

    The picture repeats, and then a coordinate is that of its place, or each piece of rock has a part of it. The length
    that it covers is read off.

    Raises
    ------
    ArtifactError
        With the file, the place, the value and the limit.
    """
    names, meshes = list(chunks), list(chunks.values())
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    places = np.concatenate([mesh.vertices for mesh in meshes])
    laid = np.concatenate([mesh.texcoords for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]).astype(np.int64)

    def refuse(vertex: int, fault: str) -> None:
        name = names[int(np.searchsorted(starts, vertex, side="right")) - 1]
        raise ArtifactError(f"{folder / mesh_file(name)}: at {places[vertex].round(3).tolist()} m {fault}")

    piece = _pieces(faces, len(places))
    packed = is_painted([laid])
    repeat_m = _repeat_m(places, laid, piece, packed)
    if not _REPEAT_M[0] <= repeat_m <= _REPEAT_M[1]:
        raise ArtifactError(
            f"{folder / mesh_file(names[0])}: the texture covers {repeat_m:g} m once, want {_REPEAT_M[0]:g} to "
            f"{_REPEAT_M[1]:g} m"
        )
    away = _away_m(places, laid * repeat_m, piece, packed)
    if not away.max() <= _AWAY_M:
        worst = int(away.argmax())
        refuse(worst, f"the texture is that of a place {away[worst]:.3f} m away, want at most {_AWAY_M:g} m")
    stretch, seen = _stretch(places[faces], laid[faces] * repeat_m)
    wrong = seen & ~((stretch >= _STRETCH[0]) & (stretch <= _STRETCH[1]))
    if wrong.any():
        face = int(np.flatnonzero(wrong)[0])
        refuse(
            int(faces[face, 0]),
            f"a face has {stretch[face]:.3f} m of texture a metre, want {_STRETCH[0]:g} to {_STRETCH[1]:g}",
        )


def _pieces(faces: np.ndarray, count: int) -> np.ndarray:
    """Return the number (n,) of the piece that each vertex belongs to; vertices of two pieces are never one."""
    ends = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    graph = coo_matrix((np.ones(len(ends[0]), np.int8), ends), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _repeat_m(places: np.ndarray, laid: np.ndarray, piece: np.ndarray, packed: bool) -> float:
    """Return the length, m, that a picture covers; 0 if its texture runs along no axes.

    It is read off the extents of the pieces, along the axes that fit each best, and where the picture repeats off the
    places that are far from the origin.
    """
    count = np.bincount(piece)
    texture = laid - _mean(laid, piece, count)[piece]
    best, per_m, size = np.full(len(count), np.inf), np.zeros(len(count)), np.zeros(len(count))
    found = np.zeros_like(laid)
    for axes in texture_axes():
        along = places @ axes.T
        apart = along - _mean(along, piece, count)[piece]
        both, own = (np.bincount(piece, (apart * other).sum(axis=1)) for other in (texture, apart))
        slope = both / np.maximum(own, _TINY)
        rest = np.bincount(piece, ((texture - slope[piece, None] * apart) ** 2).sum(axis=1))
        better = rest < best
        best[better], per_m[better], size[better] = rest[better], slope[better], own[better]
        found[better[piece]] = along[better[piece]]
    if packed:
        order = np.argsort(per_m)
        whole = np.cumsum(size[order])
        middle = per_m[order][int(np.searchsorted(whole, whole[-1] / 2))]
    else:
        far = np.abs(found) >= np.median(np.abs(found))
        middle = float(np.median(laid[far] / np.where(found[far] == 0, _TINY, found[far])))
    return round(1 / float(middle), _DIGITS) if middle > 0 else 0.0


def _away_m(places: np.ndarray, laid_m: np.ndarray, piece: np.ndarray, packed: bool) -> np.ndarray:
    """Return how far (n,) m the texture of vertices is from their places, along the axes that fit their piece best."""
    order = np.argsort(piece, kind="stable")
    first = np.searchsorted(piece[order], np.arange(piece.max() + 1))
    best, found = np.full(len(first), np.inf), np.full(len(places), np.inf)
    for axes in texture_axes():
        off = laid_m - places @ axes.T
        if packed:
            some = off[order]
            middle = (np.minimum.reduceat(some, first) + np.maximum.reduceat(some, first)) / 2
            off = off - middle[piece]
        away = np.abs(off).max(axis=1)
        most = np.maximum.reduceat(away[order], first)
        better = most < best
        best[better] = most[better]
        found[better[piece]] = away[better[piece]]
    return found


def _mean(values: np.ndarray, piece: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.column_stack([np.bincount(piece, column) for column in values.T]) / count[:, None]


def _stretch(corners: np.ndarray, laid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how many metres of texture lie on a metre of each face (m,) at most, and which are large enough to say."""
    one, other = (corners[:, k] - corners[:, 0] for k in (1, 2))
    double = np.linalg.norm(np.cross(one, other), axis=1)
    long = np.linalg.norm(one, axis=1)
    seen = (double / 2 > _SMALL_M2) & (
        double / np.maximum(np.maximum(long, np.linalg.norm(other, axis=1)), _TINY) > _THIN_M
    )
    across = double / np.maximum(long, _TINY)
    ahead = (one * other).sum(axis=1) / np.maximum(long, _TINY)
    first, second = (laid[:, k] - laid[:, 0] for k in (1, 2))
    x = first / np.maximum(long, _TINY)[:, None]
    y = (second - ahead[:, None] * x) / np.maximum(across, _TINY)[:, None]
    square, rest, mixed = (x * x).sum(axis=1), (y * y).sum(axis=1), (x * y).sum(axis=1)
    return np.sqrt((square + rest + np.hypot(square - rest, 2 * mixed)) / 2), seen
