"""A picture of how far a scan's points are from the world's surface, seen from above."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.types import Frame, Image

_MOST_M = 0.1  # of the colours' scale
_SCALE_PX = 12
_WHITE = 255


def draw_deviation(points_m: np.ndarray, off_m: np.ndarray, frame: Frame) -> Image:
    """Return the largest deviation of each place of the plan: red in the rock, blue in the free space, grey at 0.

    Parameters
    ----------
    points_m : (n, 3) float64, m, mine frame
    off_m : (n,) float64, m
        Positive in the rock.
    frame : Frame
        Of the plan.
    """
    picture = np.full((frame.height_px, frame.width_px, 3), _WHITE, np.uint8)
    order = np.argsort(np.abs(off_m))  # the largest is drawn last
    places = np.floor(frame.to_image(points_m[order, :2])).astype(int)
    share = np.clip(off_m[order] / _MOST_M, -1, 1)[:, None]
    grey, red, blue = np.array([200, 200, 200]), np.array([30, 30, 200]), np.array([200, 80, 30])
    colours = grey + np.where(share > 0, share * (red - grey), -share * (blue - grey))
    within = ((places >= 0) & (places < [frame.width_px, frame.height_px])).all(axis=1)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        col = np.minimum(places[within, 0] + dx, frame.width_px - 1)
        row = np.minimum(places[within, 1] + dy, frame.height_px - 1)
        picture[row, col] = colours[within].astype(np.uint8)
    text = f"red {100 * _MOST_M:.0f} cm in the rock, blue {100 * _MOST_M:.0f} cm in the free space"
    cv2.putText(picture, text, (_SCALE_PX, 2 * _SCALE_PX), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return picture
