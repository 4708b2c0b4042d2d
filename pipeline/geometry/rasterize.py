"""Rasterise polygons by the pixel-centre rule."""

from __future__ import annotations

import numpy as np
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.types import Frame, Mask


def fill_polygon(geometry: BaseGeometry, frame: Frame) -> Mask:
    """Mark the pixels whose centres lie inside a polygon, by the even-odd rule in each row.

    Parameters
    ----------
    geometry : shapely.Polygon or MultiPolygon, m, mine frame
        Polygons of a multipolygon must not overlap: the even-odd rule would clear the overlap.
    frame : Frame
        The pixel grid.

    Returns
    -------
    (height_px, width_px) bool
    """
    crossings = np.zeros((frame.height_px, frame.width_px + 1), dtype=np.uint8)  # then: parity of the edges to the left
    for ring in _rings(geometry):
        points = frame.to_image(np.asarray(ring.coords)[:, :2])
        a, b = points[:-1], points[1:]
        down = a[:, 1] <= b[:, 1]
        top, bottom = np.where(down[:, None], a, b), np.where(down[:, None], b, a)
        # Row r is crossed when its centre r + 0.5 lies in [top, bottom).
        first = np.clip(np.ceil(top[:, 1] - 0.5), 0, frame.height_px).astype(int)
        last = np.clip(np.ceil(bottom[:, 1] - 0.5), 0, frame.height_px).astype(int)
        count = last - first
        edge = np.repeat(np.arange(len(a)), count)
        row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[edge]
        slope = (bottom[edge, 0] - top[edge, 0]) / (bottom[edge, 1] - top[edge, 1])
        col = top[edge, 0] + (row + 0.5 - top[edge, 1]) * slope
        np.bitwise_xor.at(crossings, (row, np.clip(np.ceil(col - 0.5), 0, frame.width_px).astype(int)), 1)
    return np.bitwise_xor.accumulate(crossings, axis=1, out=crossings)[:, :-1].astype(bool)


def _rings(geometry: BaseGeometry) -> list:
    polygons = [geometry] if isinstance(geometry, Polygon) else list(getattr(geometry, "geoms", []))
    return [ring for polygon in polygons for ring in (polygon.exterior, *polygon.interiors) if not polygon.is_empty]
