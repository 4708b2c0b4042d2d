"""Read the points of a scan, thinned, in a process with limits; its memory does not grow with the file."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.clouds.cloud_formats import read_blocks, run_on_cloud
from minesurveys.clouds.point_blocks import PointBlock, Wanted
from minesurveys.clouds.scan_axes import ScanAxes, axes_of_scan
from minesurveys.coordinates.origin import origin_of
from minesurveys.coordinates.precision import require_fine, steps_seen
from minesurveys.coordinates.strays import require_together
from minesurveys.errors import InputError
from minesurveys.frames import METRES
from minesurveys.guard.reading_process import Payload
from minesurveys.vector.shapes import REACH_M
from pipeline.survey.clouds.thinned import ThinnedCloud, thin

MOST_VOXELS = 16_000_000  # with points; 5 km of drifts 4 m wide, at 10 cm
_LOOKED_AT = 2_000_000  # voxels that the spacing and the size of a scan are measured of
_MESH_POINTS = 4.0  # of a voxel's side of a mesh

Origin = tuple[float, float, float]


@dataclass(frozen=True)
class ScanFile:
    """How a scan's file is read: metres a unit, the axis that points up, its origin if known, the voxels' size, m.

    Without stated metres a unit, the file's own is used: the one that it states, else metres.

    A `look` needs no more than 2 million voxels, which are larger if the scan is. `timed` points have their times and
    those with `colours` these, if the file states them.
    """

    path: str
    unit_m: float | None
    up: str
    origin: Origin | None
    thin_m: float
    look: bool = False
    timed: bool = False
    colours: bool = False


@dataclass(frozen=True)
class ScanPoints:
    """The thinned points of a scan, m from an origin in the file's coordinates, and the axes of these."""

    cloud: ThinnedCloud
    origin: Origin
    axes: ScanAxes


def read_points(file: ScanFile) -> ScanPoints:
    """Read a scan in a process with the limits of `minesurveys/limits.yaml`; its time grows with the file.

    Raises
    ------
    InputError
        If the file is no cloud of its format, a point is not finite, or it fills too few or too many voxels.
    """
    payload = run_on_cloud(read_here, {"file": vars(file)}, Path(file.path))
    arrays = payload.arrays
    total = int(payload.values["total"])
    cloud = ThinnedCloud(arrays["points"], arrays["count"], total, arrays["rgb"], arrays["time"])
    x, y, z = payload.values["origin"]
    axes = ScanAxes(**payload.values["axes"])
    return ScanPoints(cloud, (x, y, z), axes)


def read_here(file: dict[str, Any]) -> Payload:
    """Read a scan in this process; `read_points` has limits."""
    found = _read(ScanFile(**file))
    values = {"total": found.cloud.total, "origin": list(found.origin), "axes": vars(found.axes)}
    cloud = found.cloud
    return Payload(values, {"points": cloud.points_m, "count": cloud.count, "rgb": cloud.rgb, "time": cloud.time_s})


def _read(file: ScanFile) -> ScanPoints:
    path = Path(file.path)
    wanted = Wanted(file.colours, file.timed)
    blocks = read_blocks(path, _MESH_POINTS * ((file.unit_m or 1.0) / file.thin_m) ** 2, wanted)
    first = next((block for block in blocks if len(block)), None)
    if first is None:
        raise InputError(f"{path}: has no points")
    axes = axes_of_scan(path, first, file.unit_m)
    require_fine(path, steps_seen(first.points) * axes.unit_m)
    require_together(path, first.points, REACH_M / axes.unit_m, "points", "cut them off, or --unit states its unit")
    up = turned(axes.of(first.points), file.up)
    origin = np.array(file.origin if file.origin is not None else origin_of(up, axes.unit_m))
    in_metres = (
        replace(block, points=(turned(axes.of(block.points), file.up) - origin) * axes.unit_m)
        for block in _of_one_system(path, itertools.chain([first], blocks), first)
    )
    try:
        most = _LOOKED_AT if file.look else MOST_VOXELS
        cloud = thin(_within_reach(in_metres), file.thin_m, most, file.look)
    except InputError as error:
        if str(error).startswith(f"{path}:"):  # its reader's
            raise
        raise InputError(f"{path}: {error}") from error
    x, y, z = origin.tolist()
    return ScanPoints(cloud, (x, y, z), axes)


def _of_one_system(path: Path, blocks: Iterator[PointBlock], first: PointBlock) -> Iterator[PointBlock]:
    for block in blocks:
        if block.system != first.system:
            raise InputError(
                f"{path}: its clouds state different coordinate systems or units; give them one by one, or convert "
                "them to one system"
            )
        yield block


def turned(points: np.ndarray, up: str) -> np.ndarray:
    """Return points (n, 3) with the z axis up."""
    return np.asarray(points[:, [0, 2, 1]] * [1, -1, 1] if up == "y" else points)


def _within_reach(blocks: Iterator[PointBlock]) -> Iterator[PointBlock]:
    for block in blocks:
        far = np.abs(block.points).max(initial=0.0)
        if not far <= REACH_M:
            least = far * min(METRES.values())
            cure = (
                "--unit states its unit" if least <= REACH_M else "it is broken, or has points far outside the workings"
            )
            raise InputError(f"reaches {far:.4g} m from its first points, beyond {REACH_M:g} m; {cure}")
        yield block
