"""Views inside mines with heights, with their rock, for docs/how-to/heights.md."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from minexplore.bundle import GeomGroup
from minexplore.floors.floor import Floor
from pipeline.compose import compose
from pipeline.mjcf.bundle import OpenedBundle, open_bundle
from pipeline.mjcf.render import render_from
from pipeline.types import Image
from tests.heights import UNDER, MineWithHeights, levels, spiral

_FILE = Path("docs/decline.jpg")
_SIZE_PX, _QUALITY = (640, 420), 80
_EYE_M, _AHEAD_M, _BACK_M = 1.3, 2.5, 6.0
_PARAMS = ["realism.tilt_deg=0", "contours.tolerance_m=0.16"]


def main() -> int:
    """Build a spiral decline, levels with ramps, and a drift under a drift, and look along them."""
    config = compose(_PARAMS)
    views = []
    for legs in (spiral(3), levels(), UNDER):
        with tempfile.TemporaryDirectory() as folder:
            mine = MineWithHeights(legs, config, Path(folder))
            world = open_bundle(mine.bundle)
            lines = [np.array(leg.stations_m) for leg in mine.network.legs]
            views.append(_over_seam(world, mine.floor, np.concatenate(lines)))
            views.append(_along(world, mine.floor, max(lines, key=len)))
    rows = [cv2.hconcat(views[k : k + 2]) for k in range(0, len(views), 2)]
    cv2.imwrite(str(_FILE), cv2.vconcat(rows), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    print(_FILE)
    return 0


def _over_seam(world: OpenedBundle, floor: Floor, stations: np.ndarray) -> Image:
    """Look over the first seam between two sheets."""
    seam = floor.seams()[0, 0]
    off = np.abs(np.linalg.norm(stations - seam, axis=1) - _BACK_M)
    return _view(world, floor, stations[int(off.argmin())], seam)


def _along(world: OpenedBundle, floor: Floor, line: np.ndarray) -> Image:
    """Look along a drift from its middle."""
    eye = line[len(line) // 2]
    ahead = line[len(line) // 2 :]
    return _view(world, floor, eye, ahead[int(np.abs(np.linalg.norm(ahead - eye, axis=1) - _AHEAD_M).argmin())])


def _view(world: OpenedBundle, floor: Floor, eye_m: np.ndarray, target_m: np.ndarray) -> Image:
    T = np.array(world.record.T_world_mine)
    places = floor.fold(np.array([[*place, _EYE_M] for place in (eye_m, target_m)]))
    eye, towards = ((T @ [*place, 1.0])[:3] for place in places)
    return render_from(world.model, eye, towards, 75.0, _SIZE_PX, (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE))


if __name__ == "__main__":
    sys.exit(main())
