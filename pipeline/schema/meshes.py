"""What the meshes of a bundle may hold. Many are checked at once, because a world has hundreds of small ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from minexplore.bundle import (
    COVER_M,
    FURNITURE,
    FURNITURE_ABOVE_M,
    LINES_ABOVE_M,
    MESHES,
    BundleError,
    TriangleMesh,
    decode_msh,
    is_cover,
    is_fitting,
    mesh_file,
    mesh_of,
)

_MOST_REPEATS = 1e7  # of the texture
_SLACK_M = 1e-6  # of heights, which are in 32 bits
_AT_ONCE_BYTES = 16 << 20  # of meshes that are copied into one array


def _over_level(points_m: np.ndarray) -> np.ndarray:
    found: np.ndarray = points_m[:, 2]
    return found


def check_meshes(
    files: Mapping[str, bytes],
    low: np.ndarray,
    high: np.ndarray,
    over_m: Callable[[np.ndarray], np.ndarray] = _over_level,
    is_level: bool = True,
) -> None:
    """Refuse meshes that no world has: lying counts, places outside the rock, faces of vertices that are not there.

    Parameters
    ----------
    files : dict of bytes by name
        A bundle's files; those below `meshes/` are checked.
    low, high : (3,) float64, m
        Corners of the box that holds all vertices.
    over_m : callable
        The heights (n,) m of points (n, 3) m over the floors, which are level at z = 0 without it.
    is_level : bool
        Whether heights hold for the visible floor as well; that of a volume is made again of its facets.

    Raises
    ------
    BundleError
        Naming the file, the value and the limit.
    """
    for names in _batches(files):
        meshes = [_decode(name, files[name]) for name in names]
        _check_places(names, [mesh.vertices for mesh in meshes], low, high)
        _check_fittings(names, meshes, over_m, is_level)
        _check_faces(names, meshes)
        _check_textures(names, meshes)
        _check_normals(names, meshes)


def _batches(files: Mapping[str, bytes]) -> Iterator[list[str]]:
    """Yield the names of the meshes in groups of about `_AT_ONCE_BYTES`."""
    names: list[str] = []
    size = 0
    for name, data in files.items():
        if not name.startswith(MESHES):
            continue
        names.append(name)
        size += len(data)
        if size >= _AT_ONCE_BYTES:
            yield names
            names, size = [], 0
    if names:
        yield names


def _decode(name: str, data: bytes) -> TriangleMesh:
    try:
        mesh = decode_msh(data)
    except ValueError as error:
        raise BundleError(f"{name}: {error}") from error
    count, stem = len(mesh.vertices), mesh_of(name)
    textured = 0 if is_fitting(stem) and not is_cover(stem) else count
    if count < 4 or not len(mesh.faces) or len(mesh.texcoords) != textured or len(mesh.normals) not in (0, count):
        raise BundleError(
            f"{name}: {count} vertices, {len(mesh.normals)} normals, {len(mesh.texcoords)} texture coordinates and "
            f"{len(mesh.faces)} faces; want 4 vertices or more, {textured} texture coordinates, a normal each or none"
        )
    return mesh


def _starts(arrays: list[np.ndarray]) -> np.ndarray:
    """Return where each array begins once they stand one after another."""
    counts = np.array([len(array) for array in arrays])
    return np.cumsum(counts) - counts


def _check_places(names: list[str], vertices: list[np.ndarray], low: np.ndarray, high: np.ndarray) -> None:
    """Check that vertices lie in the box. NaN fails as well."""
    along, starts = np.ascontiguousarray(np.concatenate(vertices).T), _starts(vertices)
    first, last = np.minimum.reduceat(along, starts, axis=1), np.maximum.reduceat(along, starts, axis=1)
    outside = np.argwhere(~((first >= low[:, None]) & (last <= high[:, None])))
    if len(outside):
        axis, k = outside[0]
        raise BundleError(
            f"{names[k]}: vertices from {first[axis, k]:g} to {last[axis, k]:g} m along axis {axis}, "
            f"the rock ends at {low[axis]:g} and {high[axis]:g} m"
        )


def _check_fittings(
    names: list[str], meshes: list[TriangleMesh], over_m: Callable[[np.ndarray], np.ndarray], is_level: bool
) -> None:
    """Check that fittings are at heights over the floors where fittings are; NaN fails as well."""
    for name, mesh in zip(names, meshes, strict=True):
        kind = mesh_of(name).partition("_")[0]
        if kind in FURNITURE or (is_level and is_fitting(mesh_of(name))):
            heights = over_m(mesh.vertices)
            _check_heights(mesh_of(name), float(heights.min()), float(heights.max()))


def _check_heights(name: str, lowest_m: float, highest_m: float) -> None:
    """Refuse a fitting's mesh that is not where fittings are: under a decimetre, or above every robot."""
    kind = name.partition("_")[0]
    least = 0.0 if is_cover(name) else FURNITURE_ABOVE_M if kind == "bolts" else LINES_ABOVE_M
    most = COVER_M if is_cover(name) else float("inf")
    if not (lowest_m >= least - _SLACK_M and highest_m <= most + _SLACK_M):
        wanted = f"{least:g} to {most:g} m" if is_cover(name) else f"{least:g} m or more"
        raise BundleError(
            f"{mesh_file(name)}: from {lowest_m:g} to {highest_m:g} m above the floor, want {wanted}; "
            "it is seen and not touched"
        )


def _check_faces(names: list[str], meshes: list[TriangleMesh]) -> None:
    faces = [mesh.faces.view(np.uint32).ravel() for mesh in meshes]
    highest = np.maximum.reduceat(np.concatenate(faces), _starts(faces))
    wrong = np.flatnonzero(highest >= [len(mesh.vertices) for mesh in meshes])
    if len(wrong):
        mesh = meshes[wrong[0]]
        raise BundleError(
            f"{names[wrong[0]]}: a face of vertex {mesh.faces.min()} or {mesh.faces.max()}, "
            f"there are {len(mesh.vertices)}"
        )


def _check_textures(names: list[str], meshes: list[TriangleMesh]) -> None:
    every = np.concatenate([mesh.texcoords.ravel() for mesh in meshes])
    if len(every) and not (every.min() >= -_MOST_REPEATS and every.max() <= _MOST_REPEATS):
        within = [bool((np.abs(mesh.texcoords) <= _MOST_REPEATS).all()) for mesh in meshes]
        raise BundleError(
            f"{names[within.index(False)]}: a texture coordinate that is no number, or beyond {_MOST_REPEATS:g}"
        )


def _check_normals(names: list[str], meshes: list[TriangleMesh]) -> None:
    if not _all_unit(np.concatenate([mesh.normals for mesh in meshes])):
        wrong = (name for name, mesh in zip(names, meshes, strict=True) if not _all_unit(mesh.normals))
        raise BundleError(f"{next(wrong)}: a normal whose length is not 1")


def _all_unit(normals: np.ndarray) -> bool:
    return bool((np.abs(np.einsum("ij,ij->i", normals, normals) - 1) < 1e-2).all())
