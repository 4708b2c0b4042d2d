"""The plan of the mine as a figure for print: workings, floor zones, drift network and spawn."""

from __future__ import annotations

import io

import numpy as np
import shapely
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline
from shapely import Polygon

from minesurveys.frames import METRIC, Georeference
from pipeline.mjcf.bundle import WorldRecord
from pipeline.report.chart import Chart, ChartGrid, ChartStation
from pipeline.report.figures.style import GREY, OCHRE, ROCK, STEEL, name_axes, new_figure
from pipeline.types import DriftNetwork


def draw_mine(polygon: Polygon, network: DriftNetwork, record: WorldRecord, place: Georeference = METRIC) -> Figure:
    """Draw the workings (m, plan) over the floor zones, with the network, the spawn and the survey's coordinates."""
    west, south, east, north = polygon.bounds
    wide, high = east - west, north - south
    figure = new_figure(9.0, float(np.clip(9.0 * high / wide + 0.7, 2.2, 10.0)))
    axis = figure.add_subplot()
    for zone in record.zones:
        left, right = max(zone.west_m, west), min(zone.east_m, east)
        if right > left:
            axis.add_patch(Rectangle((left, south), right - left, high, color=zone.rgba[:3], alpha=0.18, lw=0))
            axis.text((left + right) / 2, north, zone.name, ha="center", va="bottom", fontsize=7, color=GREY)
    axis.add_patch(PathPatch(outline_path(polygon), facecolor="#d9cbbf", edgecolor=ROCK, lw=0.6))
    for leg in network.legs:
        axis.plot(*np.array(leg.stations_m).T, color=STEEL, lw=0.6)
    nodes = np.array(list(network.nodes_m.values()))
    axis.plot(*nodes.T, ".", color=STEEL, ms=3)
    axis.plot(*record.spawn.anchor_m, marker="*", color=OCHRE, ms=9, mec="black", mew=0.4)
    axis.set(xlim=(west - 2, east + 2), ylim=(south - 2, north + 2), aspect="equal")
    name_axes(axis, place)
    return figure


def mine_chart(polygon: Polygon, network: DriftNetwork, record: WorldRecord, grid: ChartGrid) -> Chart:
    """Return the map of a level mine: the workings over the floor zones, the drifts, and the names of their nodes."""
    west, south, east, north = polygon.bounds
    strips = [(max(zone.west_m, west), min(zone.east_m, east), zone) for zone in record.zones]
    rgb = [f"rgb({','.join(str(round(255 * value)) for value in zone.rgba[:3])})" for zone in record.zones]
    paths = [
        {
            "d": f"M{left:.2f} {south:.2f}H{right:.2f}V{north:.2f}H{left:.2f}Z",
            "style": f"fill: {colour}; fill-opacity: 0.18; stroke: none",
        }
        for (left, right, _), colour in zip(strips, rgb, strict=True)
        if right > left
    ]
    rings = [ring for part in shapely.get_parts(polygon) for ring in (part.exterior, *part.interiors)]
    outline = "".join("M" + "L".join(f"{x:.2f} {y:.2f}" for x, y, *_ in ring.coords) + "Z" for ring in rings)
    number = {name: 0 for name in network.nodes_m}
    for leg in network.legs:
        for name in (leg.start, leg.end):
            number[name] += 1
    return Chart(
        (west, south, east, north),
        lines=[np.array(leg.stations_m).round(2).reshape(-1).tolist() for leg in network.legs],
        paths=[*paths, {"d": outline, "class": "workings", "fill-rule": "evenodd"}],
        stations=[
            ChartStation(name, x, y, f"{grid.text(x, y)}; {_kind(number[name])}", number[name])
            for name, (x, y) in network.nodes_m.items()
        ],
        grid=grid,
        start=(float(record.spawn.anchor_m[0]), float(record.spawn.anchor_m[1])),
    )


def _kind(legs: int) -> str:
    return "dead end" if legs == 1 else f"junction of {legs} drifts"


def outline_path(polygon: Polygon) -> Outline:
    """Return a polygon with its islands as a path that can be filled."""
    parts = shapely.get_parts(polygon)
    rings = [np.asarray(ring.coords)[:, :2] for part in parts for ring in (part.exterior, *part.interiors)]
    codes = [
        np.concatenate([[Outline.MOVETO], np.full(len(r) - 2, Outline.LINETO), [Outline.CLOSEPOLY]]) for r in rings
    ]
    return Outline(np.vstack(rings), np.concatenate(codes))


def to_svg(figure: Figure) -> bytes:
    """Return a figure as SVG; equal figures give equal bytes."""
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()
