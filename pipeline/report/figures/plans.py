"""Pictures in plan: contours over the binarized plan, and agreement of world and plan."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from shapely import Polygon

from pipeline.types import DriftNetwork, Frame, Image, Mask

_GREEN, _RED, _BLUE, _AMBER = (40, 160, 40), (40, 40, 220), (220, 90, 30), (0, 150, 240)  # BGR


def draw_contours(raw: Mask, outline: Polygon, network: DriftNetwork, frame: Frame) -> Image:
    """Draw the outer boundary green and islands red over the binarized plan, and the drift network amber."""
    picture = cv2.cvtColor(np.where(raw, 90, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    line = max(1, round(frame.px_per_m * 0.6))
    for leg in network.legs:
        _polyline(picture, frame, np.array(leg.stations_m), _AMBER, max(1, line // 2), closed=False)
    for name, place in network.nodes_m.items():
        col, row = frame.to_image(np.array([place]))[0]
        cv2.circle(picture, (round(col), round(row)), line + 3, _AMBER if name[0] == "J" else _BLUE, -1, cv2.LINE_AA)
    for part in shapely.get_parts(outline):
        _polyline(picture, frame, np.asarray(part.exterior.coords), _GREEN, line)
        for island in part.interiors:
            _polyline(picture, frame, np.asarray(island.coords), _RED, line)
    return picture


def _polyline(picture: Image, frame: Frame, xy: np.ndarray, colour: tuple, line: int, closed: bool = True) -> None:
    points = np.round((frame.to_image(xy) - 0.5) * 16).astype(np.int32)
    cv2.polylines(picture, [points], closed, colour, line, cv2.LINE_AA, shift=4)


def draw_agreement(plan_free: Mask, world_free: Mask) -> Image:
    """Draw pixels green that are free in both world and plan, and blue if free in one of them only."""
    picture = np.full((*plan_free.shape, 3), 255, dtype=np.uint8)
    picture[plan_free & world_free] = _GREEN
    picture[plan_free ^ world_free] = _BLUE
    return picture
