"""What a camera sees: OSMesa lights every corner of every facet several times, in sight or not."""

from __future__ import annotations

import os
from collections.abc import Callable

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup

_HIDDEN = GeomGroup.SMOOTH_SURFACE


def draw_seen(renderer: mujoco.Renderer, update: Callable[[], None]) -> None:
    """Bring a renderer's scene up to date by `update`; where OSMesa draws, with the geoms that are in sight.

    A picture of the numbers of geoms, which no lamp lights, shows which ones these are. Robots stay, as they cast
    shadows, and all stays where a mirror is in sight.
    """
    if os.environ.get("MUJOCO_GL", "").strip().lower() != "osmesa":
        update()
        return
    model = renderer.model
    groups, clear, mirror = model.geom_group.copy(), *_kinds(model)
    try:
        model.geom_group[clear] = _HIDDEN  # it hides nothing
        update()
        seen = _seen(renderer)
        seen |= clear | (groups == GeomGroup.ROBOT) | (seen & mirror).any()
        model.geom_group[:] = np.where(seen, groups, _HIDDEN)
        update()
    finally:
        model.geom_group[:] = groups


def _seen(renderer: mujoco.Renderer) -> np.ndarray:
    """Return which geoms are in a picture of a renderer's scene, (n,) bool."""
    renderer.enable_segmentation_rendering()
    try:
        number, kind = np.moveaxis(renderer.render(), -1, 0)
    finally:
        renderer.disable_segmentation_rendering()
    found = np.zeros(renderer.model.ngeom, dtype=bool)
    found[number[kind == int(mujoco.mjtObj.mjOBJ_GEOM)]] = True
    return found


def _kinds(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Return which geoms are clear and which ones are mirrors, (n,) bool each."""
    of_material = np.append(model.mat_rgba[:, 3], 1.0)[model.geom_matid]  # the last is that of none, whose number is -1
    clear = np.minimum(of_material, model.geom_rgba[:, 3]) < 1
    return clear, np.append(model.mat_reflectance, 0.0)[model.geom_matid] > 0
