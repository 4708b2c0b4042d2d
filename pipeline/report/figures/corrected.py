"""The walls of a plan before and after its correction by sweeps."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from shapely import Polygon

from pipeline.report.figures.style import GREY, OCHRE, STEEL, new_figure, to_image
from pipeline.scans.correct import Correction
from pipeline.types import Frame, Image

_REACH_M = 22.0


def draw_corrected(drawn: Polygon, correction: Correction, frame: Frame) -> Image:
    """Draw both walls over the whole plan, and around each sweep with its returns."""
    names = sorted(correction.poses)
    rows = math.ceil(len(names) / 2)
    figure = new_figure(11.0, 3.4 + 3.6 * rows)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[0.8] + [1.0] * rows)
    plan = figure.add_subplot(grid[0, :])
    _draw_walls(plan, drawn, correction.polygon)
    for name in names:
        x, y, _ = correction.poses[name]
        plan.plot(x, y, "+", color=OCHRE, markersize=10)
    west, south, east, north = frame.extent_m
    plan.set(xlim=(west, east), ylim=(south, north), aspect="equal", title=_title(correction))
    plan.legend(loc="upper right")
    for k, name in enumerate(names):
        _draw_sweep(figure.add_subplot(grid[1 + k // 2, k % 2]), drawn, correction, name)
    return to_image(figure)


def _title(correction: Correction) -> str:
    low, high = correction.report.bias_interval_m
    return (
        f"walls moved inward by {correction.report.bias_m:.2f} m ({low:.2f} to {high:.2f} m) where no sweep sees them"
    )


def _draw_walls(panel: Axes, drawn: Polygon, corrected: Polygon) -> None:
    for polygon, colour, label in ((drawn, GREY, "as drawn"), (corrected, STEEL, "corrected")):
        for k, ring in enumerate((polygon.exterior, *polygon.interiors)):
            xy = np.asarray(ring.coords)[:, :2]
            panel.plot(*xy.T, color=colour, linewidth=0.9, label=None if k else label)


def _draw_sweep(panel: Axes, drawn: Polygon, correction: Correction, name: str) -> None:
    _draw_walls(panel, drawn, correction.polygon)
    x, y, heading = correction.poses[name]
    if name in correction.fans:
        bearing, ranges = correction.fans[name]
        panel.plot(
            x + ranges * np.cos(heading + bearing),
            y + ranges * np.sin(heading + bearing),
            ".",
            color=OCHRE,
            markersize=2,
        )
    panel.plot(x, y, "+", color=OCHRE, markersize=10)
    bias = correction.report.bias_of_sweep_m.get(name)
    panel.set_title(name if bias is None else f"{name}: fits best with walls {bias:.2f} m further in")
    panel.set(xlim=(x - _REACH_M, x + _REACH_M), ylim=(y - 0.7 * _REACH_M, y + 0.7 * _REACH_M), aspect="equal")
