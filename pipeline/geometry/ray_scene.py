"""Open3D's scenes of triangles for rays, without what Open3D loads beside them."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

# Open3D loads Plotly and Dash, a web server, for three functions that draw; they take longer to load than all else.
_DRAWING = "open3d.visualization.draw_plotly"
_DRAWS = ("get_plotly_fig", "draw_plotly", "draw_plotly_server")


def ray_scene(vertices: np.ndarray, faces: np.ndarray, threads: int = 0) -> Any:
    """Return an `open3d.t.geometry.RaycastingScene` of faces (m, 3) between vertices (n, 3), in 32 bits.

    It takes rays and points as float32 arrays. So many threads make it, 0: all. Open3D takes a second to load: what
    needs no scene does without it.
    """
    open3d = load_open3d()
    tensor, scene = open3d.core.Tensor, open3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(tensor(vertices.astype(np.float32, copy=False)), tensor(faces.astype(np.uint32, copy=False)))
    return scene


def load_open3d() -> Any:
    """Return Open3D's module, without the libraries that draw, and without threads of its own.

    A forked process waits for ever for threads that this one has, so Open3D begins where it may use one core alone.
    """
    loaded = "open3d" in sys.modules
    if not loaded and _DRAWING not in sys.modules:
        stand_in = ModuleType(_DRAWING)
        for name in _DRAWS:
            setattr(stand_in, name, None)
        sys.modules[_DRAWING] = stand_in
    if loaded or sys.platform != "linux":
        return import_module("open3d")
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        open3d = import_module("open3d")
        scene, tensor = open3d.t.geometry.RaycastingScene(), open3d.core.Tensor
        scene.add_triangles(tensor(np.eye(3, dtype=np.float32)), tensor(np.array([[0, 1, 2]], np.uint32)))
        scene.cast_rays(tensor(np.ones((1, 6), np.float32)))
    finally:
        os.sched_setaffinity(0, cores)
    return open3d
