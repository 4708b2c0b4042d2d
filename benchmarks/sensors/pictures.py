"""What each sensor sees, in one picture: `python -m benchmarks sensor-pictures`."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from baselines.policies.found import make_policy
from minexplore.envs.env import MineEnv
from minexplore.envs.vector import MineVectorEnv
from minexplore.sensing.params import SensorParams, sensor_params
from minexplore.sensing.scanners import LABELS, PointCloud

PICTURE = Path("docs/sensors.jpg")
_WIDTH, _HEIGHT = 320, 240  # of one tile, px
SPAN_M = 24.0  # of a cloud's side
_DEPTH_M = 12.0  # white
_STARTS = 10  # steps in which the robot starts to move
_STEPS, _COMMAND = 60, np.array([0.8, -0.1], dtype=np.float32)
_COLOURS = {"rock": (205, 176, 140), "roof": (120, 140, 190), "floor": (150, 105, 60), "dust": (235, 70, 60)}
_OTHER = (90, 200, 120)
_IMAGES, _LIDARS = ("rgb", "depth", "labels"), ("vlp-16", "os1-64", "mid-360", "vz-400")
_DRIVEN_STEPS = 1200  # of the way that wheels count
_DARK, _LINES = 18, ((235, 235, 235), (235, 70, 60), (90, 200, 120))


def colours_of_labels() -> np.ndarray:
    """Return the colour (labels, 3) uint8 of each label."""
    return np.array([_COLOURS.get(name, _OTHER) for name in LABELS], dtype=np.uint8)


def draw_cloud(cloud: PointCloud) -> np.ndarray:
    """Return a picture (h, w, 3) of a cloud from above, the sensor looking to the right; coloured by label."""
    points, scale = cloud.points_m, _WIDTH / SPAN_M
    col = np.floor(points[:, 0] * scale + _WIDTH / 2).astype(int)
    row = np.floor(_HEIGHT / 2 - points[:, 1] * scale).astype(int)
    inside = (col >= 0) & (col < _WIDTH) & (row >= 0) & (row < _HEIGHT)
    picture = np.full((_HEIGHT, _WIDTH, 3), _DARK, dtype=np.uint8)
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


def draw_lines(lines: list[np.ndarray], *, square: bool) -> np.ndarray:
    """Return a picture (h, w, 3) of lines, each (n, 2) points, which fill it; `square`: both axes have one scale."""
    every = np.concatenate(lines)
    middle, span = (every.min(axis=0) + every.max(axis=0)) / 2, np.maximum(np.ptp(every, axis=0), 1e-6)
    scale = 0.8 * np.array([_WIDTH, _HEIGHT]) / span
    scale = np.full(2, scale.min()) if square else scale
    picture = np.full((_HEIGHT, _WIDTH, 3), _DARK, dtype=np.uint8)
    for line, colour in zip(lines, _LINES, strict=False):
        at = np.array([_WIDTH, _HEIGHT]) / 2 + (line - middle) * scale * [1, -1]
        cv2.polylines(picture, [np.round(at).astype(np.int32)], False, colour, 1, cv2.LINE_AA)
    return picture


def drive_by_odometry(world: str) -> list[np.ndarray]:
    """Return the way (n, 2) m of a robot that follows the wall, and the one that its wheels count."""
    env = MineVectorEnv(1, world, pose="odometry")
    policy = make_policy("wall-following", 1, env.task, env.robot)
    observation, info = env.reset(seed=[0])
    policy.reset(np.arange(1), np.array([0]))
    ways: dict[str, list[np.ndarray]] = {"true_pose_m_rad": [], "pose_m_rad": []}
    for _ in range(_DRIVEN_STEPS):
        observation, *_, info = env.step(policy.act(observation, info))
        for name, way in ways.items():
            way.append(info[name][0, :2].copy())
    env.close()
    return [np.array(way) for way in ways.values()]


def label_tile(tile: np.ndarray, name: str) -> np.ndarray:
    """Return a tile with its name."""
    tile = np.ascontiguousarray(tile)
    return cv2.putText(tile, name, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)


def draw_row(env: MineEnv, params: SensorParams, names: tuple[str, ...]) -> list[np.ndarray]:
    """Return the tiles of some sensors, each with its name."""
    env.suite.use(params)
    tiles = []
    for name in names:
        reading = env.capture(name)
        drawn = draw_cloud(reading) if isinstance(reading, PointCloud) else draw_image(name, reading)
        tiles.append(label_tile(drawn, name))
    return tiles


def main() -> int:
    """Drive a little, look, and write the picture."""
    env = MineEnv("chilean_mine", conditions="typical")
    env.reset(seed=0)
    turns = []
    for _ in range(_STEPS):
        env.step(_COMMAND)
        turns.append(env.capture("imu")[:3])
    axes = np.transpose(turns[_STARTS:])  # not of the start, which hides the rest
    imu = label_tile(draw_lines([np.column_stack([range(len(a)), a]) for a in axes], square=False), "imu")
    odometry = label_tile(draw_lines(drive_by_odometry("chilean_mine"), square=True), "pose = odometry")
    ideal, dusty = sensor_params("ideal"), sensor_params("dusty")
    rows = [
        [*draw_row(env, ideal, _IMAGES), imu],
        draw_row(env, ideal, _LIDARS),
        [*draw_row(env, dusty, _IMAGES), odometry],
        draw_row(env, dusty, _LIDARS),
    ]
    env.close()
    whole = np.vstack([np.hstack(row) for row in rows])[..., ::-1]
    PICTURE.write_bytes(cv2.imencode(".jpg", whole, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes())
    print(f"{PICTURE}: {PICTURE.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
