"""A camera on a robot: colour, depth and labels, drawn by MuJoCo without a display."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import mujoco
import numpy as np

from minexplore.bundle import GeomGroup, fitting_geom, floor_geom, is_cover, is_floor, is_shade, puddle_geom
from minexplore.limits import Span, check_numbers
from minexplore.physics.robot_kind import Robot
from minexplore.pictures.atmosphere import add_haze, let_light_pass
from minexplore.pictures.opengl import new_renderer, prepare_opengl
from minexplore.pictures.render import Renderer, far_hidden, light_nearest, shown_groups
from minexplore.pictures.sight import draw_seen
from minexplore.sensing.mount import Mount, Pose3D
from minexplore.sensing.scanners.labels import NOTHING, NUMBERS, WATER, label_of_mesh, label_of_zone
from minexplore.world import World

_SPANS = {
    "width_px": Span(16, 640, whole=True),  # the size of MuJoCo's buffer for the robots' views
    "height_px": Span(16, 480, whole=True),
    "fovy_deg": Span(5.0, 150.0),
    "baseline_m": Span(0.001, 1.0),
    "depth_m": Span(0.1, 1000.0),
}
_HIDDEN = GeomGroup.SMOOTH_SURFACE
_DOWN_DEG = 5.0  # of a robot's camera: the ground a few metres ahead is in the picture


@dataclass(frozen=True)
class CameraParams:
    """A camera: by default an Intel RealSense D455 on the Husky's front.

    Its field upwards at 4 to 3 and its baseline are those of the data sheet (Intel RealSense D400 Series, 337029-009,
    2020), whose 75 deg in width square pixels miss by 2. Not verified: `depth_m`, the farthest that it measures.
    """

    width_px: int = 320
    height_px: int = 240
    fovy_deg: float = 62.0
    baseline_m: float = 0.095
    depth_m: float = 20.0
    mount: Mount = field(default_factory=lambda: Mount(x_m=0.36, height_m=0.5, pitch_deg=_DOWN_DEG))

    def __post_init__(self) -> None:
        """Refuse numbers that no camera has."""
        check_numbers("camera", self, _SPANS)
        if not isinstance(self.mount, Mount):
            raise ValueError(f"camera: mount = {self.mount!r:.100}: want Mount(...)")

    @classmethod
    def on(cls, robot: Robot) -> Self:
        """Return the camera of a robot."""
        ahead_m, height_m = robot.camera_m
        return cls(mount=Mount(x_m=ahead_m, height_m=height_m, pitch_deg=_DOWN_DEG))

    @property
    def focal_px(self) -> float:
        """Return the focal length in pixels, the same in width and height."""
        return float(self.height_px / 2 / np.tan(np.radians(self.fovy_deg) / 2))


class RobotCamera:
    """Draws what a camera on the first robot sees; `view` is what draws the whole world."""

    def __init__(self, world: World, view: Renderer, params: CameraParams | None = None) -> None:
        """Take the world and its renderer; nothing is compiled before the first picture."""
        prepare_opengl("rgb_array")
        self.params, self._view = params or CameraParams(), view
        self._groups = shown_groups(world)
        self._zones = {zone.name: label_of_zone(zone) for zone in world.floor_zones}
        self._zone_numbers = [label_of_zone(zone) for zone in world.floor_zones]
        self._renderer: mujoco.Renderer | None = None

    def colour(self, qpos: np.ndarray, pose: Pose3D) -> np.ndarray:
        """Return a picture (h, w, 3) uint8 RGB in the light of the headlamp; `pose` is the robot's, world frame."""
        return self._draw(qpos, pose).copy()

    def depth(self, qpos: np.ndarray, pose: Pose3D) -> np.ndarray:
        """Return depths (h, w) float32 m along the camera's axis, 0 beyond the farthest it measures."""
        renderer = self._ready(qpos)
        renderer.enable_depth_rendering()
        try:
            depth = self._draw(qpos, pose, clear=False).copy()
        finally:
            renderer.disable_depth_rendering()
        depth[depth > self.params.depth_m] = 0.0
        return depth

    def labels(self, qpos: np.ndarray, pose: Pose3D) -> np.ndarray:
        """Return labels (h, w) uint8 of `LABELS`."""
        renderer = self._ready(qpos)
        renderer.enable_segmentation_rendering()
        try:
            numbers = self._draw(qpos, pose, clear=False)
        finally:
            renderer.disable_segmentation_rendering()
        is_geom = numbers[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)
        return np.where(is_geom, self._labels[np.where(is_geom, numbers[..., 0], 0)], NOTHING).astype(np.uint8)

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _ready(self, qpos: np.ndarray) -> mujoco.Renderer:
        model, _ = self._view.place(qpos)
        if self._renderer is None:
            size = self.params.width_px, self.params.height_px
            self._renderer = new_renderer(model, size, max_geom=2 * model.ngeom + 1000)
            names = [model.geom(number).name for number in range(model.ngeom)]
            self._labels = np.array([self._label(name) for name in names], dtype=np.uint8)
            self._shades = np.array([is_shade(name) for name in names])
        return self._renderer

    def _label(self, geom: str) -> int:
        """Return the label of a geom of the whole world by its name."""
        if geom.startswith(puddle_geom("")):
            return WATER
        if geom.startswith("robot_") or not geom:  # a robot's drawn wheels have no names
            return NUMBERS["robot"]
        mesh = geom.removeprefix(fitting_geom(""))
        if is_cover(mesh):
            return self._zone_numbers[int(mesh.split("_")[1])]
        if is_floor(geom):
            return next((label for name, label in self._zones.items() if geom.startswith(floor_geom(name))), NOTHING)
        return label_of_mesh(geom)

    def _draw(self, qpos: np.ndarray, pose: Pose3D, clear: bool = True) -> np.ndarray:
        """Return what the renderer draws; without `clear` nothing clear is drawn, which would hide the floor."""
        renderer = self._ready(qpos)
        model, data = self._view.model, self._view.data
        assert model is not None  # the view is placed
        option = mujoco.MjvOption()
        option.geomgroup[:] = 0
        option.geomgroup[self._groups] = 1
        eye = self.params.mount.on(pose)
        model.vis.global_.fovy = self.params.fovy_deg
        light_nearest(model, data, eye.place_m)
        groups = model.geom_group.copy()
        if not clear:
            model.geom_group[self._shades] = _HIDDEN

        def update() -> None:
            renderer.update_scene(data, mujoco.MjvCamera(), option)
            for camera in renderer.scene.camera:
                camera.pos, camera.forward, camera.up = eye.place_m, eye.axes[:, 0], eye.axes[:, 2]

        with far_hidden(model, data, eye.place_m):
            if clear:
                draw_seen(renderer, update)
            else:
                update()
        model.geom_group[:] = groups
        if clear:
            add_haze(model, renderer.scene)
            let_light_pass(renderer.scene, self._view.clear)
        drawn: np.ndarray = renderer.render()
        return drawn
