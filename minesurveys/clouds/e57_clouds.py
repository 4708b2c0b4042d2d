"""Points of E57 files: the scans of one file, each moved to its place."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from minesurveys.clouds.point_blocks import PointBlock, Wanted, block_of, fields_of
from minesurveys.errors import InputError
from minesurveys.remarks import warn_user

_LEAST_BITS = 1  # of a point in a file: packed integers of a scan in a plane take a few


def e57_blocks(path: Path, wanted: Wanted) -> Iterator[PointBlock]:
    """Yield the points, m, of each scan of an E57 file, in the file's frame; without times.

    Points whose state is invalid are left out, and counted in a remark.

    Raises
    ------
    InputError
        If pye57 is not installed, or the file is broken or has no scan with points.
    """
    try:
        import pye57
    except ImportError as error:
        raise InputError(f"{path}: E57 is read by pye57: pip install 'minexplore-pipeline[e57]'") from error
    try:
        file, invalid = pye57.E57(str(path)), 0
        for number in range(file.scan_count):
            header = file.get_header(number)
            if header.point_count > 8 * path.stat().st_size / _LEAST_BITS:
                raise InputError(
                    f"{path}: its header states {header.point_count:,} points, more than the file can hold"
                )
            if header.point_count:
                scan = file.read_scan(number, colors=wanted.colours, ignore_missing_fields=True)
                points = np.column_stack([scan[f"cartesian{axis}"] for axis in "XYZ"]).astype(np.float64)
                invalid += header.point_count - len(points)
                if header.has_pose():  # what a scanner missed lies at its own place, as 0 0 0 in other files
                    points[(points == np.asarray(header.translation)).all(axis=1)] = 0.0
                yield block_of(points, {field: scan[name] for field, name in fields_of(scan, wanted).items()})
        if invalid:
            warn_user("points that the file states as invalid are left out", of=path.name, count=invalid)
    except InputError:
        raise
    except MemoryError:
        raise
    except Exception as error:  # libE57Format's own classes, and what a broken file makes of its arrays
        raise InputError(f"{path}: cannot be read as E57; it is broken or cut off") from error
