"""Read point clouds and scanned meshes as points in metres, thinned block by block so that memory is bounded.

The libraries are imported where they are used, because a new process may read the cloud.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from minesurveys.clouds.cloud_formats import LEAST_POINTS, read_blocks, run_on_cloud
from minesurveys.errors import InputError
from minesurveys.guard.reading_process import Payload
from pipeline.geometry.ray_scene import load_open3d

UNIT_M = {"m": 1.0, "mm": 0.001, "ft": 0.3048}


@dataclass(frozen=True)
class CloudLimits:
    """Limits of a cloud.

    One point per voxel of `thin_m` is kept, at ranges from the origin within `range_m`, at most `max_points` in all.
    `height_m` is the (least, greatest) height of workings.
    """

    thin_m: float
    range_m: tuple[float, float]
    max_points: int
    height_m: tuple[float, float]
    mesh_points_per_m2: float


def read_cloud(path: Path, units: str, limits: CloudLimits) -> np.ndarray:
    """Read a cloud or mesh as points (n, 3) m, gated by range and thinned to one point per voxel.

    A process with the limits of `minesurveys/limits.yaml` reads it. Its time grows with the size of the file.

    Formats: the dataset's `NN_lidar.dat` (a header line, then `time x y z intensity`), XYZ text (`x y z ...`), PLY and
    PCD clouds, LAS and LAZ, and STL, OBJ and PLY meshes, which are sampled uniformly.

    Parameters
    ----------
    path : Path
    units : {"m", "mm", "ft"}
        Units of the file's coordinates.
    limits : CloudLimits

    Returns
    -------
    (n, 3) float64, m

    Raises
    ------
    InputError
        If the file is missing, empty, truncated, not numeric or not finite, has too many points after thinning, or has
        a height outside `limits.height_m` in these units. The message names the file, the value and the limit.
    """
    if not path.is_file():
        raise InputError(f"{path}: {'not a plain file' if path.exists() else 'missing'}")
    arguments = {"path": str(path), "units": units, "limits": asdict(limits)}
    return run_on_cloud(read_here, arguments, path).arrays["points"]


def read_here(path: str, units: str, limits: dict[str, Any]) -> Payload:
    """Read a cloud in this process; `read_cloud` has limits."""
    return Payload(None, {"points": _read(Path(path), units, TypeAdapter(CloudLimits).validate_python(limits))})


def _read(path: Path, units: str, limits: CloudLimits) -> np.ndarray:
    kept = np.zeros((0, 3))
    keys = np.zeros(0, np.uint64)
    total = 0
    blocks = read_blocks(path, limits.mesh_points_per_m2 * UNIT_M[units] ** 2)
    for block in blocks:
        total += len(block)
        points = block.points * UNIT_M[units]
        range_m = np.linalg.norm(points, axis=1)
        points = points[(range_m >= limits.range_m[0]) & (range_m <= limits.range_m[1])]
        key = _voxel_keys(points, limits.thin_m)
        key, first = np.unique(key, return_index=True)
        new = ~np.isin(key, keys, assume_unique=True)
        kept, keys = np.concatenate([kept, points[first[new]]]), np.concatenate([keys, key[new]])
        if len(kept) > limits.max_points:
            raise InputError(
                f"{path}: more than {limits.max_points:,} points remain after thinning to {limits.thin_m:g} m; "
                "use a larger surface.cloud.thin_m or crop the cloud"
            )
    if len(kept) < LEAST_POINTS:
        raise InputError(
            f"{path}: {len(kept)} usable points of {total} ({limits.range_m[0]:g} to {limits.range_m[1]:g} m from the "
            f"origin); at least {LEAST_POINTS} are needed"
        )
    _check_height(path, kept, units, limits.height_m)
    return kept


def without_outliers(points: np.ndarray, neighbours: int, ratio: float) -> np.ndarray:
    """Drop points whose mean distance to neighbours exceeds the overall mean by `ratio` standard deviations."""
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    return points[np.asarray(cloud.remove_statistical_outlier(neighbours, ratio)[1], dtype=int)]


def split_surfaces(points: np.ndarray, neighbours: int = 30) -> dict[str, np.ndarray]:
    """Split points (n, 3) by the slope of the rock around them: `wall`, `roof` (above mid-height) and `floor`."""
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(neighbours))
    steep = np.abs(np.asarray(cloud.normals)[:, 2]) < np.sqrt(0.5)
    middle = (np.percentile(points[:, 2], 2) + np.percentile(points[:, 2], 98)) / 2
    high = points[:, 2] > middle
    return {"wall": points[steep], "roof": points[~steep & high], "floor": points[~steep & ~high]}


def _voxel_keys(points: np.ndarray, size_m: float) -> np.ndarray:
    cell = np.floor(points / size_m).astype(np.int64) + (1 << 20)
    if len(cell) and (cell.min() < 0 or cell.max() >= 1 << 21):
        raise InputError(
            f"a point is more than {size_m * (1 << 20):,.0f} m from the origin, the limit for voxels of {size_m:g} m; "
            "move the cloud to its origin"
        )
    cell = cell.astype(np.uint64)
    return (cell[:, 0] << np.uint64(42)) | (cell[:, 1] << np.uint64(21)) | cell[:, 2]


def _check_height(path: Path, points: np.ndarray, units: str, height_m: tuple[float, float]) -> None:
    low, high = np.percentile(points[:, 2], [1, 99])
    least, most = height_m
    if least <= high - low <= most:
        return
    plausible = [name for name, unit in UNIT_M.items() if least <= (high - low) / UNIT_M[units] * unit <= most]
    hint = (
        f"is it in {plausible[0]}? set surface.cloud.units={plausible[0]}"
        if plausible
        else "is it one drift, z up? surface.cloud.units states its unit"
    )
    raise InputError(
        f"{path}: {high - low:.4g} m high (1st to 99th percentile, read in {units}); "
        f"the limits are {least:g} and {most:g} m; {hint}"
    )
