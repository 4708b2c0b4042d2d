"""A floor that collides as it looks: height fields that follow the meshes of the visible floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import COVER_M, decode_msh, hfield_file, is_cover, rough_floor
from minexplore.physics.rough_floor import RoughTile
from pipeline.geometry.ray_scene import ray_scene
from pipeline.mjcf.scene import ZoneStrip
from pipeline.store.codecs import Bundle, encode

SPACING_M = 0.1  # between points; that of the visible floor before it is simplified
_TILE_M = 20.0
_LEVELS = 255  # 0.2 mm at most; MuJoCo keeps 8 bits of a picture: findings/mujoco-hfield-png-of-16-bits.sh
_DIGITS = 6


def rough_tiles(cover: Mapping[str, bytes], zones: Sequence[ZoneStrip]) -> list[RoughTile]:
    """Return height fields, tile by tile of each zone, of the meshes of a visible floor.

    Where there is no visible floor, in rock, the height is 0. A height has the nearest of 256 levels of its tile.

    Parameters
    ----------
    cover : mapping
        `.msh` files by the names of meshes; those of other fittings are left out.
    zones : sequence of ZoneStrip
        In the order of the record.
    """
    meshes = [decode_msh(data) for name, data in sorted(cover.items()) if is_cover(name)]
    places = np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in meshes)])
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = (mesh.faces + start for mesh, start in zip(meshes, first, strict=False))
    scene = ray_scene(places, np.concatenate([np.zeros((0, 3), np.int64), *faces]), 1)
    covered = places[:, :2].astype(float)
    tiles = []
    for number, zone in enumerate(zones):
        edges = [_edges(zone.west_m, zone.east_m), _edges(zone.south_m, zone.north_m)]
        cells = [np.digitize(covered[:, axis], edges[axis]) - 1 for axis in (0, 1)]
        inside = np.logical_and.reduce([(c >= 0) & (c < len(e) - 1) for c, e in zip(cells, edges, strict=True)], axis=0)
        for col, row in np.unique(np.column_stack(cells)[inside], axis=0).tolist():
            corner = np.array([edges[0][col], edges[1][row]])
            size = np.array([edges[0][col + 1], edges[1][row + 1]]) - corner
            tiles.append(_tile(scene, rough_floor(number, col, row), number, corner, size))
    return tiles


def picture_of(tile: RoughTile) -> bytes:
    """Return a tile's heights as a grey PNG, north up, the lowest black and the highest white."""
    return encode(Path(f"{tile.name}.png"), _levels(tile.heights_m)[::-1].copy())


def hfield_files(tiles: Sequence[RoughTile]) -> Bundle:
    """Return the pictures of tiles by their files in a bundle."""
    return {hfield_file(tile.name): picture_of(tile) for tile in tiles}


def _edges(first_m: float, last_m: float) -> np.ndarray:
    """Return where tiles begin and end along one side of a zone: a rest that is shorter than a step has none."""
    count = max(1, round((last_m - first_m) / _TILE_M))
    return np.linspace(first_m, last_m, count + 1).round(4)


def _tile(scene: Any, name: str, zone: int, corner: np.ndarray, size: np.ndarray) -> RoughTile:
    cols, rows = np.maximum(2, np.round(size / SPACING_M).astype(int) + 1)
    step = size / [cols - 1, rows - 1]
    x, y = np.meshgrid(corner[0] + step[0] * np.arange(cols), corner[1] + step[1] * np.arange(rows))
    rays = np.zeros((rows, cols, 6), np.float32)
    rays[..., 0], rays[..., 1], rays[..., 2], rays[..., 5] = x, y, 2 * COVER_M, -1.0
    way = scene.cast_rays(rays, nthreads=1)["t_hit"].numpy().astype(float)
    heights = np.where(np.isfinite(way), np.clip(2 * COVER_M - way, 0.0, COVER_M), 0.0)
    low, span = round(float(heights.min()), _DIGITS), round(float(np.ptp(heights)), _DIGITS)
    levels = _levels(heights)
    return RoughTile(name, zone, corner, step, low + span * levels / _LEVELS)


def _levels(heights_m: np.ndarray) -> np.ndarray:
    """Return heights as levels of 8 bits from the lowest to the highest."""
    span = float(np.ptp(heights_m))
    share = (heights_m - heights_m.min()) / span if span > 0 else np.zeros_like(heights_m)
    return np.round(_LEVELS * share).astype(np.uint8)
