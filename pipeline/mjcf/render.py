"""Pictures of a compiled world, rendered off screen by OSMesa on any machine."""

from __future__ import annotations

import os
from collections.abc import Iterable

import cv2
import mujoco
import numpy as np

from minexplore.bundle import ENTRANCE_CAMERA, OVERVIEW_CAMERA, GeomGroup
from minexplore.pictures.atmosphere import add_haze
from minexplore.pictures.render import light_nearest
from pipeline.errors import ArtifactError
from pipeline.types import Frame, Image, Mask

_CAMERA_HEIGHT_M = 50.0
_COLOUR_PLACES = np.array([1, 1 << 8, 1 << 16])  # of a geom's number in the three channels of a segmented picture


def render_camera(
    model: mujoco.MjModel, camera: str, width: int, height: int, groups: Iterable[int], spots: bool = True
) -> Image:
    """Render one of the world's cameras.

    OpenGL lights a scene with at most eight lights, so only the spot lights nearest to the camera are on.

    Parameters
    ----------
    model : mujoco.MjModel
    camera : str
    width, height : int
        px.
    groups : iterable of int
        The visible geom groups.
    spots : bool
        Switch on spot lights; if False, only the headlight is on.

    Returns
    -------
    (height, width, 3) uint8, BGR
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with _sized(model, (width, height)) as renderer:
        return _draw(renderer, data, camera, data.cam_xpos[model.camera(camera).id], groups, spots)


def render_preview(model: mujoco.MjModel, width_px: int) -> Image:
    """Return two views below each other, (height, width_px, 3) uint8, BGR: the mine from above, and its entrance."""
    solid, visible = (GeomGroup.FLOOR, GeomGroup.COLLISION), (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE)
    overview = render_camera(model, OVERVIEW_CAMERA, width_px, width_px * 9 // 16, solid, spots=False)
    rows = np.flatnonzero((overview != overview[0, 0]).any(axis=(1, 2)))
    entrance = render_camera(model, ENTRANCE_CAMERA, width_px, width_px * 7 // 16, visible)
    return cv2.vconcat([overview[rows[0] : rows[-1] + 1], entrance])


def render_from(
    model: mujoco.MjModel,
    views_m: Iterable[tuple[np.ndarray, np.ndarray]],
    fovy_deg: float,
    size_px: tuple[int, int],
    groups: Iterable[int],
) -> list[Image]:
    """Render views from an eye (3,) towards a place (3,), m, world frame, as (height, width, 3) uint8, BGR each."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = float(model.vis.global_.fovy)
    model.vis.global_.fovy = fovy_deg
    try:
        with _sized(model, size_px) as renderer:
            return [_draw(renderer, data, _camera_at(*view), view[0], groups, spots=True) for view in views_m]
    finally:
        model.vis.global_.fovy = before


def _camera_at(eye_m: np.ndarray, towards_m: np.ndarray) -> mujoco.MjvCamera:
    along = (towards_m - eye_m) / np.linalg.norm(towards_m - eye_m)
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat, camera.distance = eye_m + 0.01 * along, 0.01
    camera.azimuth = np.degrees(np.arctan2(along[1], along[0]))
    camera.elevation = np.degrees(np.arcsin(along[2]))
    return camera


def _sized(model: mujoco.MjModel, size_px: tuple[int, int]) -> _Renderer:
    """Return a renderer of pictures of a size; to make one takes 0.4 s of a world with rock."""
    width, height = model.vis.global_.offwidth, model.vis.global_.offheight = size_px
    return _Renderer(model, height, width)


def _draw(
    renderer: _Renderer,
    data: mujoco.MjData,
    camera: str | mujoco.MjvCamera,
    eye_m: np.ndarray,
    groups: Iterable[int],
    spots: bool,
) -> Image:
    model = renderer.model
    active = model.light_active.copy()
    if spots:
        light_nearest(model, data, eye_m)
    else:
        model.light_active[:] = 0
    try:
        renderer.update_scene(data, camera, _options(groups))
        if spots:  # a view from above is farther away than any haze
            add_haze(model, renderer.scene)
        return renderer.render()[..., ::-1].copy()
    finally:
        model.light_active[:] = active


def render_free_space(model: mujoco.MjModel, T_world_mine: np.ndarray, frame: Frame, z_top_m: float) -> Mask:
    """Render the world from straight above on the pixel grid of the plan and mark the pixels that show the floor.

    Parameters
    ----------
    model : mujoco.MjModel
        Floor geoms in group 0, rock in group 3.
    T_world_mine : (4, 4)
        The pose of the mine frame that the record states.
    frame : Frame
        The plan's pixel grid.
    z_top_m : float
        Top of the rock, m, mine frame.

    Returns
    -------
    (height_px, width_px) bool
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    west, south, east, north = frame.extent_m
    model.vis.global_.offwidth, model.vis.global_.offheight = frame.width_px, frame.height_px
    model.vis.quality.offsamples = 0  # no antialiasing: a pixel shows one geom
    with _Renderer(model, frame.height_px, frame.width_px) as renderer:
        renderer.update_scene(data, mujoco.MjvCamera(), _options((GeomGroup.FLOOR, GeomGroup.COLLISION)))
        place = T_world_mine @ [(west + east) / 2, (south + north) / 2, z_top_m + _CAMERA_HEIGHT_M, 1.0]
        for camera in renderer.scene.camera:
            camera.pos, camera.forward, camera.up = place[:3], -T_world_mine[:3, 2], T_world_mine[:3, 1]
            camera.orthographic = 1
            camera.frustum_center, camera.frustum_width = 0.0, 0.0
            camera.frustum_bottom, camera.frustum_top = -(north - south) / 2, (north - south) / 2
            camera.frustum_near, camera.frustum_far = 1.0, 2 * _CAMERA_HEIGHT_M + z_top_m
        return _shows(renderer, np.flatnonzero(model.geom_group == GeomGroup.FLOOR))


def _shows(renderer: mujoco.Renderer, geoms: np.ndarray) -> Mask:
    """Render the scene and mark the pixels (rows, cols) that show one of these geoms.

    The renderer's own segmentation holds 60 bytes a pixel meanwhile, 0.4 GB for the plan of the default mine.
    """
    scene = renderer.scene
    for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
        scene.flags[flag] = 1
    wanted = np.zeros(scene.ngeom + 1, dtype=bool)  # by number, 0 is the background
    for geom in scene.geoms[: scene.ngeom]:
        wanted[geom.segid + 1] = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid in geoms
    picture = renderer.render()
    mask = np.empty(picture.shape[:2], dtype=bool)
    for row, colour in zip(mask, picture, strict=True):
        row[:] = wanted[colour @ _COLOUR_PLACES]
    return mask


def _options(groups: Iterable[int]) -> mujoco.MjvOption:
    option = mujoco.MjvOption()
    option.geomgroup[:] = 0
    option.geomgroup[list(groups)] = 1
    return option


class _Renderer(mujoco.Renderer):
    """A renderer that reports a missing OSMesa; `with` closes it.

    Pictures are drawn into MuJoCo's own buffer, which is as large as the model says. That of OSMesa takes 16 bytes a
    pixel more and nothing is drawn into it, so it has one pixel.
    """

    _gl_context = _mjr_context = None  # `close` reads them even if the constructor fails

    def __init__(self, model: mujoco.MjModel, height: int, width: int) -> None:
        quality, shadow_px = model.vis.quality, model.vis.quality.shadowsize
        if not model.light_castshadow.any():
            quality.shadowsize = 0  # 64 MB and a third of the time that a context takes
        try:
            super().__init__(model, 1, 1, max_geom=2 * model.ngeom + 1000)
        except (AttributeError, ImportError, RuntimeError, mujoco.FatalError) as error:
            backend = os.environ["MUJOCO_GL"]
            raise ArtifactError(
                f"rendering: MUJOCO_GL={backend} gives no OpenGL context of {width} x {height} px ({error}); "
                "`make setup` installs libosmesa6"
            ) from error
        finally:
            quality.shadowsize = shadow_px
        self._width, self._height, self._rect = width, height, mujoco.MjrRect(0, 0, width, height)
