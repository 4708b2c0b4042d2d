"""Detect the origin and the resolution of a scan of workings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.clouds.cloud_formats import holds_points
from minesurveys.errors import InputError
from minesurveys.formats import FileKind, kind_of
from minesurveys.remarks import warn_user
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import MOST_VOXEL_M, CloudSurveyParams
from pipeline.survey.detection.detected_section import Detection, section_for

_FINEST_M, _COARSEST_M = 0.05, 0.2
# A voxel by the spacing of points: so each voxel of a wall has one point on average. A voxel of the thickened wall is
# open if nine are empty, once in e^9 = 8,000. At 0.8 it is once in 300.
_BY_SPACING = 1.0
_MOST_VOXELS = 100_000  # of the surface, at which a volume takes a minute
_TABLE = ".csv"  # of stations, or of points


def is_cloud(path: Path, stated: StatedOptions) -> bool:
    """Return whether a file is read as a scan.

    Its format is one of clouds, it is a table of points, or `--voxel` says so of a mesh.
    """
    if path.suffix.lower() == _TABLE and stated.columns is not None:
        return False
    return holds_points(path) or (kind_of(path) is FileKind.SOLID and stated.voxel_m is not None)


def detect_cloud(path: Path, stated: StatedOptions) -> Detection:
    """Read the points of a scan, and choose the resolution by their spacing and the size of the surface.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    from pipeline.survey.clouds.read import thinned_scan  # open3d takes a second to load
    from pipeline.survey.clouds.thinned import spacing_of
    from pipeline.survey.detection.unstated import facets_of_scan, warn_of_guesses

    options = stated.model_dump(include={"unit", "up", "close_m", "simplify_m", "voxel_m"}, exclude_none=True)
    params = section_for(CloudSurveyParams, path, {"kind": "cloud", **options})
    scan = thinned_scan(params, _FINEST_M / 2, look=True)
    cloud, origin = scan.cloud, scan.origin
    spacing = spacing_of(cloud.points_m)
    voxel_m = stated.voxel_m or resolution(cloud.points_m, spacing)
    warn_of_guesses(
        path, facets_of_scan(cloud), unit=stated.unit is None and not scan.axes.is_stated, up=stated.up is None
    )
    if voxel_m > MOST_VOXEL_M:
        raise InputError(
            f"{path}: points are {spacing:.2f} m apart, and a surface is found to {MOST_VOXEL_M:g} m at most; "
            "--unit states another unit of the file"
        )
    if stated.voxel_m is None:
        warn_user(
            f"points are {spacing:.2f} m apart; its surface is found to {voxel_m:g} m",
            of=path.name,
            option="--voxel",
            advice="--voxel M",
        )
    values = {
        "kind": "cloud",
        "file": path.name,
        "trajectory": None,
        "unit": stated.unit,
        "up": stated.up,
        "origin": list(origin),
        "voxel_m": voxel_m,
        "close_m": params.close_m,
        "simplify_m": params.simplify_m,
    }
    remarks = {
        "trajectory": "where the scanner was, rows of time x y z; null: the largest space is built",
        "origin": "of the mine frame, in the file's coordinates",
        "voxel_m": "resolution of the surface, m; gaps of as much between points are bridged",
        "close_m": "unseen parts of the surface up to this width are listed as holes, m",
        "simplify_m": "four fifths of the surface move by no more than this when it is simplified, m",
        "up": "axis of the file that points up; null: z",
    }
    return Detection(values, remarks, [path], None, has_heights=True)


def resolution(points_m: np.ndarray, spacing_m: float) -> float:
    """Return the voxels' size, m: as fine as 100,000 of the surface allow, no finer than points are apart."""
    cells = np.unique(np.floor(points_m / _COARSEST_M).astype(np.int64), axis=0)
    by_size = np.sqrt(len(cells) * _COARSEST_M**2 / _MOST_VOXELS)
    wanted = max(float(np.clip(by_size, _FINEST_M, _COARSEST_M)), _BY_SPACING * spacing_m)
    return round(float(np.ceil(round(100 * wanted, 3))) / 100, 2)
