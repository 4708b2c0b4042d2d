"""Draw docs/robots.jpg: the robots of this package, the readings of their sensors, and three robots of Gymnasium."""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "osmesa")

import cv2
import gymnasium
import mujoco
import numpy as np

from benchmarks.resume import run_benchmark
from benchmarks.sensors.pictures import SPAN_M, draw_cloud
from minexplore.envs.env import MineEnv
from minexplore.extra.placing.place import PlacementWarning, place
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.pictures.opengl import new_renderer
from minexplore.pictures.render import Renderer
from minexplore.world import World, find_world, load_world
from pipeline.store.files import write_atomically

PICTURE = Path("docs/robots.jpg")
ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
_SIZE_PX = (640, 480)
_ROCK_RGBA, _FLOOR_RGBA = (0.54, 0.44, 0.36, 1.0), (0.42, 0.38, 0.34, 1.0)
_SETTLE_S = 0.25
_COLOUR, _BEAM = (235, 235, 235), (240, 220, 90)


def draw_own(world: World, robot: str | None) -> list[np.ndarray]:
    """Return a view from behind one of this package's robots after some steps, its camera's, and its beams.

    All are (rows, cols, 3) RGB.
    """
    env = MineEnv(world.folder, robot=robot)
    env.reset(seed=0)
    action = np.zeros(env.robot.COMMANDS)
    action[0] = 0.5
    for _ in range(12):
        observation = env.step(action)[0]
    robots = env.robots
    renderer = Renderer(world, robots.T_world_mine, env.grid, env.robot, 1, _SIZE_PX)
    chase = renderer.draw("chase", robots.qpos, robots.seen[0], robots.poses())
    renderer.close()
    seen = cv2.resize(env.capture("rgb"), _SIZE_PX, interpolation=cv2.INTER_CUBIC)
    beams = draw_beams(env, np.asarray(observation))
    env.close()
    return [chase, seen, beams]


def draw_beams(env: MineEnv, observation: np.ndarray) -> np.ndarray:
    """Return a picture (rows, cols, 3) of a robot's beams from above, the robot looking to the right, on a cloud."""
    picture = cv2.resize(draw_cloud(env.capture("os1-64")), _SIZE_PX, interpolation=cv2.INTER_NEAREST)
    around = 2 * np.pi * np.arange(env.task.beams) / env.task.beams
    level = np.column_stack([np.cos(around), np.sin(around)])
    ways = env.robot.beams(env.task.beams)[:, :2] if isinstance(env.robot, QuadrotorParams) else level
    near, far = env.task.range_m
    ends = ways * (near + observation[: len(ways), None] * (far - near)) * _SIZE_PX[0] / SPAN_M
    middle = np.array(_SIZE_PX) / 2
    for end in np.round(middle + ends * [1, -1]).astype(int).tolist():
        cv2.line(picture, tuple(middle.astype(int).tolist()), end, _BEAM, 1, cv2.LINE_AA)
    return picture


def draw_placed(world: World, file: Path) -> np.ndarray:
    """Return a view (rows, cols, 3) RGB of a robot of any file that was placed at the mine's start."""
    x, y = world.record["spawn"]["anchor_m"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlacementWarning)
        spec = place(world, file, (x, y, 0.0), reach_m=30.0)
    for geom in spec.geoms:
        if not geom.name.startswith("robot/"):
            geom.rgba = _FLOOR_RGBA if geom.name.startswith("floor") else _ROCK_RGBA
    spec.visual.global_.offwidth, spec.visual.global_.offheight = _SIZE_PX
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.45] * 3, [0.7] * 3
    spec.visual.map.znear, spec.stat.extent = 0.01, 5.0
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("spawn").id)
    mujoco.mj_step(model, data, nstep=round(_SETTLE_S / model.opt.timestep))
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    option.geomgroup[:] = 1
    option.geomgroup[4] = 0  # the roof
    camera.lookat[:] = data.body("robot/torso").xpos
    camera.distance, camera.azimuth, camera.elevation = 3.4, 60.0, -15.0
    renderer = new_renderer(model, _SIZE_PX, max_geom=2 * model.ngeom + 1000)
    renderer.update_scene(data, camera, option)
    picture: np.ndarray = renderer.render().copy()
    renderer.close()
    return picture


def name_view(name: str, view: np.ndarray) -> np.ndarray:
    """Return a view (rows, cols, 3) RGB as BGR with its name."""
    picture = np.ascontiguousarray(view[..., ::-1])
    return cv2.putText(picture, name, (16, 34), cv2.FONT_HERSHEY_SIMPLEX, 0.8, _COLOUR, 2, cv2.LINE_AA)


def main() -> int:
    """Write the picture."""
    world = load_world(find_world("chilean_mine"))
    rows = []
    for robot in (None, "husky", "quadrotor"):
        called = "the default robot" if robot is None else f"robot='{robot}'"
        names = (called, "its camera", "its beams, from above")
        rows.append([name_view(*pair) for pair in zip(names, draw_own(world, robot), strict=True)])
    files = ("ant.xml", "humanoid.xml", "half_cheetah.xml")
    rows.append([name_view(f"place(world, '{file}', pose)", draw_placed(world, ASSETS / file)) for file in files])
    whole = cv2.vconcat([cv2.hconcat(row) for row in rows])
    small = cv2.resize(whole, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)
    write_atomically(PICTURE, cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes())
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("robot-pictures", main))
