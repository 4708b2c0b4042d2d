"""Write a scan of a drift of 2 km with millions of points as LAS, read it thinned, and print time and memory."""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import laspy
import numpy as np

from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds.points import ScanFile, read_here
from pipeline.survey.clouds.read import read_scan

_LENGTH_M, _ROW_M, _ROWS = 2000.0, 20.0, 10  # the drift goes to and fro in rows, 20 m apart
_WIDE_M, _HIGH_M, _NOISE_M = 5.0, 4.0, 0.02
_BLOCK = 1_000_000
_THIN_M, _VOXEL_M = 0.1, 0.2  # as the command reads a scan of this size


def _points(count: int) -> Iterator[np.ndarray]:
    """Yield points (n, 3) m on floor, roof and walls of straight drifts, as a scanner that is carried writes them."""
    rng, of_row = np.random.default_rng(0), count // _ROWS
    for row in range(_ROWS):
        for first in range(0, of_row, _BLOCK):
            n = min(_BLOCK, of_row - first)
            along = (first + np.sort(rng.uniform(0, n, n))) / of_row * _LENGTH_M / _ROWS
            across = np.column_stack([rng.uniform(0, _WIDE_M, n), rng.uniform(0, _HIGH_M, n)])
            side, upright = rng.integers(0, 2, n), rng.uniform(size=n) < _HIGH_M / (_HIGH_M + _WIDE_M)
            across[upright, 0] = (side * _WIDE_M)[upright]
            across[~upright, 1] = (side * _HIGH_M)[~upright]
            points = np.column_stack([along, row * _ROW_M + across[:, 0], across[:, 1]])
            yield points + rng.normal(0, _NOISE_M, points.shape)


def write_scan(path: Path, count: int) -> None:
    """Write a scan of `count` points block by block."""
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = np.full(3, 1e-3)
    with laspy.open(path, "w", header=header) as out:
        for points in _points(count):
            record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
            record.x, record.y, record.z = points.T
            out.write_points(record)


def main() -> int:
    """Print how long reading takes, without the limits of a reading process, and with `--volume` stage 1 as a whole."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks large-scan", description=__doc__)
    parser.add_argument("--millions", type=int, default=20, help="points")
    parser.add_argument("--volume", action="store_true", help="find the free space, too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.las"
        write_scan(path, arguments.millions * 1_000_000)
        size = path.stat().st_size
        start = time.process_time()
        found = read_here(vars(ScanFile(path.as_posix(), 1.0, "z", None, _THIN_M)))
        seconds, voxels = time.process_time() - start, len(found.arrays["count"])
        print(
            f"{found.values['total']:,} points, {size / 1e6:.0f} MB, in {voxels:,} voxels of {_THIN_M:g} m: "
            f"{seconds:.1f} s of processor time ({1e3 * seconds / arguments.millions:.0f} ms a million), "
            f"peak {_peak_mb():.0f} MB"
        )
        if arguments.volume:
            params = CloudSurveyParams(kind="cloud", name="large", file="data/x", heights=None, voxel_m=_VOXEL_M)
            start = time.process_time()
            scan = read_scan(params.model_copy(update={"file": path.as_posix()}))
            seconds = time.process_time() - start
            print(
                f"the volume, {len(scan.solid):,} facets: {seconds:.0f} s of processor time, peak {_peak_mb():.0f} MB"
            )
    return 0


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


if __name__ == "__main__":
    sys.exit(main())
