"""How fast sensors are, beside MuJoCo's own rays in the same run and world."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup, stops_beams
from minexplore.envs.env import MineEnv
from minexplore.pictures.cameras import CameraParams
from minexplore.sensing.params import preset_names, sensor_params
from minexplore.sensing.scanners import Mount, Pose3D, scanner_of
from minexplore.world import World

_TRIES = 12
_PEER_RAYS = 4096  # a call, so that one call takes well under a second
_MOUNT = Mount(height_m=0.7)
_IMAGES = 5


def best_rate(work: Callable[[], object], count: int, tries: int = _TRIES) -> float:
    """Return how many of `count` things are done a second of a processor, in the fastest of several tries.

    The time of all threads counts: OpenGL in software has several.
    """
    work()
    spent = []
    for _ in range(tries):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return count / min(spent)


def pose_at_entrance(world: World) -> Pose3D:
    """Return a level pose at the world's anchor."""
    return Pose3D(np.array([*world.record["spawn"]["anchor_m"], 0.0]), np.eye(3))


def own_rates(world: World, name: str = "os1-64") -> list[list[str]]:
    """Return rows of rays/s: ranges alone, ranges with label and incidence, and clouds under each preset."""
    pose, rng = pose_at_entrance(world), np.random.default_rng(0)
    scanner = scanner_of(name, world, _MOUNT)
    directions, origin = scanner.pattern.scan().directions, _MOUNT.on(pose).place_m
    caster, count = scanner.caster, len(directions)
    rows = [
        ("MineXplore, ranges and faces", best_rate(lambda: caster.strike(origin, directions), count)),
        ("MineXplore, with label and incidence", best_rate(lambda: caster.cast(origin, directions), count)),
    ]
    for preset in preset_names():
        degraded = scanner_of(name, world, _MOUNT, sensor_params(preset))
        rows.append((f"MineXplore, a cloud, {preset}", best_rate(partial(degraded.scan, pose, rng), count)))
    return [[label, f"{rate:,.0f}"] for label, rate in rows]


def mujoco_rate(world: World) -> list[str]:
    """Return the row of rays/s of MuJoCo's own rays in the same world."""
    spec = world.spec()
    for geom in spec.geoms:
        is_mesh = geom.type == mujoco.mjtGeom.mjGEOM_MESH
        shown = geom.group == GeomGroup.FLOOR or (
            geom.group == GeomGroup.ROUGH_SURFACE and is_mesh and stops_beams(geom.meshname)
        )
        geom.group = 0 if shown else 5
    model = world.compile(spec)
    data = mujoco.MjData(model)
    turn, shift = world.T_world_mine[:3, :3], world.T_world_mine[:3, 3]
    eye = turn @ _MOUNT.on(pose_at_entrance(world)).place_m + shift
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(0)
    theta, phi = rng.uniform(-np.pi, np.pi, _PEER_RAYS), rng.uniform(-0.29, 0.29, _PEER_RAYS)
    level = np.cos(phi)
    ways = np.column_stack([level * np.cos(theta), level * np.sin(theta), np.sin(phi)]).ravel()
    found, geoms = np.zeros(_PEER_RAYS), np.zeros(_PEER_RAYS, dtype=np.int32)
    groups = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)

    def cast() -> None:
        mujoco.mj_multiRay(model, data, eye, ways, groups, 1, -1, geoms, found, None, _PEER_RAYS, 120.0)

    return [f"MuJoCo {mujoco.__version__}, mj_multiRay", f"{best_rate(cast, _PEER_RAYS, 3):,.0f}"]


def image_rates(env: MineEnv) -> list[list[str]]:
    """Return rows of frames/s of the camera's images, by the OpenGL library of this machine."""
    env.reset(seed=0)
    camera = CameraParams.on(env.robot)
    size = f"{camera.width_px} x {camera.height_px}"
    images = ("rgb", "depth", "labels")
    return [[name, size, f"{best_rate(partial(env.capture, name), 1, _IMAGES):.1f}"] for name in images]
