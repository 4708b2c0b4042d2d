"""gymnasium-robotics beside this package on the same generated mine, in one run: `python -m benchmarks peers`.

It is left out where it is not installed. The page of sensors has MuJoCo-LiDAR's rays.
"""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import shapely

from baselines.base.markdown import markdown_table, write_table
from minexplore.bundle import FREE_SPACE, TOPOLOGY, is_rock
from minexplore.envs.env import MineEnv
from minexplore.sensing.lidar import shared_lidar
from minexplore.world import World, load_world
from pipeline.build.family import generated, without_rock
from pipeline.build.world import make_world
from pipeline.compose import compose
from pipeline.store.codecs import decode
from pipeline.types import DriftNetwork, FreeSpace

WORLD, TABLE = Path("artifacts/bench/peers"), Path("docs/evidence/parts/peers.md")
_MINE = 1  # of the split `test`: a grid of drifts and crosscuts, which suits a maze of square cells
_CELL_M = 2.0  # of a maze: less than half of a drift's width
_WALL_M, _EYE_M = 1.0, 0.4  # height of a maze's walls; of beams and of points
_BALL_M = 0.01
_POINTS, _BEAMS, _RANGE_M, _STEPS = 5000, 16, 10.0, 2000
_COLUMNS = (
    "package",
    "s a km",
    "MB a km",
    "free points blocked",
    "rays/s",
    "steps/s",
    "s a step",
    "what it is",
)
_NONE, _PEER = "-", "gymnasium-robotics"


@dataclass(frozen=True)
class PeerRow:
    """What one package does with the mine; None where it does no such thing."""

    package: str
    what: str
    make_s: float | None = None
    size: int | None = None
    blocked: float | None = None
    rays_per_s: float | None = None
    steps_per_s: float | None = None
    step_s: float | None = None

    def cells(self, km: float) -> list[str]:
        """Return the cells of the table; `km` is the length of the mine's drifts."""

        def shown(value: float | None, form: str) -> str:
            return _NONE if value is None else format(value, form)

        made = None if self.make_s is None else self.make_s / km
        size = None if self.size is None else self.size / 1e6 / km
        speeds = [shown(self.rays_per_s, ",.0f"), shown(self.steps_per_s, ",.0f"), shown(self.step_s, "g")]
        return [self.package, shown(made, ".2f"), shown(size, ".3f"), shown(self.blocked, ".2%"), *speeds, self.what]


def free_points(free: shapely.Polygon, rng: np.random.Generator) -> np.ndarray:
    """Return points (n, 2) m of the plan, even over the free space, where the ball touches no wall of the plan."""
    free = free.buffer(-2 * _BALL_M)
    west, south, east, north = free.bounds
    found = np.empty((0, 2))
    while len(found) < _POINTS:
        points = rng.uniform((west, south), (east, north), (4 * _POINTS, 2))
        found = np.vstack([found, points[shapely.contains_xy(free, points)]])
    return found[:_POINTS]


def blocked_share(spec: mujoco.MjSpec, places: np.ndarray, bit: int) -> float:
    """Return the share of places (n, 3) m at which a ball of 1 cm touches what has the contact bit."""
    ball = spec.worldbody.add_body(name="probe")
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[_BALL_M, 0, 0], mass=1.0, contype=bit, conaffinity=bit)
    model = spec.compile()
    data, geom, start = mujoco.MjData(model), model.ngeom - 1, model.nq - 7
    touched = 0
    for place in places:
        data.qpos[start : start + 3] = place
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        touched += bool((data.contact.geom[: data.ncon] == geom).any())
    return touched / len(places)


def rate(step: Callable[[], object], count: int) -> float:
    """Return how often a second something is done, after a tenth of it to warm up."""
    for _ in range(count // 10):
        step()
    start = time.perf_counter()
    for _ in range(count):
        step()
    return count / (time.perf_counter() - start)


def beams_at(angle: float) -> np.ndarray:
    """Return level directions (16, 3) of a robot's beams."""
    angles = angle + np.arange(_BEAMS) * math.tau / _BEAMS
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_BEAMS)])


def own(points: np.ndarray, make_s: float) -> PeerRow:
    """Return this project's row."""
    bundle = WORLD / "realism" / "world"
    world = load_world(bundle)
    env = MineEnv(bundle)
    env.reset(seed=0)
    rng = np.random.default_rng(0)

    def step() -> None:
        if env.step(rng.uniform(-1, 1, 2).astype(np.float32))[3]:
            env.reset()

    steps = rate(step, _STEPS)
    control_s = env.robots.task.control_s
    env.close()
    return PeerRow(
        "MineXplore",
        "the six stages with certificate; 16 beams, map and reward in a step",
        make_s,
        sum(path.stat().st_size for path in bundle.rglob("*") if path.is_file()),
        blocked_share(_rock_only(world), _in_world(world, points), 1),
        _own_rays(world, points),
        steps,
        control_s,
    )


def _in_world(world: World, points: np.ndarray) -> np.ndarray:
    places = np.column_stack([points, np.full(len(points), _EYE_M)])
    placed: np.ndarray = places @ world.T_world_mine[:3, :3].T + world.T_world_mine[:3, 3]
    return placed


def _rock_only(world: World) -> mujoco.MjSpec:
    spec = world.spec()
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = int(is_rock(geom.name))
    return spec


def _own_rays(world: World, points: np.ndarray) -> float:
    """Return rays/s of the environment's LiDAR, a thousand robots a call as in its vector form."""
    lidar = shared_lidar(world.folder, world.record["world_sha256"], _RANGE_M, "auto")
    origins = np.column_stack([points[:1000], np.full(1000, _EYE_M)])
    directions = np.stack([beams_at(angle) for angle in np.linspace(0, math.tau, 1000)])
    return directions.shape[0] * _BEAMS * rate(lambda: lidar.cast(origins, directions), 20)


def maze_of(free: shapely.Polygon) -> tuple[list[list[Any]], np.ndarray]:
    """Return a maze's cells, rows from the north, 1 for a wall, one `r` for the start; and its centre (2,) m."""
    west, south, east, north = free.bounds
    columns, rows = (math.ceil(size / _CELL_M) + 2 for size in (east - west, north - south))
    x = west + (np.arange(columns) - 0.5) * _CELL_M
    y = south + (rows - 1.5 - np.arange(rows)) * _CELL_M
    inside = shapely.contains_xy(free, *(axis.ravel() for axis in np.meshgrid(x, y))).reshape(rows, columns)
    maze: list[list[Any]] = np.where(inside, 0, 1).tolist()
    row, column = np.argwhere(inside)[len(np.argwhere(inside)) // 2]
    maze[row][column] = "r"
    return maze, np.array([x.mean(), y.mean()])


def gymnasium_robotics(free: shapely.Polygon, points: np.ndarray) -> PeerRow:
    """Return the row of PointMaze, which makes a wall of each square cell."""
    from gymnasium_robotics.envs.maze.point_maze import PointMazeEnv

    maze, centre = maze_of(free)
    start = time.perf_counter()
    env = PointMazeEnv(maze_map=maze)
    make_s = time.perf_counter() - start
    scale = env.maze.maze_size_scaling
    rng = np.random.default_rng(0)
    env.reset(seed=0)

    def step() -> None:
        if any(env.step(rng.uniform(-1, 1, 2).astype(np.float32))[2:4]):
            env.reset()

    steps, step_s = rate(step, _STEPS), float(env.point_env.dt)
    path = Path(env.tmp_xml_file_path)
    spec = mujoco.MjSpec.from_file(str(path))
    scaled = (points - centre) / _CELL_M * scale
    places = np.column_stack([scaled, np.full(len(scaled), env.maze.maze_height * scale / 2)])
    model, data = env.model, env.data
    return PeerRow(
        f"{_PEER} {version(_PEER)}",
        f"PointMaze of {_CELL_M:g} m cells; a step has the place and no beams; its rays are MuJoCo's",
        make_s,
        path.stat().st_size,
        blocked_share(spec, places, 1),
        _mujoco_rays(model, data, places[:200], _RANGE_M / _CELL_M * scale),
        steps,
        step_s,
    )


def _mujoco_rays(model: mujoco.MjModel, data: mujoco.MjData, places: np.ndarray, range_m: float) -> float:
    mujoco.mj_forward(model, data)
    found, geoms, rays = np.zeros(_BEAMS), np.zeros(_BEAMS, dtype=np.int32), beams_at(0.1).ravel()
    where = iter(np.tile(places, (20, 1)))

    def cast() -> None:
        mujoco.mj_multiRay(model, data, next(where), rays, None, 1, -1, geoms, found, None, _BEAMS, range_m)

    return _BEAMS * rate(cast, len(places))


def main() -> int:
    """Build the mine, measure every package that is installed, and write the page."""
    member = without_rock(generated("test", _MINE + 1, []), 0)[_MINE]
    shutil.rmtree(WORLD, ignore_errors=True)
    start = time.perf_counter()
    make_world(compose(member.overrides), WORLD)
    make_s = time.perf_counter() - start
    free = decode(WORLD / "realism" / "world" / FREE_SPACE, FreeSpace).polygon
    km = decode(WORLD / "realism" / "world" / TOPOLOGY, DriftNetwork).total_length_m / 1000
    points = free_points(free, np.random.default_rng(0))
    rows = [own(points, make_s).cells(km)]
    try:
        version(_PEER)
        rows.append(gymnasium_robotics(free, points).cells(km))
    except PackageNotFoundError:
        rows.append([_PEER, *[_NONE] * 6, "left out: not installed"])
    table = f"The mine has {km:.2f} km of drifts.\n\n{markdown_table(_COLUMNS, rows)}"
    write_table(TABLE, table)
    print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
