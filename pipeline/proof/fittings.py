"""Whether the visible floor lies on the floor of the workings, and furniture hangs along their ribs and roof."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from minexplore.bundle import COVER_M, FURNITURE_ABOVE_M, LINES_ABOVE_M, decode_msh, is_cover, mesh_file
from pipeline.errors import ArtifactError
from pipeline.geometry.wall_distance import distances_to_walls
from pipeline.proof.same_surface import NearestFace

_FROM_RIB_M = 0.8  # of what hangs lower than lines do: a plate on bumps of 0.45 m, and a little of the bolt
_FROM_ROCK_M = 1.3  # of all furniture: a duct of 0.6 m under bumps of the roof
_BEHIND_M = 1.0  # of the outline; the visible rock hides what lies there
_SAMPLE_M, _LONGEST_M = 0.25, 40.0  # faces lie within a tile, or a little beyond


def require_fittings(folder: Path, names: list[str], free: Polygon, smooth: np.ndarray) -> None:
    """Check the visible floor and the furniture of a bundle whose smooth surface has been made again.

    The floor faces up and lies between the flat floor and `COVER_M`. Furniture hangs at `FURNITURE_ABOVE_M` or more
    above the floor, below `LINES_ABOVE_M` only beside a rib, and nowhere far from ribs and roof. Faces are sampled, so
    that a panel whose corners are allowed is found as well.

    Parameters
    ----------
    folder : Path
    names : list of str
        The fittings' meshes.
    free : shapely.Polygon, m
    smooth : (n, 3, 3), m
        The triangles of the smooth surface.

    Raises
    ------
    ArtifactError
        With the file, the place and the limit.
    """
    if not names:
        return
    near, around = NearestFace(smooth), free.buffer(_BEHIND_M)
    shapely.prepare(around)
    for name in names:
        path = folder / mesh_file(name)
        triangles = _triangles(path)
        longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
        _refuse(path, triangles[:, 0], longest > _LONGEST_M, f"an edge of more than {_LONGEST_M:g} m")
        points = face_samples(triangles, _SAMPLE_M)
        outside = ~shapely.contains_xy(around, points[:, 0], points[:, 1])
        _refuse(path, points, outside, f"outside the workings by more than {_BEHIND_M:g} m")
        if is_cover(name):
            normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2]
            wrong = (points[:, 2] < 0) | (points[:, 2] > COVER_M + 1e-6)
            _refuse(path, points, wrong, f"not within 0 and {COVER_M:g} m above the floor")
            _refuse(path, triangles.mean(axis=1), normal <= 0, "a face that does not face up")
            continue
        _refuse(path, points, points[:, 2] < FURNITURE_ABOVE_M - 1e-6, f"below {FURNITURE_ABOVE_M:g} m")
        low = points[:, 2] < LINES_ABOVE_M - 1e-6
        off = np.zeros(len(points))
        off[low] = distances_to_walls(free, points[low, :2])
        _refuse(
            path, points, off > _FROM_RIB_M, f"below {LINES_ABOVE_M:g} m and more than {_FROM_RIB_M:g} m from a rib"
        )
        apart, _ = near.query(points)
        _refuse(path, points, apart > _FROM_ROCK_M, f"more than {_FROM_ROCK_M:g} m from the workings' surface")


def face_samples(triangles: np.ndarray, most_m: float) -> np.ndarray:
    """Return the corners of triangles (n, 3, 3) and points on them, (m, 3), no two neighbours farther than `most_m`."""
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(1, np.ceil(longest / most_m).astype(int))
    points = []
    for count in np.unique(steps).tolist():
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        inside = i + j <= count
        weights = np.column_stack([i, j, count - i - j])[inside] / count
        points.append(np.einsum("pk,nkd->npd", weights, triangles[steps == count]).reshape(-1, 3))
    return np.concatenate(points)


def _triangles(path: Path) -> np.ndarray:
    mesh = decode_msh(path.read_bytes())
    return mesh.vertices[mesh.faces].astype(np.float64)


def _refuse(path: Path, places: np.ndarray, wrong: np.ndarray, how: str) -> None:
    if wrong.any():
        x, y, z = places[int(wrong.argmax())]
        raise ArtifactError(f"{path}: at ({x:.2f}, {y:.2f}, {z:.2f}) m: {how}; it is seen and not touched")
