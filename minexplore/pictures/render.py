"""Pictures of robots in a mine: cameras behind and on a robot in the world itself, and the plan with what was seen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from minexplore.bundle import MINE_BODY, GeomGroup, has_visible_rock, is_shade
from minexplore.looks import EXTENT_M, look_of
from minexplore.physics.robot import qpos_address, separate_contacts
from minexplore.physics.robot_kind import Robot
from minexplore.pictures.atmosphere import add_haze, add_headlamp, add_sky, has_haze, let_light_pass
from minexplore.pictures.opengl import new_renderer
from minexplore.pictures.shown import shown_spec
from minexplore.pictures.sight import draw_seen
from minexplore.rotations import quaternion
from minexplore.sensing.coverage import CellGrid
from minexplore.world import World

CAMERAS = ("chase", "top", "front")
_FRONT_FOVY_DEG, _FRONT_DOWN_DEG, _FRONT_ABOVE_M = 75.0, 2.0, 0.1  # of the camera on a robot, above its scanner
_SEEN_M, _HIDDEN = 90.0, GeomGroup.SMOOTH_SURFACE  # what is nearer is drawn in the haze's colour, not left out
_LIGHTS = 7  # OpenGL's eight less the headlight
_ROCK, _FREE, _CELL, _SEEN, _ROBOT = (54, 47, 42), (150, 140, 128), (190, 182, 170), (92, 168, 96), (232, 150, 30)


def shown_groups(world: World) -> list[GeomGroup]:
    """Return the geom groups that pictures show: floor, robots, and the visible rock or else what LiDARs hit."""
    bare = [GeomGroup.COLLISION, GeomGroup.ROOF]
    rock = [GeomGroup.ROUGH_SURFACE] if has_visible_rock(world.record) else bare
    return [GeomGroup.FLOOR, GeomGroup.ROBOT, *rock]


def light_nearest(model: mujoco.MjModel, data: mujoco.MjData, eye_m: np.ndarray) -> None:
    """Switch on the spot lights nearest to a place (3,) m, world frame, as many as OpenGL has, and the others off."""
    distance_m = np.linalg.norm(data.light_xpos - eye_m, axis=1)
    model.light_active[:] = 0
    model.light_active[np.argsort(distance_m, kind="stable")[:_LIGHTS]] = 1


@contextmanager
def far_hidden(model: mujoco.MjModel, data: mujoco.MjData, eye_m: np.ndarray) -> Iterator[None]:
    """Hide what lies beyond the haze of a model that has any; a frame of the embedded mine then takes half as long."""
    if not has_haze(model):
        yield
        return
    groups = model.geom_group.copy()
    reach_m = max(_SEEN_M, EXTENT_M * float(model.vis.map.fogend))
    far = np.linalg.norm(data.geom_xpos - eye_m, axis=1) - model.geom_rbound > reach_m
    model.geom_group[far & (model.geom_rbound > 0)] = _HIDDEN  # a plane has no bound
    try:
        yield
    finally:
        model.geom_group[:] = groups


class Renderer:
    """Draws robots given as rows of `qpos` (n, numbers): the free joint, then wheels."""

    def __init__(
        self,
        world: World,
        T_world_mine: np.ndarray,
        grid: CellGrid,
        robot: Robot,
        robots: int,
        size_px: tuple[int, int] = (640, 480),
    ) -> None:
        """Prepare; the world is compiled with its meshes when a camera is first used."""
        self.world, self.grid, self.robot, self.robots, self.size_px = world, grid, robot, robots, size_px
        self.T_world_mine = T_world_mine
        self.model: mujoco.MjModel | None = None
        self._renderer: mujoco.Renderer | None = None

    def draw(self, camera: str, qpos: np.ndarray, seen: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return a picture (height, width, 3) uint8 RGB: from behind or from the first robot, or all from above."""
        return self._plan(seen, poses) if camera == "top" else self._view(camera, qpos)

    def place(self, qpos: np.ndarray) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Return the whole world's model and data with the robots at rows of `qpos`."""
        if self.model is None:
            self.model = self._compile()
            self.data = mujoco.MjData(self.model)
            names = [self.model.geom(geom).name for geom in range(self.model.ngeom)]
            # A lamp stands so near above its scanner that the scanner's shadow would be a wedge before the robot.
            scanners = {f"robot_{i}_scanner" for i in range(self.robots)}
            self.clear = {geom for geom, name in enumerate(names) if is_shade(name) or name in scanners}
            self._fovy_deg = float(self.model.vis.global_.fovy)
            self._at = np.stack([qpos_address(self.model, f"robot_{i}", self.robot.JOINTS) for i in range(self.robots)])
        self.data.qpos[self._at] = qpos[:, : self._at.shape[1]]  # behind these are the springs of castors
        mujoco.mj_forward(self.model, self.data)
        return self.model, self.data

    def _compile(self) -> mujoco.MjModel:
        if self.world.volume is None:
            spec = self.world.spec()
            separate_contacts(spec)
        else:
            spec = shown_spec(self.world)
        look = look_of(self.world.record)
        add_sky(spec, look)
        for i in range(self.robots):
            self.robot.attach(spec, f"robot_{i}")
            add_headlamp(spec, f"robot_{i}", look, self.robot.lamp_height_m)
        mine = spec.body(MINE_BODY)
        mine.quat, mine.pos = quaternion(self.T_world_mine[:3, :3]), self.T_world_mine[:3, 3]
        spec.visual.global_.offwidth, spec.visual.global_.offheight = self.size_px
        return self.world.compile(spec)

    def _view(self, name: str, qpos: np.ndarray) -> np.ndarray:
        model, data = self.place(qpos)
        if self._renderer is None:
            self._renderer = new_renderer(model, self.size_px, max_geom=2 * model.ngeom + 1000)
        renderer = self._renderer
        option = mujoco.MjvOption()
        option.geomgroup[:] = 0
        option.geomgroup[shown_groups(self.world)] = 1
        body = model.body("robot_0").id
        camera = self._behind(data, body) if name == "chase" else self._ahead(data, body)
        model.vis.global_.fovy = self._fovy_deg if name == "chase" else _FRONT_FOVY_DEG
        light_nearest(model, data, data.xpos[body])
        with far_hidden(model, data, data.xpos[body]):
            draw_seen(renderer, lambda: renderer.update_scene(data, camera, option))
        add_haze(model, renderer.scene)
        let_light_pass(renderer.scene, self.clear)
        return renderer.render().copy()

    def _behind(self, data: mujoco.MjData, body: int) -> mujoco.MjvCamera:
        camera = _looking_along(data.xmat[body].reshape(3, 3)[:, 0])
        camera.lookat[:] = data.xpos[body] + [0, 0, 0.3]
        camera.distance, camera.elevation = 2.2, -18.0
        return camera

    def _ahead(self, data: mujoco.MjData, body: int) -> mujoco.MjvCamera:
        """Return a camera on top of the scanner, which looks ahead and sees nothing of its own robot."""
        axes = data.xmat[body].reshape(3, 3)
        camera = _looking_along(axes[:, 0])
        camera.elevation -= _FRONT_DOWN_DEG
        eye = data.xpos[body] + (self.robot.lamp_height_m + _FRONT_ABOVE_M) * axes[:, 2]
        camera.distance = 0.01
        azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
        level = np.cos(elevation)
        ahead = np.array([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)])
        camera.lookat[:] = eye + camera.distance * ahead
        return camera

    def _plan(self, seen: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return the floor plan round the reachable cells: seen cells green, robots orange."""
        world, grid = self.world, self.grid
        reachable = grid.in_plan(grid.reachable)
        rows, cols = np.nonzero(reachable)
        low = grid.origin_m + np.array([cols.min() - 1, rows.min() - 1]) * grid.cell_m
        high = grid.origin_m + np.array([cols.max() + 2, rows.max() + 2]) * grid.cell_m
        width, height = self.size_px
        scale = min(width / (high[0] - low[0]), height / (high[1] - low[1]))
        x = low[0] + (np.arange(width) + 0.5 - (width - scale * (high[0] - low[0])) / 2) / scale
        y = high[1] - (np.arange(height) + 0.5 - (height - scale * (high[1] - low[1])) / 2) / scale
        place = np.stack(np.meshgrid(x, y), axis=-1)
        free = _lookup(world.clearance_m > 0, place, world.origin_m, world.cell_m)
        picture = np.where(free[..., None], np.array(_FREE), np.array(_ROCK))
        picture[free & _lookup(reachable, place, grid.origin_m, grid.cell_m)] = _CELL
        picture[free & _lookup(grid.in_plan(seen), place, grid.origin_m, grid.cell_m)] = _SEEN
        for px, py, yaw in poses:
            mark = max(self.robot.radius_m, 4 / scale)
            ahead = (place[..., 0] - px) * np.cos(yaw) + (place[..., 1] - py) * np.sin(yaw)
            far = np.hypot(place[..., 0] - px, place[..., 1] - py)
            picture[far <= mark] = _ROBOT
            picture[(far <= mark) & (ahead > 0.4 * mark)] = _ROCK
        return picture.astype(np.uint8)

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _looking_along(heading: np.ndarray) -> mujoco.MjvCamera:
    """Return a free camera that looks along a unit vector (3,)."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.azimuth = float(np.degrees(np.arctan2(heading[1], heading[0])))
    camera.elevation = float(np.degrees(np.arcsin(np.clip(heading[2], -1.0, 1.0))))
    return camera


def _lookup(mask: np.ndarray, place: np.ndarray, origin_m: np.ndarray, cell_m: float) -> np.ndarray:
    col, row = np.moveaxis(np.floor((place - origin_m) / cell_m).astype(int), -1, 0)
    inside = (row >= 0) & (row < mask.shape[0]) & (col >= 0) & (col < mask.shape[1])
    return inside & mask[np.clip(row, 0, mask.shape[0] - 1), np.clip(col, 0, mask.shape[1] - 1)]
