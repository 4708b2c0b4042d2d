"""Draw a test plan with rough walls, 10 px/m: about 2.5 km of drifts 2.5 to 3.5 m wide, or rooms and pillars.

`--style room_and_pillar` draws about 4.8 km of rooms 5 to 6 m wide round some 120 pillars.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from shapely import MultiPolygon
from shapely.affinity import rotate

from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.generated.rough_walls import roughen_walls
from pipeline.survey.draw import draw_picture, frame_around
from pipeline.types import Frame

PX_PER_M, MARGIN_M = 10.0, 6.0
ROUGH = {"rms_m": 0.06, "hurst": 0.75, "shortest_m": 0.3, "longest_m": 6.0}
_SHAPES: dict[str, dict[str, Any]] = {
    "drift_and_crosscut": {"size_m": 230.0, "width_m": (2.5, 3.5), "loops": 0.02, "dead_ends": 0.6, "spacing_m": 30.0},
    "room_and_pillar": {"size_m": 210.0, "width_m": (5.0, 6.0), "loops": 1.0, "dead_ends": 0.6, "spacing_m": 30.0},
}
_ALSO = {"rib_noise_m": 0.15, "pillar_m": 14.0, "wander": 0.5}


def rough_mine(
    seed: int, side_m: float | None = None, rms_m: float = ROUGH["rms_m"], style: str = "drift_and_crosscut"
) -> MultiPolygon:
    """Return workings with rough walls, m; a side of 230 m holds about 2.5 km of narrow drifts."""
    rng = np.random.default_rng(seed)
    shape = {**_ALSO, **_SHAPES[style]}
    side_m = side_m or shape["size_m"]
    smooth = generate_workings(style, rng, **{**shape, "size_m": (side_m - 5.0, side_m + 5.0)})
    return roughen_walls(smooth, rng=rng, **{**ROUGH, "rms_m": rms_m})


def frame_of(workings: MultiPolygon, px_per_m: float = PX_PER_M) -> Frame:
    """Return the pixel grid of a plan of the workings."""
    west, south, east, north = workings.bounds
    return frame_around((west - MARGIN_M, south - MARGIN_M, east + MARGIN_M, north + MARGIN_M), px_per_m, share=0.25)


def main() -> int:
    """Write the picture; its true walls follow from the seed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.rough_plan", description=__doc__)
    parser.add_argument("out", type=Path, help="a .png or .jpg file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--style", choices=list(_SHAPES), default="drift_and_crosscut")
    parser.add_argument("--side", type=float, help="side of the mine, m")
    parser.add_argument("--px-per-m", type=float, default=PX_PER_M, help="scale; a plan has at most 64 million pixels")
    parser.add_argument("--turn", type=float, default=0.0, help="turn of the mine on the paper, deg")
    parser.add_argument("--rms", type=float, default=ROUGH["rms_m"], help="standard deviation of the walls, m")
    parser.add_argument("--sharp", action="store_true", help="black and white pixels only")
    given = parser.parse_args()
    workings = rotate(rough_mine(given.seed, given.side, given.rms, given.style), given.turn, origin=(0, 0))
    cv2.imwrite(str(given.out), draw_picture(workings, frame_of(workings, given.px_per_m), 0, not given.sharp, None))
    return 0


if __name__ == "__main__":
    sys.exit(main())
