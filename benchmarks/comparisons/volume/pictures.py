"""Floors from above by height, and a view of the mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

from minexplore.floors.volume_arrays import FacetLabel

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

_COLOURS = {FacetLabel.FLOOR: "#b08d57", FacetLabel.WALL: "#7d8597", FacetLabel.ROOF: "#c9d1de"}
_MOST_BYTES = 300_000


def draw(volumes: dict[str, Path], path: Path) -> None:
    """Draw each volume from above, and its walls and floors without the roof from aside; at most 300 KB."""
    found = {title: np.load(file) for title, file in volumes.items() if file.is_file()}
    if not found:
        return
    figure = plt.figure(figsize=(4.0 * len(found), 7.0))
    for number, (title, mesh) in enumerate(found.items()):
        corners = mesh["vertices"][mesh["faces"]]
        _plan(figure.add_subplot(2, len(found), number + 1), title, corners[mesh["label"] == FacetLabel.FLOOR])
        _view(figure.add_subplot(2, len(found), len(found) + number + 1, projection="3d"), corners, mesh["label"])
    figure.tight_layout()
    for quality in (85, 70, 50, 30):
        figure.savefig(path, dpi=110, pil_kwargs={"quality": quality})
        if path.stat().st_size <= _MOST_BYTES:
            break
    plt.close(figure)


def _plan(axes: Any, title: str, corners: np.ndarray) -> None:
    order = np.argsort(corners[:, :, 2].mean(axis=1))
    drawn = PolyCollection(list(corners[order][:, :, :2]), array=corners[order][:, :, 2].mean(axis=1), cmap="viridis")
    axes.add_collection(drawn)
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=9)
    axes.tick_params(labelsize=7)
    plt.colorbar(drawn, ax=axes, shrink=0.6, label="floor, m").ax.tick_params(labelsize=7)


def _view(axes: Any, corners: np.ndarray, label: np.ndarray) -> None:
    seen = label != FacetLabel.ROOF
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shade = 0.65 + 0.35 * np.abs(normal @ [0.4, 0.6, 0.69]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    base = np.array([matplotlib.colors.to_rgb(_COLOURS[FacetLabel(k)]) for k in label])
    axes.add_collection3d(Poly3DCollection(corners[seen], facecolors=(base * shade[:, None])[seen], linewidths=0))
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    axes.view_init(40, -60)
    axes.tick_params(labelsize=6)
