"""Draw a test plan: about 2.5 km of drifts 2.5 to 3.5 m wide with rough walls and loops, at 10 px/m."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
from shapely import MultiPolygon

from pipeline.geometry.generate import generate_workings
from pipeline.geometry.rough_walls import roughen_walls
from pipeline.survey.draw import draw_picture, frame_around
from pipeline.types import Frame

PX_PER_M, MARGIN_M = 10.0, 6.0
ROUGH = {"rms_m": 0.06, "hurst": 0.75, "shortest_m": 0.3, "longest_m": 6.0}
_SHAPE = {"loops": 0.02, "dead_ends": 0.6, "rib_noise_m": 0.15, "pillar_m": 8.0, "spacing_m": 30.0, "wander": 0.5}


def rough_mine(seed: int, side_m: float = 230.0, rms_m: float = ROUGH["rms_m"]) -> MultiPolygon:
    """Return narrow drifts with rough walls, m; a side of 230 m holds about 2.5 km of them."""
    rng = np.random.default_rng(seed)
    smooth = generate_workings(
        "drift_and_crosscut", rng, size_m=(side_m - 5.0, side_m + 5.0), width_m=(2.5, 3.5), **_SHAPE
    )
    return roughen_walls(smooth, rng=rng, **{**ROUGH, "rms_m": rms_m})


def frame_of(workings: MultiPolygon, px_per_m: float = PX_PER_M) -> Frame:
    """Return the pixel grid of a plan of the workings."""
    west, south, east, north = workings.bounds
    return frame_around((west - MARGIN_M, south - MARGIN_M, east + MARGIN_M, north + MARGIN_M), px_per_m, share=0.25)


def main() -> int:
    """Write the picture; its true walls follow from the seed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rough_plan", description=__doc__)
    parser.add_argument("out", type=Path, help="a .png or .jpg file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--side", type=float, default=230.0, help="side of the mine, m")
    parser.add_argument("--rms", type=float, default=ROUGH["rms_m"], help="standard deviation of the walls, m")
    parser.add_argument("--sharp", action="store_true", help="black and white pixels only")
    given = parser.parse_args()
    workings = rough_mine(given.seed, given.side, given.rms)
    cv2.imwrite(str(given.out), draw_picture(workings, frame_of(workings), 0, not given.sharp, None))
    return 0


if __name__ == "__main__":
    sys.exit(main())
