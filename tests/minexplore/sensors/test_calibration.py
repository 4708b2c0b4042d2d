import numpy as np

from minexplore.envs.env import MineEnv
from minexplore.sensing.scanners.labels import ROCK, ROOF
from minexplore.sensors.kinds.camera import _OPTICAL_AXES
from tests.mines import BuiltMine


def test_depth_unprojected_by_the_camera_info_lies_on_the_mesh(tee: BuiltMine):
    env = MineEnv(tee.bundle, task={"range_m": (0.12, 60.0)})
    env.reset(seed=0, options={"pose": (20.0, 2.5, 0.3)})
    depth = env.capture("depth").astype(float)
    sensor = env.suite.sensor("depth")
    info = next(m.content for m in sensor.messages("depth", 0, depth.astype(np.float32)) if m.topic.endswith("_info"))
    K = np.reshape(info["k"], (3, 3))
    rock = np.isin(env.capture("labels"), [ROCK, ROOF])  # the floor that is seen is lower than beams'
    rows, columns = np.nonzero((depth > 0.5) & (depth < 9.0) & rock)
    pick = np.random.default_rng(0).choice(len(rows), 2000, replace=False)
    rows, columns = rows[pick], columns[pick]
    pixels = np.column_stack([columns, rows, np.ones(len(rows))])
    points = pixels @ np.linalg.inv(K).T * depth[rows, columns][:, None]  # of the optical frame
    camera = env.suite.mount("depth").on(env.suite.pose())
    ways = points @ (camera.axes @ _OPTICAL_AXES).T
    far = np.linalg.norm(ways, axis=1)
    ranges = env.robots.lidar.cast(camera.place_m[None], (ways / far[:, None])[None])[0]
    apart = np.abs(ranges - far)
    assert np.median(apart) < 1e-3
    assert np.quantile(apart, 0.9) < 5e-3
    env.close()
