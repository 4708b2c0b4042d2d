"""What each sensor sees, in one picture: `python -m benchmarks sensor-pictures`."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from minexplore.envs.env import MineEnv
from minexplore.sensing.params import SensorParams, sensor_params
from minexplore.sensing.scanners import LABELS, PointCloud

PICTURE = Path("docs/sensors.jpg")
_WIDTH, _HEIGHT = 320, 240  # of one tile, px
_SPAN_M = 24.0  # of a cloud's side
_DEPTH_M = 12.0  # white
_STEPS, _COMMAND = 60, np.array([0.8, -0.1], dtype=np.float32)
_COLOURS = {"rock": (205, 176, 140), "roof": (120, 140, 190), "floor": (150, 105, 60), "dust": (235, 70, 60)}
_OTHER = (90, 200, 120)
_LIDARS = ("vlp-16", "os1-64", "mid-360")


def colours_of_labels() -> np.ndarray:
    """Return the colour (labels, 3) uint8 of each label."""
    return np.array([_COLOURS.get(name, _OTHER) for name in LABELS], dtype=np.uint8)


def draw_cloud(cloud: PointCloud) -> np.ndarray:
    """Return a picture (h, w, 3) of a cloud from above, the sensor looking to the right; coloured by label."""
    points, scale = cloud.points_m, _WIDTH / _SPAN_M
    col = np.floor(points[:, 0] * scale + _WIDTH / 2).astype(int)
    row = np.floor(_HEIGHT / 2 - points[:, 1] * scale).astype(int)
    inside = (col >= 0) & (col < _WIDTH) & (row >= 0) & (row < _HEIGHT)
    picture = np.full((_HEIGHT, _WIDTH, 3), 18, dtype=np.uint8)
    order = np.argsort(points[inside, 2], kind="stable")  # the highest last: seen from above
    picture[row[inside][order], col[inside][order]] = colours_of_labels()[cloud.label[inside][order]]
    return picture


def draw_image(name: str, image: np.ndarray) -> np.ndarray:
    """Return a camera's image as a picture (h, w, 3)."""
    if name == "rgb":
        return image
    if name == "labels":
        coloured: np.ndarray = colours_of_labels()[image]
        return coloured
    grey = (255 * np.clip(image / _DEPTH_M, 0, 1)).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def draw_row(env: MineEnv, params: SensorParams, names: tuple[str, ...]) -> np.ndarray:
    """Return the tiles of some sensors, one beside the other, each with its name."""
    env.suite.use(params)
    tiles = []
    for name in names:
        reading = env.capture(name)
        tile = np.ascontiguousarray(
            draw_cloud(reading) if isinstance(reading, PointCloud) else draw_image(name, reading)
        )
        tiles.append(cv2.putText(tile, name, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA))
    return np.hstack(tiles)


def main() -> int:
    """Drive a little, look, and write the picture."""
    env = MineEnv("chilean_mine")
    env.reset(seed=0)
    for _ in range(_STEPS):
        env.step(_COMMAND)
    images = ("rgb", "depth", "labels")
    rows = [
        draw_row(env, sensor_params("ideal"), images),
        draw_row(env, sensor_params("ideal"), _LIDARS),
        draw_row(env, sensor_params("dusty"), images),
        draw_row(env, sensor_params("dusty"), _LIDARS),
    ]
    env.close()
    PICTURE.write_bytes(cv2.imencode(".jpg", np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes())
    print(f"{PICTURE}: {PICTURE.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
