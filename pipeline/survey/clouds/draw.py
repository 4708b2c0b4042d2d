"""What of a scan was left out or closed, marked on the plan of the workings."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.survey.clouds.volume import ScannedVolume
from pipeline.types import Frame, Image

# BGR: things, ropes, points behind walls, unseen places
_RED, _ORANGE, _PURPLE, _BLUE = (40, 40, 220), (0, 140, 255), (160, 60, 140), (220, 120, 0)


def mark_left_out(plan: Image, frame: Frame, volume: ScannedVolume) -> Image:
    """Return a plan with points that are left out, and a blue circle about each gap.

    Points behind walls are purple, thin ones orange, those of things red.
    """
    marked = plan.copy()
    for points, colour in (
        (volume.beyond_m, _PURPLE),
        (volume.thin_points_m, _ORANGE),
        (volume.thing_points_m, _RED),
    ):
        places = np.floor(frame.to_image(points[:, :2])).astype(int) if len(points) else np.zeros((0, 2), int)
        within = ((places >= 0) & (places < [frame.width_px, frame.height_px])).all(axis=1)
        marked[places[within, 1], places[within, 0]] = colour
    for gap in volume.gaps:
        col, row = np.floor(frame.to_image(np.array([gap.middle_m[:2]]))[0]).astype(int).tolist()
        radius = max(3, round(gap.width_m / 2 * frame.px_per_m))
        cv2.circle(marked, (col, row), radius, _BLUE, 2, cv2.LINE_AA)
    return marked
