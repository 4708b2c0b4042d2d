"""Whether the normals of visible rock are those that the builder gives its faces, and no face is turned over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from minexplore.bundle import mesh_file
from pipeline.errors import ArtifactError
from pipeline.surface.mesh.normals import SMOOTH_DEG, ShadedMesh, normals_and_angles, shade_mesh
from pipeline.types import Mesh

_SAME = 1e-4  # of a normal, as the sine of an angle, beside what rounded places change
_UNSURE = 1e-4  # share of vertices, hardly in front of all faces, that rounding may decide; 1e-5 of the default
_NARROW = 0.1  # cosine of the angle between a mean and a face that it is hardly in front of
_DEG = 0.1  # of a crease that is read off the normals


@dataclass(frozen=True)
class JoinedRock:
    """Chunks of one surface whose equal vertices are one: `places` (n, 3) m in 32 bits, and `corners` (m, 3) of faces.

    `own` (m, 3) are the corners as the chunks have them, one after another, and `first` where each chunk's faces begin.
    """

    places: np.ndarray
    corners: np.ndarray
    own: np.ndarray
    first: np.ndarray

    @classmethod
    def of(cls, chunks: list[Mesh]) -> Self:
        """Join chunks; vertices on the border of two are equal to the last bit."""
        points = np.concatenate([chunk.vertices for chunk in chunks]).astype(np.float32) + np.float32(0.0)
        starts = np.cumsum([0, *(len(chunk.vertices) for chunk in chunks)])
        own = np.concatenate([chunk.faces + start for chunk, start in zip(chunks, starts, strict=False)])
        _, first, index = np.unique(
            points.view(np.dtype((np.void, 12))).ravel(), return_index=True, return_inverse=True
        )
        faces = np.cumsum([0, *(len(chunk.faces) for chunk in chunks)])
        return cls(points[first], index.ravel()[own], own, faces)


def require_shading(folder: Path, chunks: Mapping[str, Mesh], rock: JoinedRock) -> None:
    """Make the normals of a surface again and compare them, and refuse a face that is turned over.

    The angle of a crease is read off the normals. Where no mean of them is in front of all faces of a vertex, few may
    differ.

    Raises
    ------
    ArtifactError
        With the file, the place and how it differs.
    """
    meshes = list(chunks.values())
    _require_one_way(folder, list(chunks), rock)
    given = [mesh.normals is not None for mesh in meshes]
    if not any(given):
        return
    if not all(given):
        name = next(name for name, mesh in chunks.items() if mesh.normals is None)
        raise ArtifactError(f"{folder / mesh_file(name)}: no normals, others have them")
    stated = np.concatenate([mesh.normals for mesh in meshes])[rock.own]  # type: ignore[misc]
    normal = _face_normals(rock)
    wrong, count = _unlike(rock, stated, normal, SMOOTH_DEG)
    if wrong.any():
        wrong, count = min((wrong, count), _unlike(rock, stated, normal, _crease_deg(rock, stated, normal)), key=_size)
    if wrong.any():
        face, side = (int(at[0]) for at in np.nonzero(wrong))
        name = list(chunks)[int(np.searchsorted(rock.first, face, side="right")) - 1]
        raise ArtifactError(
            f"{folder / mesh_file(name)}: the normal at {rock.places[rock.corners[face, side]].round(3).tolist()} m is "
            f"{stated[face, side].round(3).tolist()}: not that of its faces; {count} vertices have other ones"
        )


def _size(found: tuple[np.ndarray, int]) -> int:
    return int(found[0].sum())


def _unlike(rock: JoinedRock, stated: np.ndarray, normal: np.ndarray, crease_deg: float) -> tuple[np.ndarray, int]:
    """Return which corners (m, 3) have not the normal of the builder, and the number of their vertices."""
    made = shade_mesh(rock.places.astype(np.float64), rock.corners, crease_deg)
    off = np.linalg.norm(np.cross(stated, made.normals[made.faces]), axis=2)
    facing = np.einsum("mki,mki->mk", stated, made.normals[made.faces]) > 0
    wrong = ~((off <= _SAME + _rounding(rock, made)[made.faces]) & facing)
    front = np.einsum("mki,mi->mk", made.normals[made.faces], normal)
    narrow = np.zeros(len(rock.places), bool)
    narrow[rock.corners[made.tilted[made.faces] | (front < _NARROW)]] = True
    unsure = wrong & narrow[rock.corners] & (np.einsum("mki,mi->mk", stated, normal) > 0)
    vertices = np.unique(rock.corners[unsure])
    if (
        len(vertices) <= max(1, _UNSURE * len(rock.places))
        and not np.isin(rock.corners[wrong & ~unsure], vertices).any()
    ):
        wrong &= ~unsure
    return wrong, len(np.unique(rock.corners[wrong]))


def _rounding(rock: JoinedRock, made: ShadedMesh) -> np.ndarray:
    """Return how far (k,) places in 32 bits turn the mean of the faces' normals at each vertex, rad, at most.

    It is 5e-4 in the middle of the default world, and more at needles: a face 1 mm high at 230 m turns by 0.03.
    """
    corners = rock.places[rock.corners].astype(np.float64)
    normal, angle = normals_and_angles(corners)
    step_m = np.sqrt(3) / 2 * np.spacing(np.abs(rock.places).max(axis=1))[rock.corners].max(axis=1)
    side_m = np.maximum(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2), step_m[:, None])
    doubled_m2 = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    turned = 2 * step_m * side_m.max(axis=1) / np.maximum(doubled_m2, step_m**2)
    weighed = 2 * step_m[:, None] * (1 / side_m + 1 / np.roll(side_m, 1, axis=1))
    moved = (angle * np.minimum(turned, 2)[:, None] + weighed).ravel()
    vertex, count = made.faces.ravel(), len(made.source)
    mean = [np.bincount(vertex, (angle * normal[:, k, None]).ravel(), count) for k in range(3)]
    found: np.ndarray = np.bincount(vertex, moved, count) / np.maximum(np.linalg.norm(mean, axis=0), 1e-30)
    return found


def _face_normals(rock: JoinedRock) -> np.ndarray:
    """Return the unit normal (m, 3) of each face."""
    a, b, c = np.moveaxis(rock.places[rock.corners].astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    found: np.ndarray = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    return found


def _pairs(rock: JoinedRock) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return faces and sides (3 m,) in the order of their edges, and which (3 m - 1,) have the edge of the next one."""
    ends = np.sort(np.stack([rock.corners, np.roll(rock.corners, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    edge = ends[:, 0].astype(np.int64) * len(rock.places) + ends[:, 1]
    order = np.argsort(edge, kind="stable")
    same: np.ndarray = np.diff(edge[order]) == 0
    return order // 3, order % 3, same


def _require_one_way(folder: Path, names: list[str], rock: JoinedRock) -> None:
    """Refuse two faces, the only ones at an edge, that pass it the same way: one of them is turned over.

    Where two sides of thin rock are one in 32 bits, an edge has more.
    """
    face, side, same = _pairs(rock)
    two = same & ~np.append(same[1:], False) & ~np.append(False, same[:-1])
    start = rock.corners[face, side]
    at = np.flatnonzero(two & (start[:-1] == start[1:]))
    if len(at):
        name = names[int(np.searchsorted(rock.first, face[at[0]], side="right")) - 1]
        raise ArtifactError(
            f"{folder / mesh_file(name)}: two faces on one side of an edge at {rock.places[start[at[0]]].tolist()} m: "
            "one is turned over"
        )


def _crease_deg(rock: JoinedRock, stated: np.ndarray, normal: np.ndarray) -> float:
    """Return the angle, deg, that best parts the edges on whose two sides normals differ from all others."""
    face, side, same = _pairs(rock)
    at = np.flatnonzero(same)
    one, other = face[at], face[at + 1]
    angle = np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", normal[one], normal[other]), -1, 1)))
    start = rock.corners[one, side[at]]
    own = (rock.corners[other] == start[:, None]).argmax(axis=1)
    split = np.linalg.norm(stated[one, side[at]] - stated[other, own], axis=1) > _SAME
    order = np.argsort(angle)
    errors = np.append(0, np.cumsum(split[order])) + np.append(np.cumsum(~split[order][::-1])[::-1], 0)
    ends = np.append(angle[order], SMOOTH_DEG)
    return float(min(SMOOTH_DEG, max(_DEG, round(float(ends[int(errors.argmin())]) / _DEG) * _DEG)))
