"""Formats of point clouds and scanned meshes: each reader yields blocks of points in the file's units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from minesurveys.clouds.point_blocks import PLACES, PointBlock, Wanted, block_of, fields_of
from minesurveys.clouds.text_clouds import has_point_rows
from minesurveys.clouds.zipped_clouds import zipped_blocks
from minesurveys.errors import InputError
from minesurveys.formats import FORMATS, FileKind, format_of, kind_of
from minesurveys.guard.reading_process import Payload, Task, run_limited
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user
from minesurveys.solids.ply_meshes import read_ply_mesh
from minesurveys.solids.polygons import with_triangles


def measured(path: Path, blocks: Iterator[PointBlock]) -> Iterator[PointBlock]:
    """Yield the blocks without points that are no finite numbers, or lie at 0 0 0, with a warning at the end.

    Organised clouds have a row for each direction. Where nothing came back, it is NaN in PCD and PLY files, and 0 0 0,
    the scanner's own place, in others.

    Raises
    ------
    InputError
        If no point is left.
    """
    no_numbers = zeros = left = 0
    for block in blocks:
        finite = np.isfinite(block.points).all(axis=1)
        kept = finite & block.points.any(axis=1)
        no_numbers, zeros = no_numbers + int((~finite).sum()), zeros + int((finite & ~kept).sum())
        left += int(kept.sum())
        yield block if kept.all() else _some(block, kept)
    count = no_numbers + zeros + left
    if count and not left:
        raise InputError(f"{path}: none of its {count} points was measured: {no_numbers} are NaN, {zeros} lie at 0 0 0")
    for rows, what in ((no_numbers, "are no finite numbers (NaN)"), (zeros, "lie at 0 0 0")):
        if rows:
            warn_user(
                f"points {what}, as scanners write missed points; left out", of=path.name, count=f"{rows} of {count}"
            )


def _some(block: PointBlock, kept: np.ndarray) -> PointBlock:
    colours, times = (None if each is None else each[kept] for each in (block.colours, block.times))
    return replace(block, points=block.points[kept], colours=colours, times=times)


LEAST_POINTS = 100
_UNPACKED = 4  # times as large as its zip file is a cloud of text
_MESHES = (".stl", ".obj")
CLOUDS = (*(suffix for suffix, form in FORMATS.items() if form.points), ".ply")
_BLOCK = 1_000_000
_PLY_HEAD, _PLY_LINE = 65_536, 1000  # bytes of a header, and of a line in it
_HUGE = 100  # times the most points of a mesh: beyond it, a vertex lies far outside any workings


def run_on_cloud(task: Task, arguments: dict[str, Any], path: Path) -> Payload:
    """Run a task that reads a cloud, in a process with limits; its time grows with the file."""
    limits, is_zip = reader_limits(), path.suffix.lower() == ".zip"
    extra_s = limits.cloud_s_per_gb * path.stat().st_size / 1e9 * (_UNPACKED if is_zip else 1)
    scratch_bytes = limits.unpacked_bytes if is_zip else 0
    return run_limited(task, arguments, str(path), extra_s, scratch_bytes=scratch_bytes)


def holds_points(path: Path) -> bool:
    """Return whether a file is a cloud: by its format, as a table of points, or as a PLY file without faces.

    It reads no more than the first bytes, so that a process without limits may ask.
    """
    suffix = path.suffix.lower()
    if suffix == ".ply":
        with path.open("rb") as stream:
            head = stream.read(_PLY_HEAD).partition(b"end_header")[0]
        faces = [line.split() for line in head.splitlines() if line.startswith(b"element face")]
        return all(words[2:3] == [b"0"] for words in faces)
    return has_point_rows(path) if suffix == ".csv" else kind_of(path) is FileKind.CLOUD


def read_blocks(path: Path, points_per_unit2: float, wanted: Wanted = PLACES) -> Iterator[PointBlock]:
    """Yield the points of a cloud or mesh in blocks, in the file's units.

    Text, PCD and LAS files are read block by block, E57 files scan by scan. PLY files, meshes and packed PCD files are
    read at once. Meshes are sampled. The clouds of a zip file are read one after the other.

    Parameters
    ----------
    path : Path
        The suffix names the format.
    points_per_unit2 : float
        Density at which a mesh is sampled, points per squared unit of the file.
    wanted : Wanted
        Colours and times, where the file states them. Meshes and E57 files have no times, meshes no colours.

    Raises
    ------
    InputError
        If the format is unknown, or the file is empty, truncated, too large or not numeric, or no point was measured.
    """
    return measured(path, _all_blocks(path, points_per_unit2, wanted))


def _all_blocks(path: Path, points_per_unit2: float, wanted: Wanted) -> Iterator[PointBlock]:
    suffix = path.suffix.lower()
    if suffix == ".zip":
        return zipped_blocks(path, CLOUDS, lambda one: _all_blocks(one, points_per_unit2, wanted))
    if suffix in {".ply", *_MESHES}:
        most = reader_limits().cloud_bytes
        if path.stat().st_size > most:
            raise InputError(
                f"{path}: {path.stat().st_size:,} bytes; the limit for PLY and meshes is {most:,} "
                f"(cloud_bytes in {FILE}); convert the file to LAZ or XYZ"
            )
        return _whole_file(path, suffix, points_per_unit2, wanted)
    if not format_of(path).points:
        raise InputError(f"{path}: no reader for {suffix!r}; there are {' '.join([*CLOUDS, *_MESHES])} .zip")
    blocks: Iterator[PointBlock] = resolve_name(format_of(path).points)(path, wanted)
    return blocks


def _whole_file(path: Path, suffix: str, points_per_unit2: float, wanted: Wanted) -> Iterator[PointBlock]:
    if suffix == ".ply" and not read_ply_header(path).get("face"):
        return iter([_ply_points(path, wanted)])
    return _mesh_blocks(path, points_per_unit2)


def _ply_points(path: Path, wanted: Wanted) -> PointBlock:
    vertices, _, fields = _load(path, "PLY", wanted)
    return block_of(vertices, fields)


def read_ply_header(path: Path) -> dict[str, int]:
    """Return how many vertices, faces and other elements a PLY file states, and refuse rows beyond them.

    Raises
    ------
    InputError
        If the header has no end, an element or a property stands twice or is not whole, vertices lack x, y or z, or an
        ASCII file has another number of rows. trimesh reads such a file in part, or takes one column for
        another: findings/trimesh-ply-fewer-points-than-stated.sh.

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


def _load(
    path: Path, format_name: str, wanted: Wanted = PLACES, **options: Any
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Load vertices (n, 3), faces (m, 3), none for a cloud, and what is wanted of a PLY's vertices (n,), by trimesh.

    These fields are as the file has them; of colours with 16 bits trimesh itself keeps 8
    (findings/trimesh-ply-colours-of-16-bits-wrap.sh). The open file keeps it from following names of materials and
    textures in it.
    """
    import trimesh

    try:
        with path.open("rb") if path.suffix.lower() != ".obj" else BytesIO(with_triangles(path.read_bytes())) as stream:
            found: Any = trimesh.load(stream, path.suffix.lower()[1:], process=False, **options)
        vertices = np.asarray(found.vertices, float).reshape(-1, 3)
        faces = np.asarray(getattr(found, "faces", ()), np.int64).reshape(-1, 3)
        rows = found.metadata.get("_ply_raw", {}).get("vertex", {}).get("data", {})  # of text columns by name
        names = fields_of(rows if isinstance(rows, dict) else rows.dtype.names or (), wanted)
        fields = {field: np.asarray(rows[name]).reshape(len(vertices)) for field, name in names.items()}
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
    return vertices, faces, fields


def _ply_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    read_ply_header(path)
    try:
        return read_ply_mesh(path.read_bytes())[:2]
    except (ValueError, KeyError, IndexError, Warning) as error:
        raise InputError(f"{path}: cannot be read as a mesh; it is broken or cut off; is it truncated?") from error


def _mesh_blocks(path: Path, points_per_unit2: float) -> Iterator[PointBlock]:
    """Yield points sampled on a mesh, block by block."""
    import trimesh

    vertices, faces = _ply_mesh(path) if path.suffix.lower() == ".ply" else _load(path, "a mesh", force="mesh")[:2]
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
        yield PointBlock(np.asarray(trimesh.sample.sample_surface(mesh, min(_BLOCK, count - first), seed=block)[0]))
