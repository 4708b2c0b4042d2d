"""Refusals of solids and scans, and what follows their advice."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import laspy
import numpy as np
import pyproj
import trimesh

from tests.survey.advice.advice import Advice, WayOn, by
from tests.survey.clouds.test_cloud_files import write
from tests.survey.clouds.test_cloud_volume import drift, noisy, sampled

GRID = np.array([351_234.0, 5_301_118.0, 412.0])


def cloud(folder: Path, scale: float = 1.0, moved: float = 0.0, every: int = 1, stray: bool = False) -> Path:
    """Write points of a drift."""
    points = noisy(sampled(drift()))[::every] * scale + moved
    return write(folder / "a.xyz", np.vstack([points, [[9e6, 9e6, 0.0]]]) if stray else points)


def las(folder: Path, system: str) -> Path:
    """Write points of a drift in metres, whose header states another system."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [1e6, 6e6, 0]
    header.add_crs(pyproj.CRS(system))
    points = laspy.LasData(header)
    points.x, points.y, points.z = (noisy(sampled(drift())) + np.array([1e6, 6e6, 0])).T
    points.write(str(folder / "a.las"))
    return folder / "a.las"


def solid(folder: Path, scale: float = 1.0, open_end: bool = False, stray: bool = False) -> Path:
    """Write a box of 60 m x 4 m x 3 m."""
    mesh = trimesh.creation.box((60.0, 4.0, 3.0))
    if open_end:
        mesh.update_faces(mesh.triangles_center[:, 0] < 29.0)
    if stray:
        pebble = trimesh.creation.box((1.0, 1.0, 1.0))
        pebble.apply_translation([9e6, 9e6, 0.0])
        mesh = trimesh.util.concatenate(
            [mesh, mesh.copy().apply_translation([0, 9, 0]), mesh.copy().apply_translation([0, 18, 0]), pebble]
        )
    mesh.apply_scale(scale)
    (folder / "a.obj").write_text(trimesh.exchange.obj.export_obj(mesh, digits=6))
    return folder / "a.obj"


def shell(folder: Path) -> Path:
    """Write the triangles of a scanned drift, each apart from the others."""
    mesh = trimesh.creation.box((30.0, 4.0, 3.0)).subdivide_to_size(0.5)
    apart = mesh.triangles_center[:, None] + 0.95 * (mesh.triangles - mesh.triangles_center[:, None])
    mesh = trimesh.Trimesh(apart.reshape(-1, 3), np.arange(3 * len(apart)).reshape(-1, 3), process=False)
    (folder / "a.obj").write_text(trimesh.exchange.obj.export_obj(mesh, digits=6))
    return folder / "a.obj"


CASES = {
    "a scan that reaches too far": Advice(
        "m from its first points, beyond", partial(cloud, scale=1000.0), {}, (by(unit="mm"),)
    ),
    "points too far apart": Advice(
        "m at most; --unit states another unit", partial(cloud, scale=100.0), {}, (by(unit="cm"),)
    ),
    "points far off": Advice(
        "cut them off, or --unit states its unit", partial(cloud, stray=True), {}, (WayOn({}, cloud),)
    ),
    "few voxels": Advice(
        "at least {} are needed; --unit states its unit",
        cloud,
        {"unit": "mm"},
        (by(unit="m"),),
    ),
    "a scan in a wrong system": Advice(
        "; --unit m reads them as they are", partial(las, system="EPSG:3857"), {}, (by(unit="m"),)
    ),
    "a solid that reaches too far": Advice(
        "m far, beyond {} m; --unit states it", partial(solid, scale=1000.0), {}, (by(unit="mm"),)
    ),
    "a solid far off": Advice(
        "delete what they belong to, or --unit states its unit", partial(solid, stray=True), {}, (WayOn({}, solid),)
    ),
    "an open end": Advice(
        "--close M fills holes up to M metres", partial(solid, open_end=True), {"close_m": 1.0}, (by(close_m=10.0),)
    ),
    "a torn mesh": Advice("--voxel M reads them as a scan", shell, {}, (by(voxel_m=0.2),)),
}
