"""Formats of point clouds and scanned meshes: each reader yields blocks of points in the file's units."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.params.reader_limits import FILE, reader_limits

LEAST_POINTS = 100
_TEXT = {".dat", ".xyz", ".txt"}
_MESHES = {".stl", ".obj"}
_BLOCK = 1_000_000
_LAS_HEAD, _LAS_RECORDS_AT, _LAS_EXTENDED_AT = 375, 100, 243  # bytes of the header and in it
_PLY_HEAD = 65_536  # bytes in which a header's counts are looked for
_HUGE = 100  # times the most points of a mesh: beyond it, a vertex lies far outside any workings


def read_blocks(path: Path, points_per_unit2: float) -> Iterator[np.ndarray]:
    """Yield the points of a cloud or mesh in blocks (n, 3), in the file's units.

    Text and LAS files are read block by block. PLY, PCD and meshes are read at once. Meshes are sampled.

    Parameters
    ----------
    path : Path
        The suffix names the format.
    points_per_unit2 : float
        Density at which a mesh is sampled, points per squared unit of the file.

    Raises
    ------
    InputError
        If the format is unknown, or the file is empty, truncated, too large, not numeric or not finite.
    """
    suffix = path.suffix.lower()
    if suffix in _TEXT:
        return _text_blocks(path)
    if suffix in {".las", ".laz"}:
        return _las_blocks(path)
    if suffix in {".ply", ".pcd"} | _MESHES:
        most = reader_limits().cloud_bytes
        if path.stat().st_size > most:
            raise InputError(
                f"{path}: {path.stat().st_size:,} bytes; the limit for PLY, PCD and meshes is {most:,} "
                f"(cloud_bytes in {FILE}); convert the file to LAZ or XYZ"
            )
        return _whole_file(path, suffix, points_per_unit2)
    raise InputError(f"{path}: no reader for {suffix!r}; there are .dat .xyz .txt .ply .pcd .las .laz .stl .obj")


def _whole_file(path: Path, suffix: str, points_per_unit2: float) -> Iterator[np.ndarray]:
    if suffix == ".pcd":
        return iter([_pcd_points(path)])
    if suffix == ".ply" and not _has_faces(path):
        return iter([_ply_points(path)])
    return _mesh_blocks(path, points_per_unit2)


def _text_blocks(path: Path) -> Iterator[np.ndarray]:
    """Yield rows `x y z ...`; in `.dat` files rows `time x y z intensity` below one header line."""
    has_header = path.suffix.lower() == ".dat"
    columns = (1, 2, 3) if has_header else (0, 1, 2)
    with path.open(encoding="utf-8", errors="replace") as stream:
        number = 0
        if has_header:
            header = stream.readline()
            number = 1
            if _is_row(header):
                raise InputError(f"{path}:1: a row of numbers, expected the header line (time x y z intensity)")
        while lines := list(itertools.islice(stream, _BLOCK)):
            yield _parse_rows(path, lines, number, columns)
            number += len(lines)
    if number <= has_header:
        raise InputError(f"{path}: no rows")


def _is_row(line: str) -> bool:
    try:
        return len([float(word) for word in line.split()]) >= 3
    except ValueError:
        return False


def _parse_rows(path: Path, lines: list[str], before: int, columns: tuple[int, ...]) -> np.ndarray:
    try:
        block = np.loadtxt(lines, usecols=columns, ndmin=2, comments="#")
    except (ValueError, IndexError):
        block = None
    if block is not None and np.isfinite(block).all():
        return block
    for number, line in enumerate(lines, start=before + 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        if len(words) <= max(columns):
            raise InputError(
                f"{path}:{number}: {len(words)} columns, at least {max(columns) + 1} are needed; is the file truncated?"
            )
        for word in (words[k] for k in columns):
            try:
                finite = np.isfinite(float(word))
            except ValueError:
                raise InputError(f"{path}:{number}: {word[:40]!r} is not a number") from None
            if not finite:
                raise InputError(f"{path}:{number}: {word} is not finite")
    raise InputError(f"{path}: rows {before + 1} to {before + len(lines)} cannot be read as numbers")


def _las_blocks(path: Path) -> Iterator[np.ndarray]:
    import laspy

    _require_records(path)
    try:
        with laspy.open(path) as reader:
            count = 0
            for chunk in reader.chunk_iterator(_BLOCK):
                count += len(chunk)
                yield _require_finite(path, np.column_stack([chunk.x, chunk.y, chunk.z]))
            if count < reader.header.point_count:
                raise InputError(
                    f"{path}: {count} points, but its header states {reader.header.point_count}; the file is truncated"
                )
    except (laspy.errors.LaspyException, OSError, ValueError, RuntimeError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as LAS or LAZ ({error})") from error


def _require_records(path: Path) -> None:
    """Refuse a header that states more variable length records than the file can hold; laspy would look for each.

    References
    ----------
    ASPRS, LAS Specification 1.4, tables 3 and 20
    """
    with path.open("rb") as stream:
        head, size = stream.read(_LAS_HEAD), path.stat().st_size
    for at, least in ((_LAS_RECORDS_AT, 54), (_LAS_EXTENDED_AT, 60)):
        count = int.from_bytes(head[at : at + 4], "little")
        if count * least > size and (at == _LAS_RECORDS_AT or head[25:26] >= b"\4"):
            raise InputError(
                f"{path}: its header states {count:,} variable length records, which need {count * least:,} bytes; "
                f"the file has {size:,}"
            )


def _pcd_points(path: Path) -> np.ndarray:
    import open3d

    cloud = open3d.io.read_point_cloud(path, remove_nan_points=False, remove_infinite_points=False)
    if not len(cloud.points):
        raise InputError(f"{path}: has no points, is truncated, or is not a PCD file")
    _require_rows(path, len(cloud.points))
    return _require_finite(path, np.asarray(cloud.points))


def _require_rows(path: Path, points: int) -> None:
    """Refuse a PCD file in ASCII with another number of rows than points: Open3D would add points of zeros."""
    with path.open("rb") as stream:
        for line in stream:
            words = line.split()
            if words[:1] == [b"DATA"]:
                rows = sum(1 for row in stream if row.strip()) if words[1:] == [b"ascii"] else points
                if rows != points:
                    raise InputError(f"{path}: {rows} rows, but its header states {points} points; is it truncated?")
                return


def _ply_points(path: Path) -> np.ndarray:
    vertices, _ = _load(path, "PLY")  # Open3D fills a truncated PLY with zeros
    return _require_finite(path, vertices)


def _has_faces(path: Path) -> bool:
    return _stated(path, b"face") != 0


def _stated(path: Path, element: bytes) -> int:
    """Return how many vertices or faces the header of a PLY file states; 0 where it states none."""
    with path.open("rb") as stream:
        head = stream.read(_PLY_HEAD).split(b"end_header")[0]
    counts = [line.split()[2:] for line in head.splitlines() if line.split()[:2] == [b"element", element]]
    return int(counts[0][0]) if counts and counts[0] and counts[0][0][:18].isdigit() and len(counts[0][0]) < 19 else 0


def _load(path: Path, format_name: str, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    """Load vertices (n, 3) and faces (m, 3), none for a cloud, by trimesh.

    The open file keeps it from following names of materials and textures in it.
    """
    import trimesh

    try:
        with path.open("rb") as stream:
            found: Any = trimesh.load(stream, path.suffix.lower()[1:], process=False, **options)
        vertices = np.asarray(found.vertices, float).reshape(-1, 3)
        faces = np.asarray(getattr(found, "faces", ()), np.int64).reshape(-1, 3)
    except MemoryError:
        raise
    except Exception as error:  # trimesh passes on every exception of its parsers
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: cannot be read as {format_name} ({type(error).__name__}: {reason})") from error
    if path.suffix.lower() == ".ply":
        for found_now, element in ((len(vertices), b"vertex"), (len(faces), b"face")):
            if found_now < _stated(path, element):  # polygons are cut into triangles, so there may be more
                raise InputError(
                    f"{path}: {found_now} of {_stated(path, element)} {element.decode()} elements that its header "
                    "states; is it truncated?"
                )
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise InputError(
            f"{path}: a face has vertex {faces.min()} or {faces.max()}, there are {len(vertices)}; is it truncated?"
        )
    return vertices, faces


def _mesh_blocks(path: Path, points_per_unit2: float) -> Iterator[np.ndarray]:
    """Yield points sampled on a mesh, block by block."""
    import trimesh

    vertices, faces = _load(path, "a mesh", force="mesh")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if not len(faces) or not np.isfinite(vertices).all() or not 0 < mesh.area < np.inf:
        raise InputError(f"{path}: has no faces, or a vertex is not finite")
    wanted, most = mesh.area * points_per_unit2, 10 * _BLOCK
    if wanted > _HUGE * most:
        raise InputError(
            f"{path}: its area of {mesh.area / 1e6:.4g} million square units needs {wanted:.2g} points, want at most "
            f"{_HUGE * most:.2g}; are its units right (surface.cloud.units)?"
        )
    count = min(max(LEAST_POINTS, int(wanted)), most)
    for block, first in enumerate(range(0, count, _BLOCK)):
        yield np.asarray(trimesh.sample.sample_surface(mesh, min(_BLOCK, count - first), seed=block)[0])


def _require_finite(path: Path, points: np.ndarray) -> np.ndarray:
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        raise InputError(
            f"{path}: {int(bad.sum())} of {len(points)} points are not finite "
            f"(the first is number {int(bad.argmax()) + 1})"
        )
    return points
