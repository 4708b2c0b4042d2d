"""MuJoCo's interactive viewer, closed so that the process can end."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import mujoco.viewer

from minexplore.bundle import GeomGroup
from minexplore.pictures.render import shown_groups

_CLOSE_S = 10.0  # longest wait for the viewer's threads to end


class Viewer:
    """A window that shows a model's data until it is closed.

    MuJoCo's passive viewer runs in threads of its own, and its `close` returns before they end. An interpreter that
    exits meanwhile terminates GLFW under them, which is a segmentation fault. `close` therefore waits for them, and is
    called at exit where the user does not call it.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, on_key: Callable[[int], None], groups: Sequence[int]
    ) -> None:
        """Open the window that shows these geom groups; `on_key` gets GLFW's codes of the keys that are pressed."""
        before = set(threading.enumerate())
        self._handle = mujoco.viewer.launch_passive(
            model, data, key_callback=on_key, show_left_ui=False, show_right_ui=False
        )
        self._handle.opt.geomgroup[list(groups)] = 1
        self._threads = set(threading.enumerate()) - before
        atexit.register(self.close)

    def sync(self) -> None:
        """Show the data's present state."""
        self._handle.sync()

    def close(self) -> None:
        """Close the window and wait for its threads."""
        atexit.unregister(self.close)
        self._handle.close()
        for thread in self._threads:
            thread.join(_CLOSE_S)


def show(viewer: Viewer | None, drawn: tuple[mujoco.MjModel, mujoco.MjData], env: Any) -> Viewer:
    """Bring the window of an environment up to date, or open it, with the mine seen from above."""
    if viewer is None:
        groups = [group for group in shown_groups(env.world) if group is not GeomGroup.ROOF]
        viewer = Viewer(*drawn, lambda code: env.on_key(code), groups)
    viewer.sync()
    return viewer
