"""Write a scan of a long drift with millions of points as LAS or LAZ, read it thinned, and print time and memory.

With `--volume` the free space is found too, and the time of each step of it is printed. Time is that of the processors,
of reading processes too, and memory that of the largest process.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds import volume
from pipeline.survey.clouds.points import ScanFile, read_here
from pipeline.survey.clouds.read import read_scan

_WAVE_M, _ASIDE_M, _RISE = 40.0, 10.0, 0.02  # the drift winds and rises
_WIDE_M, _HIGH_M, _NOISE_M = 5.0, 4.0, 0.02
_LENGTH_M = 2000.0
_BLOCK = 1_000_000
_COLOUR, _HUE_M = 30_000, 5.0  # of 16 bits
_STEPS = (
    "_flooded",
    "planes_of",
    "turned_alike",
    "sided",
    "find_things",
    "BlockSurface",
    "find_gaps",
    "plates_of",
    "_largest",
    "decimated",
)
_THIN_M, _VOXEL_M = 0.1, 0.2  # as the command reads a scan of this size


def _points(count: int, length_m: float) -> Iterator[np.ndarray]:
    """Yield points (n, 3) m on floor, roof and walls of a drift, as a scanner that is carried writes them."""
    rng = np.random.default_rng(0)
    for first in range(0, count, _BLOCK):
        n = min(_BLOCK, count - first)
        along = (first + np.sort(rng.uniform(0, n, n))) / count * length_m
        across = np.column_stack([rng.uniform(0, _WIDE_M, n), rng.uniform(0, _HIGH_M, n)])
        side, upright = rng.integers(0, 2, n), rng.uniform(size=n) < _HIGH_M / (_HIGH_M + _WIDE_M)
        across[upright, 0] = (side * _WIDE_M)[upright]
        across[~upright, 1] = (side * _HIGH_M)[~upright]
        aside, up = _ASIDE_M * np.sin(along / _WAVE_M), _RISE * along
        points = np.column_stack([along, aside + across[:, 0], up + across[:, 1]])
        yield points + rng.normal(0, _NOISE_M, points.shape)


def write_scan(path: Path, count: int, length_m: float = _LENGTH_M, colours: bool = False) -> None:
    """Write a scan of `count` points of a drift block by block, with `colours` that change along it."""
    header = laspy.LasHeader(point_format=2 if colours else 0, version="1.2")
    header.scales = np.full(3, 1e-3)
    with laspy.open(path, "w", header=header) as out:
        for points in _points(count, length_m):
            record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
            record.x, record.y, record.z = points.T
            if colours:
                record.red, record.green, record.blue = (_COLOUR * (1 + 0.5 * np.sin(points / _HUE_M))).astype("<u2").T
            out.write_points(record)


class _StepTimes:
    """The processor time of the functions that finding a volume calls, s, by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def timed(self, name: str, step: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same and notes how long it takes."""

        def call(*values: Any, **more: Any) -> Any:
            start = time.process_time()
            try:
                return step(*values, **more)
            finally:
                self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - start

        return call


def main() -> int:
    """Print how long reading takes, without the limits of a reading process, and with `--volume` stage 1 as a whole."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks large-scan", description=__doc__)
    parser.add_argument("--millions", type=int, default=20, help="points")
    parser.add_argument("--metres", type=float, default=_LENGTH_M, help="of the drift")
    parser.add_argument("--laz", action="store_true", help="compress the file")
    parser.add_argument("--colours", action="store_true", help="of the points")
    parser.add_argument("--volume", action="store_true", help="find the free space, too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"scan.{'laz' if arguments.laz else 'las'}"
        write_scan(path, arguments.millions * 1_000_000, arguments.metres, arguments.colours)
        size = path.stat().st_size
        start = _processor_s()
        found = read_here(vars(ScanFile(path.as_posix(), 1.0, "z", None, _THIN_M, colours=arguments.colours)))
        seconds, voxels = _processor_s() - start, len(found.arrays["count"])
        print(
            f"{found.values['total']:,} points, {size / 1e6:.0f} MB, in {voxels:,} voxels of {_THIN_M:g} m: "
            f"{seconds:.1f} s of processor time ({1e3 * seconds / arguments.millions:.0f} ms a million), "
            f"peak {_peak_mb():.0f} MB"
        )
        if arguments.volume:
            params = CloudSurveyParams(kind="cloud", name="large", file="data/x", heights=None, voxel_m=_VOXEL_M)
            begin = _processor_s()
            steps = _StepTimes()
            for name in _STEPS:
                setattr(volume, name, steps.timed(name, getattr(volume, name)))
            scan = read_scan(params.model_copy(update={"file": path.as_posix()}))
            seconds, whole = _processor_s() - begin, _processor_s() - start
            print(
                f"the volume, {len(scan.solid):,} facets: {seconds:.0f} s of processor time, with the first reading "
                f"{whole / 60:.1f} min, peak {_peak_mb():.0f} MB"
            )
            print(", ".join(f"{name} {of:.1f} s" for name, of in sorted(steps.seconds.items(), key=lambda s: -s[1])))
    return 0


def _processor_s() -> float:
    return sum(os.times()[:4])


def _peak_mb() -> float:
    return max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1e3


if __name__ == "__main__":
    sys.exit(main())
