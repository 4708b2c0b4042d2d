"""Approximate convex decompositions of the rock, kept beside the exact partition for comparison."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import coacd
import numpy as np
import shapely
import vhacdx
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.extrude import extrude_polygon
from pipeline.types import Points3

Decomposer = Callable[[BaseGeometry], list[Points3]]


def tile_rock(rock: Iterable[Polygon], tiles: int) -> list[BaseGeometry]:
    """Cut the rock by a regular grid into the given number of tiles, as square as may be.

    Parameters
    ----------
    rock : iterable of shapely.Polygon, m, mine frame
    tiles : int
        Cells of the grid. A tile is in several pieces where a drift crosses it.

    Returns
    -------
    list of shapely geometries, m
        One polygon or multipolygon a tile, row by row from the south-west; tiles without rock are left out.
    """
    whole = shapely.union_all(list(rock))
    west, south, east, north = whole.bounds
    shapes = [(tiles // rows, rows) for rows in range(1, tiles + 1) if tiles % rows == 0]
    cols, rows = min(shapes, key=lambda s: abs(np.log((east - west) / s[0] / ((north - south) / s[1]))))
    xs, ys = np.linspace(west, east, cols + 1), np.linspace(south, north, rows + 1)
    cells: list[BaseGeometry] = []
    for j in range(rows):
        for i in range(cols):
            cut = whole.intersection(shapely.box(xs[i], ys[j], xs[i + 1], ys[j + 1]))
            solid = shapely.union_all([p for p in shapely.get_parts(cut) if isinstance(p, Polygon)])
            if not solid.is_empty:
                cells.append(solid)
    return cells


def vhacd_decomposer(height_m: float, resolution: int, max_hulls: int, volume_error_percent: float) -> Decomposer:
    """Return V-HACD with the paper's kind of parameters.

    V-HACD 4 has no concavity threshold; its stopping rule is the volume error of a hull in percent, to which the
    paper's concavity of 0.5 is carried over.

    References
    ----------
    Mamou 2016, Volumetric Hierarchical Approximate Convex Decomposition, Game Engine Gems 3
    """

    def decompose(tile: BaseGeometry) -> list[Points3]:
        mesh = extrude_polygon(tile, height_m)
        faces = np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).astype(np.uint32).ravel()
        hulls = vhacdx.compute_vhacd(
            mesh.vertices, faces, maxConvexHulls=max_hulls, resolution=resolution,
            minimumVolumePercentErrorAllowed=volume_error_percent,
        )  # fmt: skip
        return [np.asarray(vertices, dtype=np.float64) for vertices, _ in hulls]

    return decompose


def coacd_decomposer(height_m: float, threshold: float, seed: int) -> Decomposer:
    """Return CoACD with a concavity threshold (a fraction of the tile's size).

    References
    ----------
    Wei et al. 2022, doi:10.1145/3528223.3530103
    """
    coacd.set_log_level("error")

    def decompose(tile: BaseGeometry) -> list[Points3]:
        mesh = extrude_polygon(tile, height_m)
        parts: Any = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), threshold=threshold, seed=seed)
        return [np.asarray(vertices, dtype=np.float64) for vertices, _ in parts]

    return decompose
