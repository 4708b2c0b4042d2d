"""An episode in a browser while it is driven: the cloud, the map of all clouds, the robot and the camera."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from minexplore.extra.record.episode import SensedStep
from minexplore.rotations import quaternion
from minexplore.sensing.scanners import PointCloud
from minexplore.sensors.suite import SensorSuite
from minexplore.sensors.table import sensor_space

_MAP_M, _MOST = 0.25, 200_000  # size of the map's cells; points that a browser still turns smoothly
_LABEL_COLOURS = np.random.default_rng(5).integers(70, 255, (32, 3), dtype=np.uint8)


def require_viser() -> None:
    """Refuse to show where viser is missing.

    Raises
    ------
    ImportError
        Naming the extra that brings it.
    """
    if find_spec("viser") is None:
        raise ImportError("record --live needs viser: pip install viser")


class LiveView:
    """Serves a page on this machine; it is up to date after each frame."""

    def __init__(self, suite: SensorSuite, port: int) -> None:
        """Start the server."""
        import viser  # of the extra `live`

        self._suite = suite
        self._server: Any = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
        self.address = f"http://127.0.0.1:{self._server.get_port()}"
        self._server.scene.set_up_direction("+z")
        self._text: Any = self._server.gui.add_markdown("waiting for the first frame")
        self._images: dict[str, Any] = {}
        self._map: dict[tuple[int, int, int], np.ndarray] = {}

    def add(self, frame: SensedStep) -> None:
        """Show one control step."""
        turned = quaternion(np.ascontiguousarray(frame.robot.axes))
        self._server.scene.add_frame(
            "/robot", wxyz=turned, position=frame.robot.place_m, axes_length=1.0, axes_radius=0.05
        )
        for name, reading in frame.readings.items():
            if isinstance(reading, PointCloud):
                self._add_cloud(name, reading, frame)
            elif reading.ndim > 1:
                self._show_image(name, reading)
        self._text.content = f"{frame.time_ns / 1e9:.1f} s, coverage {100 * frame.coverage:.2f} %"

    def _add_cloud(self, name: str, cloud: PointCloud, frame: SensedStep) -> None:
        points = self._suite.mount(name).on(frame.robot).points(cloud.points_m)
        colours = _LABEL_COLOURS[cloud.label]
        self._server.scene.add_point_cloud(f"/{name}", points, colours, point_size=0.03)
        cells, first = np.unique(np.floor(points / _MAP_M).astype(int), axis=0, return_index=True)
        for cell, row in zip(map(tuple, cells.tolist()), first.tolist(), strict=True):
            if len(self._map) < _MOST:
                self._map.setdefault(cell, points[row])
        seen = np.array(list(self._map.values()), dtype=np.float32)
        grey = np.full((len(seen), 3), 110, dtype=np.uint8)
        self._server.scene.add_point_cloud("/map", seen, grey, point_size=0.04)

    def _show_image(self, name: str, reading: np.ndarray) -> None:
        if reading.ndim == 3:
            shown = reading
        elif reading.dtype.kind == "f":
            farthest = sensor_space(name).high.max() / 2  # the other half is for noise
            grey = (255 * np.clip(reading / farthest, 0, 1)).astype(np.uint8)
            shown = np.repeat(grey[..., None], 3, axis=2)
        else:
            shown = _LABEL_COLOURS[reading]
        if name not in self._images:
            self._images[name] = self._server.gui.add_image(shown, label=name)
        self._images[name].image = shown

    def close(self) -> None:
        """Stop the server."""
        self.drop()

    def drop(self) -> None:
        """Stop the server; after `close` nothing happens."""
        server, self._server = self._server, None
        if server is not None:
            server.stop()
