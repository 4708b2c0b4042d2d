"""Trace free-space pixels into a polygon with islands, and simplify it."""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.polygon import orient

from pipeline.errors import GeometryError
from pipeline.geometry.outline.cell_borders import RowEnds, fill_contacts, trace_borders
from pipeline.geometry.outline.edge_fit import fit_edges
from pipeline.geometry.outline.fewest_vertices import simplify_to_error
from pipeline.types import Frame, Mask

_SUBPIXELS = 2
_ROUNDING_M = 1e-9  # a fitted coordinate of less is zero; the sign of what is left depends on the processor


def trace_outline(free: Mask, frame: Frame) -> Polygon:
    """Trace the largest free region into a polygon with its islands as holes.

    Borders run through the centres of the border pixels, and so lose half a pixel on every side. The mask is therefore
    doubled first, so that nothing is one pixel wide, and the polygon is grown by half a sub-pixel.

    Parameters
    ----------
    free : (rows, cols) bool
        True where the plan shows workings.
    frame : Frame
        The pixel grid of `free`.

    Returns
    -------
    shapely.Polygon, m, mine frame
        Counter-clockwise exterior, clockwise islands.

    Raises
    ------
    GeometryError
        If nothing is free, or the outline touches itself.
    """
    borders = trace_borders(fill_contacts(RowEnds.doubled(free)))
    size = np.array([cv2.contourArea(ring.astype(np.int32)) if len(ring) > 2 else -1.0 for ring in borders.rings])
    outer = np.flatnonzero(~borders.is_hole & (size >= 0))
    if not len(outer):
        raise GeometryError("outline: the mask holds no free region to trace")
    largest = outer[len(outer) - 1 - int(size[outer][::-1].argmax())]
    holes = np.flatnonzero(borders.is_hole & (size >= 0) & (borders.region == borders.region[largest]))
    traced = Polygon(borders.rings[largest], [borders.rings[hole] for hole in holes[::-1]])
    if not traced.is_valid:
        raise GeometryError(f"outline: {shapely.is_valid_reason(traced)} (sub-pixels)")
    grown = traced.buffer(0.5, join_style="mitre")
    if not isinstance(grown, Polygon):
        raise GeometryError(f"outline: the traced region has {len(grown.geoms)} components, want one")

    def to_mine(points: np.ndarray) -> np.ndarray:
        # The centre of the doubled mask's pixel k lies at (k + 0.5) / 2 - 1 in the image plane; 1 is the padding.
        return frame.to_mine((points + 0.5) / _SUBPIXELS - 1.0)

    return orient(shapely.transform(grown, to_mine))


def simplify_outline(outline: Polygon, tolerance_m: float) -> Polygon:
    """Simplify by Douglas-Peucker within a tolerance; the outline stays valid and keeps its islands.

    The remaining vertices are then moved, within the tolerance, so that each edge runs along the middle of its wall.
    On the published plan that halves the area error (see `fit_edges`).

    Parameters
    ----------
    outline : shapely.Polygon, m
    tolerance_m : float
        Greatest distance of a vertex of `outline` from the result. 0 removes only collinear vertices.

    Returns
    -------
    shapely.Polygon, m
        Valid, with as many holes as `outline`; every coordinate is a multiple of `grid_m(outline)`.

    Raises
    ------
    GeometryError
        If the result would lose an island or be invalid; the message names the tolerance.

    References
    ----------
    Douglas & Peucker 1973, doi:10.3138/FM57-6770-U75U-7727; the topology-preserving form is that of JTS and GEOS.
    """
    kept = shapely.simplify(outline, tolerance_m, preserve_topology=True)
    return _on_grid(outline, _fit_rings(outline, kept, tolerance_m), f"contours.tolerance_m = {tolerance_m:g}")


def simplify_to_wall_error(outline: Polygon, error_m: float) -> Polygon:
    """Simplify with about the fewest vertices for a mean distance of the traced wall from the result.

    Parameters
    ----------
    outline : shapely.Polygon, m
    error_m : float
        Mean distance, m; no point of the traced wall is farther away than eight times this.

    Returns
    -------
    shapely.Polygon, m
        As `simplify_outline` returns it.

    Raises
    ------
    GeometryError
        If the result would lose an island or be invalid; the message names the error.
    """
    return _on_grid(outline, simplify_to_error(outline, error_m), f"contours.wall_error_m = {error_m:g}")


def _on_grid(outline: Polygon, simplified: Polygon, setting: str) -> Polygon:
    """Return a simplified outline on the grid of `grid_m`; refuse it if it is invalid or an island is lost."""
    unsigned = shapely.transform(simplified, lambda xy: np.where(np.abs(xy) < _ROUNDING_M, 0.0, xy))
    simple = shapely.set_precision(unsigned, grid_m(outline))
    if not isinstance(simple, Polygon) or simple.is_empty or not simple.is_valid:
        raise GeometryError(f"{setting}: the outline would be invalid; use a smaller value")
    if len(simple.interiors) != len(outline.interiors):
        raise GeometryError(
            f"{setting}: {len(outline.interiors)} islands would become {len(simple.interiors)}; use a smaller value"
        )
    return orient(simple)


def _fit_rings(outline: Polygon, kept: Polygon, tolerance_m: float) -> Polygon:
    """Fit the edges of every ring; return `kept` if the moved edges would cross."""
    if len(kept.interiors) != len(outline.interiors):
        return kept
    pairs = zip((outline.exterior, *outline.interiors), (kept.exterior, *kept.interiors), strict=True)
    rings = [fit_edges(np.asarray(a.coords), np.asarray(b.coords), tolerance_m) for a, b in pairs]
    moved = Polygon(rings[0], rings[1:])
    return moved if moved.is_valid else kept


def grid_m(outline: Polygon) -> float:
    """Return the grid of an outline's coordinates, m: six digits, which is 1 mm up to a kilometre."""
    reach = max(1.0, *(abs(v) for v in outline.bounds))
    return float(10.0 ** (np.ceil(np.log10(reach * 1.1)) - 6))
