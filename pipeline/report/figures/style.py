"""The common style of all diagrams, and their conversion to pixels, which stages encode as pictures."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontManager, fontManager
from matplotlib.ticker import MaxNLocator

from minesurveys.frames import Georeference
from pipeline.types import Image

ROCK, STEEL, OCHRE, MOSS, GREY = "#7a4b32", "#2f5d8a", "#d28e1f", "#4f7d4b", "#8a8a8a"

matplotlib.rcParams.update(
    {
        "font.size": 9,
        "axes.grid": True,
        "grid.color": "#e3e3e3",
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "figure.dpi": 150,
        "svg.hashsalt": "minexplore",
    }
)


def use_own_fonts(manager: FontManager) -> None:
    """Have a font manager know Matplotlib's own fonts alone.

    A machine's copy of the same font replaces them otherwise, and its glyphs have other numbers in an SVG.
    """
    manager.ttflist = []
    for path in sorted(Path(matplotlib.get_data_path()).glob("fonts/ttf/*.ttf")):
        manager.addfont(path)


use_own_fonts(fontManager)


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return a figure that needs no screen."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def name_axes(axis: Axes, place: Georeference) -> None:
    """Write the survey's own coordinates at the axes of a map, whose places are m in the mine frame."""
    per_m, unit = 1 / place.metres_per_unit, place.unit
    for side, at in ((axis.xaxis, place.origin[0]), (axis.yaxis, place.origin[1])):
        low, high = (at + per_m * value for value in sorted(side.get_view_interval()))
        ticks = [value for value in MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(low, high) if low <= value <= high]
        side.set_ticks([(value - at) / per_m for value in ticks], [f"{value:,.10g}" for value in ticks])
    axis.set(xlabel=f"east, {unit}", ylabel=f"north, {unit}")
    axis.grid(False)


def to_image(figure: Figure) -> Image:
    """Return a figure's pixels (rows, cols, 3) uint8, BGR."""
    figure.canvas.draw()
    rgba = np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
    return np.ascontiguousarray(rgba[:, :, 2::-1])
