"""Formats of point clouds and scanned meshes: each reader yields blocks of points in the file's units, with colours."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.guard.reading_process import Payload, run_limited
from pipeline.params.reader_limits import FILE, reader_limits
from pipeline.scans.colours import with_colours
from pipeline.scans.e57_clouds import e57_blocks
from pipeline.scans.text_clouds import TEXT, text_blocks
from pipeline.scans.zipped_clouds import zipped_blocks

LEAST_POINTS = 100
_UNPACKED = 4  # times as large as its zip file is a cloud of text
_MESHES = (".stl", ".obj")
CLOUDS = (*TEXT, ".las", ".laz", ".ply", ".pcd", ".e57")
_BLOCK = 1_000_000
_BYTE = 255  # the greatest value of a channel
_LAS_HEAD, _LAS_RECORDS_AT, _LAS_EXTENDED_AT = 375, 100, 243  # bytes of the header and in it
_PLY_HEAD, _PLY_LINE = 65_536, 1000  # bytes of a header, and of a line in it
_HUGE = 100  # times the most points of a mesh: beyond it, a vertex lies far outside any workings


def run_on_cloud(task: str, arguments: dict[str, Any], path: Path) -> Payload:
    """Run a task that reads a cloud, in a process with limits; its time grows with the file."""
    limits, is_zip = reader_limits(), path.suffix.lower() == ".zip"
    extra_s = limits.cloud_s_per_gb * path.stat().st_size / 1e9 * (_UNPACKED if is_zip else 1)
    fresh = is_zip or path.suffix.lower() == ".pcd"  # Open3D reads it, whose threads do not survive a fork
    return run_limited(task, arguments, str(path), extra_s, fresh, limits.unpacked_bytes if is_zip else 0)


def read_blocks(path: Path, points_per_unit2: float) -> Iterator[np.ndarray]:
    """Yield the points of a cloud or mesh in blocks (n, 3), in the file's units, or (n, 6) of points with colours.

    Text and LAS files are read block by block, E57 files scan by scan. PLY, PCD and meshes are read at once. Meshes are
    sampled. The clouds of a zip file are read one after the other. Colours are red, green and blue as the file has
    them, from 0 to 65,535; a point without one is black.

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
    if suffix in TEXT:
        return text_blocks(path)
    if suffix == ".e57":
        return e57_blocks(path)
    if suffix == ".zip":
        return zipped_blocks(path, CLOUDS, lambda one: read_blocks(one, points_per_unit2))
    if suffix in {".las", ".laz"}:
        return _las_blocks(path)
    if suffix in {".ply", ".pcd", *_MESHES}:
        most = reader_limits().cloud_bytes
        if path.stat().st_size > most:
            raise InputError(
                f"{path}: {path.stat().st_size:,} bytes; the limit for PLY, PCD and meshes is {most:,} "
                f"(cloud_bytes in {FILE}); convert the file to LAZ or XYZ"
            )
        return _whole_file(path, suffix, points_per_unit2)
    raise InputError(f"{path}: no reader for {suffix!r}; there are {' '.join([*CLOUDS, *_MESHES])} .zip")


def _whole_file(path: Path, suffix: str, points_per_unit2: float) -> Iterator[np.ndarray]:
    if suffix == ".pcd":
        return iter([_pcd_points(path)])
    if suffix == ".ply" and not read_ply_header(path).get("face"):
        return iter([_ply_points(path)])
    return _mesh_blocks(path, points_per_unit2)


def _las_blocks(path: Path) -> Iterator[np.ndarray]:
    import laspy

    _require_records(path)
    try:
        # The parallel decoder's threads do not survive a fork.
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
            count = 0
            for chunk in reader.chunk_iterator(_BLOCK):
                count += len(chunk)
                points = _require_finite(path, np.column_stack([chunk.x, chunk.y, chunk.z]))
                names = set(chunk.point_format.dimension_names)
                has_colours = names >= {"red", "green", "blue"}
                yield with_colours(points, (chunk.red, chunk.green, chunk.blue)) if has_colours else points
            if count < reader.header.point_count:
                raise InputError(
                    f"{path}: {count} points, but its header states {reader.header.point_count}; the file is truncated"
                )
    except (laspy.errors.LaspyException, OSError, ValueError, RuntimeError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as LAS or LAZ; it is broken or cut off") from error


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
    points = _require_finite(path, np.asarray(cloud.points))
    return with_colours(points, _BYTE * np.asarray(cloud.colors).T) if cloud.has_colors() else points


def _require_rows(path: Path, points: int) -> None:
    """Refuse a PCD file with another number of points than its header states, which Open3D would read in part."""
    sizes: dict[bytes, list[bytes]] = {}
    with path.open("rb") as stream:
        for line in stream:
            words = line.split()
            if words[:1] == [b"DATA"]:
                kind, begin = words[1:2], stream.tell()
                break
            sizes[words[0] if words else b""] = words[1:]
        else:
            return
        if kind == [b"ascii"]:
            rows = sum(1 for row in stream if row.strip())
            if rows != points:
                raise InputError(f"{path}: {rows} rows, but its header states {points} points; is it truncated?")
        elif kind == [b"binary"]:
            widths = sizes.get(b"SIZE", [])
            pairs = zip(widths, sizes.get(b"COUNT", [b"1"] * len(widths)), strict=False)
            wanted = points * sum(int(a) * int(b) for a, b in pairs if a.isdigit() and b.isdigit())
            found = path.stat().st_size - begin
            if found != wanted:
                raise InputError(
                    f"{path}: {found} bytes of points, but its header states {points} points, which take {wanted}"
                )


def _ply_points(path: Path) -> np.ndarray:
    vertices, _, colours = _load(path, "PLY")  # Open3D fills a truncated PLY with zeros
    points = _require_finite(path, vertices)
    return with_colours(points, colours.T) if len(colours) == len(points) else points


def read_ply_header(path: Path) -> dict[str, int]:
    """Return how many vertices, faces and other elements a PLY file states, and refuse rows beyond them.

    Raises
    ------
    InputError
        If the header has no end, an element or a property stands twice or is not whole, vertices lack x, y or z, or an
        ASCII file has another number of rows. trimesh reads such a file in part, or takes one column for another.

    References
    ----------
    Turk 1994, "The PLY Polygon File Format": each element has one line, and the elements follow each other.
    """
    counts: dict[str, int] = {}
    properties: dict[str, list[str]] = {}
    with path.open("rb") as stream:
        lines = iter(stream.readline, b"")
        ascii_rows = False
        for line in lines:
            words = [word.decode("latin-1") for word in line[:_PLY_LINE].split()]
            if words == ["end_header"]:
                break
            if stream.tell() > _PLY_HEAD:
                raise InputError(f"{path}: no end_header within {_PLY_HEAD:,} bytes")
            match words:
                case ["format", kind, *_]:
                    ascii_rows = kind == "ascii"
                case ["element", name, count] if name not in counts and count.isdecimal() and len(count) < 19:
                    counts[name], properties[name] = int(count), []
                case ["property", *_, name] if counts and name not in properties[(last := list(counts)[-1])]:
                    properties[last].append(name)
                case ["element" | "property", *_]:
                    raise InputError(f"{path}: its header states {' '.join(words)[:60]!r}: not whole, or twice")
        else:
            raise InputError(f"{path}: no end_header; it is no PLY file, or truncated")
        if not {"x", "y", "z"} <= {*properties.get("vertex", [])}:
            raise InputError(f"{path}: its header states no vertices with x, y and z")
        rows = sum(1 for line in lines if line.strip()) if ascii_rows else sum(counts.values())
    if rows != sum(counts.values()):
        raise InputError(f"{path}: {rows} rows, its header states {sum(counts.values())}")
    return counts


def _load(path: Path, format_name: str, **options: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Load vertices (n, 3), faces (m, 3), none for a cloud, and a cloud's colours (n, 3), if it has any, by trimesh.

    The open file keeps it from following names of materials and textures in it.
    """
    import trimesh

    try:
        with path.open("rb") as stream:
            found: Any = trimesh.load(stream, path.suffix.lower()[1:], process=False, **options)
        vertices = np.asarray(found.vertices, float).reshape(-1, 3)
        faces = np.asarray(getattr(found, "faces", ()), np.int64).reshape(-1, 3)
        colours = np.zeros((0, 3)) if len(faces) else _ply_colours(found)
    except MemoryError:
        raise
    except Exception as error:  # trimesh passes on every exception of its parsers
        raise InputError(
            f"{path}: cannot be read as {format_name}; it is broken, cut off or not supported; convert it to LAZ or XYZ"
        ) from error
    if path.suffix.lower() == ".ply":
        stated = read_ply_header(path)
        for found_now, element in ((len(vertices), "vertex"), (len(faces), "face")):
            if found_now < stated.get(element, 0):  # polygons are cut into triangles, so there may be more
                raise InputError(
                    f"{path}: {found_now} of {stated[element]} {element} elements that its header states; is it "
                    "truncated?"
                )
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise InputError(
            f"{path}: a face has vertex {faces.min()} or {faces.max()}, there are {len(vertices)}; is it truncated?"
        )
    return vertices, faces, colours


def _ply_colours(found: Any) -> np.ndarray:
    """Return the colours (n, 3) of a PLY's vertices as the file has them; 16 bits wrap in the 8 that trimesh keeps."""
    vertices = found.metadata.get("_ply_raw", {}).get("vertex", {}).get("data", {})
    names = set(vertices) if isinstance(vertices, dict) else set(vertices.dtype.names or ())
    if not names >= {"red", "green", "blue"}:
        return np.zeros((0, 3))
    return np.column_stack([np.asarray(vertices[name]).reshape(-1) for name in ("red", "green", "blue")])


def _mesh_blocks(path: Path, points_per_unit2: float) -> Iterator[np.ndarray]:
    """Yield points sampled on a mesh, block by block."""
    import trimesh

    vertices, faces, _ = _load(path, "a mesh", force="mesh")
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
