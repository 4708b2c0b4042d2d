"""A world that is one volume on paper and in a browser: floors from above by height, a long section, its mesh."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import trimesh
from matplotlib import colormaps
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from minesurveys.frames import METRIC, Georeference
from minexplore.bundle import ROOF
from pipeline.report.figures.deviation import add_deviation
from pipeline.report.figures.scene import add_bands, coloured, look_at
from pipeline.report.figures.style import OCHRE, STEEL, name_axes, new_figure

_WIDE_IN = 9.0
_WALL, _ROOF = 1, 2  # labels of facets
_ROCK_RGB = (150, 139, 127)


def draw_floors(
    places_m: np.ndarray,
    cell_m: float,
    lines_m: Sequence[np.ndarray],
    start_m: Sequence[float],
    datum_m: float,
    place: Georeference = METRIC,
) -> Figure:
    """Draw floors from above, coloured by elevation, with the legs over them and where robots start.

    Parameters
    ----------
    places_m : (s, 3) float64, m
        Middles of the floors' cells; the highest in a column is seen.
    cell_m : float
    lines_m : sequence of (n, 3) float64, m
    start_m : (x, y, z), m
    datum_m : float
        Elevation of z = 0.
    place : Georeference
        Of the survey's own coordinates, which the axes have.
    """
    west, south = places_m[:, :2].min(axis=0)
    east, north = places_m[:, :2].max(axis=0)
    wide, high = max(east - west, 1.0), max(north - south, 1.0)
    figure = new_figure(_WIDE_IN, float(np.clip(_WIDE_IN * high / wide + 0.7, 2.4, 10.0)))
    axis = figure.add_subplot()
    top, half = _highest(places_m, cell_m)[0] + datum_m, cell_m / 2
    shown = axis.imshow(
        top, origin="lower", extent=(west - half, east + half, south - half, north + half), cmap="cividis"
    )
    axis.add_collection(LineCollection([line[:, :2] for line in lines_m], colors=STEEL, linewidths=0.5))
    axis.plot(start_m[0], start_m[1], marker="*", color=OCHRE, ms=9, mec="black", mew=0.4)
    figure.colorbar(shown, ax=axis, label="elevation of the highest floor, m", shrink=0.8)
    axis.set(xlim=(west - 2, east + 2), ylim=(south - 2, north + 2), aspect="equal")
    name_axes(axis, place)
    return figure


def floor_picture(places_m: np.ndarray, cell_m: float) -> dict[str, Any]:
    """Return floors from above, coloured by elevation, as a picture for a map: its data URL, place and size in m."""
    top, west, south = _highest(places_m, cell_m)
    share = (top - np.nanmin(top)) / max(float(np.nanmax(top) - np.nanmin(top)), 1e-9)
    pixels = colormaps["cividis"](np.nan_to_num(share), bytes=True)
    pixels[np.isnan(top), 3] = 0
    rows, cols = top.shape
    data = cv2.imencode(".png", pixels[::-1, :, [2, 1, 0, 3]], [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()
    return {
        "url": "data:image/png;base64," + base64.b64encode(data).decode(),
        "west": west - cell_m / 2,
        "north": south + (rows - 0.5) * cell_m,
        "wide": cols * cell_m,
        "high": rows * cell_m,
        "low_m": float(np.nanmin(top)),
        "high_m": float(np.nanmax(top)),
    }


def _highest(places_m: np.ndarray, cell_m: float) -> tuple[np.ndarray, float, float]:
    """Return the height (rows, cols) m of the highest floor in each column of cells, row 0 in the south, and its place.

    The place is the middle of the first cell in the south-west.
    """
    west, south = places_m[:, :2].min(axis=0)
    column, row = np.round((places_m[:, :2] - [west, south]) / cell_m).astype(int).T
    top = np.full((int(row.max()) + 1, int(column.max()) + 1), np.nan)
    order = np.argsort(places_m[:, 2], kind="stable")
    top[row[order], column[order]] = places_m[order, 2]
    return top, float(west), float(south)


def facet_scene(
    vertices: np.ndarray,
    faces: np.ndarray,
    label: np.ndarray,
    scan: tuple[np.ndarray, np.ndarray] | None = None,
    known: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
) -> trimesh.Scene:
    """Return the facets of a volume as a scene: floors coloured by elevation, walls, and a roof that can be hidden.

    With points (n, 3) m of a `scan` and their deviations (n,) m they are there a second time, coloured by these.
    `known` are the facets' triangles, how each is known, and its facet (`facets_by_known`): meshes have it in their
    names, so that the page can colour them by it.
    """
    scene = trimesh.Scene()
    corners, of, suffix = vertices[faces], np.arange(len(faces)), np.full(len(faces), "")
    if known is not None:
        corners, how, of = known
        suffix = np.char.add("_k", how.astype(str))
    for kind, name in ((_WALL, "walls"), (_ROOF, ROOF)):
        for ending in np.unique(suffix[label[of] == kind]).tolist():
            own = corners[(label[of] == kind) & (suffix == ending)].reshape(-1, 3)
            mesh = coloured(own, np.arange(len(own)).reshape(-1, 3), _ROCK_RGB)
            scene.add_geometry(mesh, node_name=name + ending, geom_name=name + ending)
    if (is_floor := label[of] == 0).any():
        add_bands(scene, corners[is_floor], np.char.add("floor", suffix[is_floor]))
    if scan is not None:
        add_deviation(scene, vertices, faces, label, *scan)
    look_at(scene, *vertices.min(axis=0).tolist(), *vertices.max(axis=0).tolist())
    return scene
