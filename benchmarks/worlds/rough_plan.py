"""Draw a plan with rough walls, 10 px/m: about 2.5 km of drifts 2.5 to 3.5 m wide.

`python -m benchmarks.worlds.rough_plan plan.png` writes it.
"""

from __future__ import annotations

import sys

import cv2
import numpy as np
from shapely import MultiPolygon

from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.generated.rough_walls import roughen_walls
from pipeline.survey.draw import draw_picture, frame_around

_PX_PER_M, _MARGIN_M, _SIDE_M = 10.0, 6.0, 230.0


def rough_mine(seed: int, side_m: float = _SIDE_M) -> MultiPolygon:
    """Return workings with rough walls, m; a side of 230 m holds about 2.5 km of narrow drifts."""
    rng = np.random.default_rng(seed)
    size_m, width_m = (side_m - 5.0, side_m + 5.0), (2.5, 3.5)
    shape = {"loops": 0.02, "dead_ends": 0.6, "spacing_m": 30.0, "rib_noise_m": 0.15, "pillar_m": 14.0, "wander": 0.5}
    smooth = generate_workings("drift_and_crosscut", rng, size_m, width_m, **shape)
    return roughen_walls(smooth, rng=rng, rms_m=0.06, hurst=0.75, shortest_m=0.3, longest_m=6.0)


def main() -> None:
    """Write the picture."""
    workings = rough_mine(1)
    west, south, east, north = workings.bounds
    box = (west - _MARGIN_M, south - _MARGIN_M, east + _MARGIN_M, north + _MARGIN_M)
    cv2.imwrite(sys.argv[1], draw_picture(workings, frame_around(box, _PX_PER_M, share=0.25), 0, True, None))


if __name__ == "__main__":
    main()
