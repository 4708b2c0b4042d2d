"""Pictures of the texture report: scores, roughness over voxel size, and sigma along the mine."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from pipeline.geometry.polyline import rings_of
from pipeline.metrics.rock.published import PAPER, PAPER_SCORES, REAL, REAL_SWEEP
from pipeline.metrics.rock.texture import AXES, AXIS_TITLES, axis_ratios, is_uninformative
from pipeline.proof.texture import TextureReport
from pipeline.report.figures.style import GREY, OCHRE, ROCK, STEEL, new_figure, to_image
from pipeline.types import Image


def _on_two_lines(title: str) -> str:
    return title.replace(" ", "\n") if len(title) > 10 else title


def draw_texture(report: TextureReport) -> Image:
    """Draw both scores of each axis with the paper's, and roughness over voxel size with the real scan's."""
    figure = new_figure(12, 4.4)
    scores, scale = figure.subplots(1, 2, width_ratios=[3, 2])
    at = np.arange(len(AXES) + 1)
    paper = [*(getattr(PAPER_SCORES, a) for a in AXES), PAPER["texture.published.overall"]]
    for shift, values, colour, label in (
        (-0.27, paper, GREY, "the paper's model, published score"),
        (0.0, [*report.published.axes.values(), report.published.overall], OCHRE, "this world, published score"),
        (0.27, [*report.strict.axes.values(), report.strict.overall], ROCK, "this world, strict score"),
    ):
        bars = scores.bar(at + shift, [v or 0.0 for v in values], 0.26, color=colour, label=label)
        scores.bar_label(bars, ["none" if v is None else f"{100 * v:.0f}" for v in values], fontsize=6, padding=1)
    flat = [report.flat.axes[a] for a in AXES]
    shown = [np.nan if f is None else f for f in flat]
    scores.plot(at[:-1], shown, "_", color="black", ms=34, mew=1.2, label="flat walls, published score")
    ratios = axis_ratios(REAL, report.strict_axes)
    names = [
        f"{_on_two_lines(AXIS_TITLES[a])}\n{'no figure' if r is None else f'x {r:.2f}'}"
        + "\nuninformative" * is_uninformative(f)
        for (a, r), f in zip(ratios.items(), flat, strict=True)
    ]
    scores.set_xticks(at, [*names, "overall"], fontsize=7)
    scores.set(ylim=(0, 1.25), ylabel="similarity", title="Texture scores (x: model / real, no noise added)")
    scores.legend(fontsize=7, ncols=2, loc="upper center")
    for name, style in (("ra_m", "--"), ("rq_m", "-"), ("p95_m", ":")):
        label = {"ra_m": "Ra", "rq_m": "Rq", "p95_m": "95th percentile"}[name]
        scale.plot(
            [r.window_m for r in REAL_SWEEP],
            [getattr(r, name) for r in REAL_SWEEP],
            style,
            color=STEEL,
            marker="o",
            ms=3,
            label=f"real, {label}",
        )
        scale.plot(
            [r.window_m for r in report.residuals],
            [getattr(r, name) for r in report.residuals],
            style,
            color=ROCK,
            marker="o",
            ms=3,
            label=f"world, {label}",
        )
    scale.set(
        xscale="log", yscale="log", xlabel="voxel, m", ylabel="residual to plane, m", title="Roughness against scale"
    )
    scale.legend(fontsize=7)
    return to_image(figure)


def draw_heat(report: TextureReport, free: Polygon) -> Image:
    """Draw the mean plane residual of 0.5 m voxels along the mine's walls."""
    heat = np.array(report.heat).reshape(-1, 3)
    west, south, east, north = free.bounds
    width = 12.0
    figure = new_figure(width, max(2.5, width * (north - south) / (east - west) + 1.2))
    axes = figure.subplots()
    for ring in rings_of(free):
        axes.plot(*np.asarray(ring.coords)[:, :2].T, color=GREY, lw=0.4)
    if len(heat):
        most = float(np.percentile(heat[:, 2], 99))
        marks = axes.scatter(
            heat[:, 0], heat[:, 1], c=1000 * heat[:, 2], s=2, cmap="magma", vmin=0, vmax=1000 * most, lw=0
        )
        figure.colorbar(marks, ax=axes, label="sigma in 0.5 m voxels, mm", shrink=0.8)
    axes.set(aspect="equal", xlabel="easting, m", ylabel="northing, m", title="Roughness along the walls")
    return to_image(figure)
