"""Replayed sweeps over the world's walls, and the histogram of their range errors."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.polyline import rings_of
from pipeline.proof.lidar.replay_report import Replay
from pipeline.report.figures.style import GREY, MOSS, OCHRE, ROCK, STEEL, new_figure, to_image
from pipeline.types import Image

_COLOURS = (OCHRE, STEEL, MOSS, ROCK)
_REACH_M = 26.0
_WIDEST_M = 3.0


def draw_replay(replay: Replay, plan: BaseGeometry) -> Image:
    """Draw the returns of each sweep over the outlines of floors, m, mine frame, and the range errors of all sweeps."""
    names = sorted(replay.points)
    columns = 3 if len(names) > 1 else 2
    rows = max(1, math.ceil((len(names) + 1) / columns))
    figure = new_figure(4.0 * columns, 3.4 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for k, name in enumerate(names):
        _draw_sweep(panels[k], replay, name, plan, _COLOURS[k % len(_COLOURS)])
    _draw_errors(panels[len(names)], replay, names)
    for panel in panels[len(names) + 1 :]:
        panel.set_axis_off()
    return to_image(figure)


def _draw_sweep(panel: Axes, replay: Replay, name: str, plan: BaseGeometry, colour: str) -> None:
    sweep = replay.report.sweeps[name]
    x, y, _ = sweep.pose_m
    for ring in rings_of(plan):
        panel.plot(*np.asarray(ring.coords)[:, :2].T, color="black", linewidth=0.8)
    panel.plot(*replay.points[name].T, ".", color=colour, markersize=1.5)
    panel.plot(x, y, "+", color="black", markersize=8)
    panel.set(xlim=(x - _REACH_M, x + _REACH_M), ylim=(y - 0.7 * _REACH_M, y + 0.7 * _REACH_M), aspect="equal")
    panel.set_title(f"{name}: median {sweep.collision.median_m:.2f} m, bias {sweep.collision.bias_m:+.2f} m")


def _draw_errors(panel: Axes, replay: Replay, names: list[str]) -> None:
    if not names:
        panel.set_axis_off()
        panel.text(0.5, 0.5, "no sweeps", ha="center", color=GREY)
        return
    bins = np.linspace(-_WIDEST_M, _WIDEST_M, 61).tolist()
    for k, name in enumerate(names):
        clipped = np.clip(replay.errors[name], -_WIDEST_M, _WIDEST_M)
        panel.hist(clipped, bins, density=True, histtype="step", color=_COLOURS[k % len(_COLOURS)], label=name)
    panel.set(xlabel="range in the world minus measured range, m", ylabel="density")
    panel.set_title("errors of the used returns")
    panel.legend()
