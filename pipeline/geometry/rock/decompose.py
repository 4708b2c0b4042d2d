"""Approximate convex decompositions of the rock, for comparison with the exact partition.

A new method is a function here and a line of `DECOMPOSERS`; its parameters have the names of its section in `conf/`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coacd
import numpy as np
import vhacdx
from shapely.geometry.base import BaseGeometry

from pipeline.geometry.rock.collision import Decomposer
from pipeline.geometry.rock.extrude import extrude_polygon
from pipeline.types import Points3


def vhacd_decomposer(height_m: float, resolution: int, max_hulls: int, volume_error_percent: float) -> Decomposer:
    """Return V-HACD with parameters like the paper's.

    V-HACD 4 has no concavity threshold. It stops at a volume error of a hull in percent; the paper's concavity of 0.5
    is used for that.

    References
    ----------
    Mamou 2016, Volumetric Hierarchical Approximate Convex Decomposition, Game Engine Gems 3
    """

    def decompose(tile: BaseGeometry) -> list[Points3]:
        mesh = extrude_polygon(tile, height_m)
        faces = np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).astype(np.uint32).ravel()
        hulls = vhacdx.compute_vhacd(
            mesh.vertices,
            faces,
            maxConvexHulls=max_hulls,
            resolution=resolution,
            minimumVolumePercentErrorAllowed=volume_error_percent,
        )
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


DECOMPOSERS: dict[str, Callable[..., Decomposer]] = {"coacd": coacd_decomposer, "vhacd": vhacd_decomposer}
