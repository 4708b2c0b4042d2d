"""The picture of a scan with colours: its points, and its world from the same place."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import manifold3d
import mujoco
import numpy as np
import trimesh

from minexplore.bundle import MINE_BODY, MODEL, GeomGroup
from pipeline.compose import compose
from pipeline.params.survey import CloudSurveyParams
from pipeline.store.files import write_atomically
from pipeline.survey.load import read_survey
from pipeline.types import Image
from pipeline.volume.world.bundle import bundle_volume
from stages.compile3d import compile_rock
from stages.contours import trace_free_space
from stages.surface import model_surface

_PER_M2, _NOISE_M, _QUALITY = 400, 0.02, 85
_SIZE_PX, _FOVY_DEG, _DOT_PX = (640, 480), 60.0, 9
_EYE_M, _TO_M = np.array([1.5, 2.6, 1.7]), np.array([12.0, 1.2, 1.4])
_HOLE_M, _HOLE = 0.8, (5.5, 0.0, 1.4)  # a place on the wall that nobody scanned
_BEDS = np.array([(122, 104, 88), (150, 128, 96), (96, 92, 92), (168, 150, 124)])  # each 0.6 m thick, red, green, blue
_VEIN = (206, 170, 92)


def draw_scan_colours(path: Path) -> None:
    """Scan a drift with a crosscut through beds that dip, and draw the points and the world."""
    rng = np.random.default_rng(0)
    drift = manifold3d.Manifold.cube([16, 4, 3]) + manifold3d.Manifold.cube([3.5, 9, 3]).translate([9, 0, 0])
    mesh = drift.to_mesh()
    solid = trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), process=False)
    places = np.asarray(trimesh.sample.sample_surface(solid, int(_PER_M2 * solid.area), seed=0)[0])
    places = places[np.linalg.norm(places - _HOLE, axis=1) > _HOLE_M]
    points, rgb = places + rng.normal(0, _NOISE_M, places.shape), _colours(places, rng)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        trimesh.PointCloud(points, colors=rgb).export(folder / "scan.ply")
        pictures = [_of_points(points, rgb), _of_world(folder)]
    for picture, title in zip(pictures, ("the points of a scan", "its world"), strict=True):
        cv2.putText(picture, title, (12, 28), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (255, 255, 255), 2, cv2.LINE_AA)
    done, data = cv2.imencode(".jpg", cv2.hconcat(pictures), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    assert done
    write_atomically(path, data.tobytes())


def _colours(places: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the colours (n, 3) of beds that dip to the east, with a vein across them."""
    x, y, z = places.T
    depth = z + 0.12 * x + 0.05 * y
    rgb = _BEDS[np.floor(depth / 0.6).astype(int) % len(_BEDS)].astype(float)
    rgb[np.abs(x - 0.8 * z - 4 + 0.3 * y) < 0.12] = _VEIN
    return np.clip(rgb + rng.normal(0, 6, rgb.shape), 1, 255).astype(np.uint8)


def _of_points(points: np.ndarray, rgb: np.ndarray) -> Image:
    """Return the points as dots on black, far ones first."""
    ahead = (_TO_M - _EYE_M) / np.linalg.norm(_TO_M - _EYE_M)
    right = np.cross(ahead, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    across, up, far = np.array([right, np.cross(right, ahead), ahead]) @ (points - _EYE_M).T
    width, height = _SIZE_PX
    focal = height / 2 / np.tan(np.radians(_FOVY_DEG / 2))
    picture = np.zeros((height, width, 3), np.uint8)
    for k in np.argsort(-far)[: int((far > 0.3).sum())].tolist():
        centre = round(width / 2 + focal * across[k] / far[k]), round(height / 2 - focal * up[k] / far[k])
        if 0 <= centre[0] < width and 0 <= centre[1] < height:
            radius = max(1, round(_DOT_PX / far[k]))
            cv2.circle(picture, centre, radius, rgb[k, ::-1].tolist(), -1)
    return picture


def _of_world(folder: Path) -> Image:
    """Return a picture of the world that stages 1 to 5 make of `scan.ply` in a folder."""
    config = compose(["+mine=heights"])
    params = CloudSurveyParams(kind="cloud", name="scan", file="data/x", heights=None, voxel_m=0.15)
    read = read_survey(params.model_copy(update={"file": (folder / "scan.ply").as_posix()}))
    whole = (read["network"], read["solid"], read["floors"])
    traced = trace_free_space(config.contours, read["plan"], read["survey"], read["workings"], *whole)
    free, network = traced["free_space"], traced["topology"]
    stage_3 = compile_rock(config.compile3d, free, network, read["survey"], *whole)
    compiled = _written(folder / "compiled", stage_3["volume"])
    stage_4 = model_surface(config.surface, free, network, stage_3["extent"], compiled, read["solid"])
    rough = _written(folder / "rough", stage_4["rough"])
    files = bundle_volume(config.realism, read["survey"], free, compiled, rough, stage_4["texture"])
    model = mujoco.MjModel.from_xml_path(str(_written(folder / "world", files) / MODEL))
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.5
    model.vis.global_.fovy = _FOVY_DEG
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera, lift = mujoco.MjvCamera(), np.array([0, 0, 1.0])  # the mine frame's zero is a metre below the floor
    way = _TO_M - _EYE_M
    camera.lookat[:], camera.distance = model.body(MINE_BODY).pos + _TO_M + lift, np.linalg.norm(way)
    camera.azimuth = np.degrees(np.arctan2(way[1], way[0]))
    camera.elevation = np.degrees(np.arcsin(way[2] / camera.distance))
    shown = mujoco.MjvOption()
    shown.geomgroup[GeomGroup.COLLISION] = 0
    width, height = _SIZE_PX
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera, shown)
        return np.ascontiguousarray(renderer.render()[..., ::-1])


def _written(folder: Path, files: dict[str, bytes]) -> Path:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder
