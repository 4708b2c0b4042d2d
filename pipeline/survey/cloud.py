"""Point clouds and scanned meshes as points in metres, read in blocks and thinned as they come: memory is bounded."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import open3d
import trimesh
from tqdm import tqdm

from pipeline.errors import InputError

UNIT_M = {"m": 1.0, "mm": 0.001, "ft": 0.3048}
TEXT = {".dat", ".xyz", ".txt"}
MESHES = {".stl", ".obj"}
_BLOCK = 1_000_000
_WHOLE_FILE_BYTES = 4_000_000_000  # Open3D reads PLY and PCD at once: about 10^8 points
_LEAST_POINTS = 100


@dataclass(frozen=True)
class CloudLimits:
    """What is kept of a cloud.

    One point a voxel of `thin_m`, ranges from the origin within `range_m`, at most `max_points`; `height_m` are the
    least and greatest heights that workings can have.
    """

    thin_m: float
    range_m: tuple[float, float]
    max_points: int
    height_m: tuple[float, float]
    mesh_points_per_m2: float


def read_cloud(path: Path, units: str, limits: CloudLimits) -> np.ndarray:
    """Read a cloud or mesh as points (n, 3) m, gated by range and thinned to one point a voxel.

    Readers: the dataset's `NN_lidar.dat` (a header line, then `time x y z intensity`), XYZ text (`x y z ...`), PLY and
    PCD clouds, LAS and LAZ, and STL, OBJ and PLY meshes, which are sampled evenly. Text and LAS are streamed.

    Parameters
    ----------
    path : Path
    units : {"m", "mm", "ft"}
        Of the file's coordinates.
    limits : CloudLimits

    Raises
    ------
    InputError
        If the file is missing, empty, truncated, not numeric or not finite, too large to hold after thinning, or if its
        height is not one of workings in these units; the message names the file, the value and the limit.
    """
    if not path.is_file():
        raise InputError(f"{path}: missing")
    kept = np.zeros((0, 3))
    keys = np.zeros(0, np.uint64)
    total = 0
    for block in tqdm(
        _blocks(path, limits.mesh_points_per_m2, units), desc=path.name, unit="block", disable=None, leave=False
    ):
        total += len(block)
        block = block * UNIT_M[units]
        far = np.linalg.norm(block, axis=1)
        block = block[(far >= limits.range_m[0]) & (far <= limits.range_m[1])]
        key = _voxel_keys(block, limits.thin_m)
        key, first = np.unique(key, return_index=True)
        new = ~np.isin(key, keys, assume_unique=True)
        kept, keys = np.concatenate([kept, block[first[new]]]), np.concatenate([keys, key[new]])
        if len(kept) > limits.max_points:
            raise InputError(
                f"{path}: more than {limits.max_points:,} points are left after thinning to {limits.thin_m:g} m; "
                "give a coarser surface.cloud.thin_m or cut the cloud"
            )
    if len(kept) < _LEAST_POINTS:
        raise InputError(
            f"{path}: {len(kept)} usable points of {total} ({limits.range_m[0]:g} to {limits.range_m[1]:g} m from the "
            f"origin); at least {_LEAST_POINTS} are needed"
        )
    _check_height(path, kept, units, limits.height_m)
    return kept


def without_outliers(points: np.ndarray, neighbours: int, ratio: float) -> np.ndarray:
    """Drop points whose mean distance to their neighbours is beyond the mean by `ratio` standard deviations."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    return points[np.asarray(cloud.remove_statistical_outlier(neighbours, ratio)[1], dtype=int)]


def split_surfaces(points: np.ndarray, neighbours: int = 30) -> dict[str, np.ndarray]:
    """Split points (n, 3) by the slope of the rock round them: `wall`, `roof` (above mid-height) and `floor`."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(neighbours))
    steep = np.abs(np.asarray(cloud.normals)[:, 2]) < np.sqrt(0.5)
    middle = (np.percentile(points[:, 2], 2) + np.percentile(points[:, 2], 98)) / 2
    high = points[:, 2] > middle
    return {"wall": points[steep], "roof": points[~steep & high], "floor": points[~steep & ~high]}


def _blocks(path: Path, points_per_m2: float, units: str) -> Iterator[np.ndarray]:
    suffix = path.suffix.lower()
    if suffix in TEXT:
        return _text_blocks(path)
    if suffix in {".las", ".laz"}:
        return _las_blocks(path)
    if suffix in {".ply", ".pcd"} | MESHES:
        if path.stat().st_size > _WHOLE_FILE_BYTES:
            raise InputError(
                f"{path}: {path.stat().st_size:,} bytes; PLY, PCD and meshes are read whole, up to "
                f"{_WHOLE_FILE_BYTES:,}; convert to LAZ or XYZ"
            )
        return iter([_whole_file(path, suffix, points_per_m2 * UNIT_M[units] ** 2)])
    raise InputError(f"{path}: no reader for {suffix!r}; there are .dat .xyz .txt .ply .pcd .las .laz .stl .obj")


def _whole_file(path: Path, suffix: str, points_per_unit2: float) -> np.ndarray:
    if suffix == ".pcd":
        return _pcd_points(path)
    return _ply_points(path, points_per_unit2) if suffix == ".ply" else _mesh_points(path, points_per_unit2)


def _text_blocks(path: Path) -> Iterator[np.ndarray]:
    """Read blocks of rows `x y z ...`, or `time x y z intensity` below one header line in `.dat`."""
    dataset = path.suffix.lower() == ".dat"
    columns = (1, 2, 3) if dataset else (0, 1, 2)
    with path.open(encoding="utf-8", errors="replace") as stream:
        number = 0
        if dataset:
            header = stream.readline()
            number = 1
            if _is_row(header):
                raise InputError(
                    f"{path}:1: a row of numbers where the dataset has its header line (time x y z intensity)"
                )
        while lines := list(itertools.islice(stream, _BLOCK)):
            yield _parsed(path, lines, number, columns)
            number += len(lines)
    if number <= dataset:
        raise InputError(f"{path}: no rows")


def _is_row(line: str) -> bool:
    try:
        return len([float(word) for word in line.split()]) >= 3
    except ValueError:
        return False


def _parsed(path: Path, lines: list[str], before: int, columns: tuple[int, ...]) -> np.ndarray:
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
                f"{path}:{number}: {len(words)} columns, at least {max(columns) + 1} are needed; is the file cut off?"
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
    try:
        with laspy.open(path) as reader:
            count = 0
            for chunk in reader.chunk_iterator(_BLOCK):
                count += len(chunk)
                yield _finite(path, np.column_stack([chunk.x, chunk.y, chunk.z]))
            if count < reader.header.point_count:
                raise InputError(
                    f"{path}: {count} points where its header says {reader.header.point_count}; it is cut off"
                )
    except (laspy.errors.LaspyException, OSError, ValueError, RuntimeError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as LAS or LAZ ({error})") from error


def _pcd_points(path: Path) -> np.ndarray:
    cloud = open3d.io.read_point_cloud(path, remove_nan_points=False, remove_infinite_points=False)
    if not len(cloud.points):
        raise InputError(f"{path}: holds no points, is cut off, or is not a PCD file")
    return _finite(path, np.asarray(cloud.points))


def _ply_points(path: Path, points_per_unit2: float) -> np.ndarray:
    if _has_faces(path):
        return _mesh_points(path, points_per_unit2)
    try:
        points = np.asarray(trimesh.load(path, process=False).vertices)  # Open3D fills a cut-off PLY up with zeros
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise InputError(f"{path}: cannot be read as PLY ({type(error).__name__}: {error})") from error
    return _finite(path, points)


def _has_faces(path: Path) -> bool:
    with path.open("rb") as stream:
        head = stream.read(4096).split(b"end_header")[0]
    return any(line.split()[:2] == [b"element", b"face"] and int(line.split()[2]) > 0 for line in head.splitlines())


def _mesh_points(path: Path, points_per_unit2: float) -> np.ndarray:
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
        area = float(mesh.area)
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise InputError(f"{path}: cannot be read as a mesh ({type(error).__name__}: {error})") from error
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all() or not area > 0:
        raise InputError(f"{path}: holds no faces, or vertices that are not finite")
    count = min(max(_LEAST_POINTS, int(area * points_per_unit2)), 20 * _BLOCK)
    return np.asarray(trimesh.sample.sample_surface(mesh, count, seed=0)[0])


def _finite(path: Path, points: np.ndarray) -> np.ndarray:
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        raise InputError(
            f"{path}: {int(bad.sum())} of {len(points)} points are not finite "
            f"(the first is number {int(bad.argmax()) + 1})"
        )
    return points


def _voxel_keys(points: np.ndarray, size_m: float) -> np.ndarray:
    cell = np.floor(points / size_m).astype(np.int64) + (1 << 20)
    if len(cell) and (cell.min() < 0 or cell.max() >= 1 << 21):
        raise InputError(
            f"points reach beyond {size_m * (1 << 20):,.0f} m at voxels of {size_m:g} m; "
            "move the cloud nearer to its origin"
        )
    cell = cell.astype(np.uint64)
    return (cell[:, 0] << np.uint64(42)) | (cell[:, 1] << np.uint64(21)) | cell[:, 2]


def _check_height(path: Path, points: np.ndarray, units: str, height_m: tuple[float, float]) -> None:
    low, high = np.percentile(points[:, 2], [1, 99])
    least, most = height_m
    if least <= high - low <= most:
        return
    fits = [name for name, unit in UNIT_M.items() if least <= (high - low) / UNIT_M[units] * unit <= most]
    hint = (
        f"is it in {fits[0]}? set surface.cloud.units={fits[0]}" if fits else "is it one drift, z up, in m, mm or ft?"
    )
    raise InputError(
        f"{path}: {high - low:.4g} m high (1st to 99th percentile, read in {units}); "
        f"workings are {least:g} to {most:g} m; {hint}"
    )
