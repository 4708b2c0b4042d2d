"""The picture of docs/how-to/export.md: what trimesh reads of an exported glTF, in its colours and by its labels."""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np
import trimesh
from PIL import Image as Pillow

from minexplore.bundle import TOPOLOGY
from pipeline.export.extract import load_checked, read_scene
from pipeline.export.formats.gltf import write_gltf
from pipeline.export.frames import Z_UP_TO_Y_UP, apply
from pipeline.mjcf.assemble import heading_at
from pipeline.mjcf.bundle import read_record
from pipeline.store.codecs import decode
from pipeline.types import DriftNetwork

_WORLD = Path("artifacts/realism/world")
_VIEW_PX = (640, 400)
_HALF_WIDTH = 1.0  # tangent of half of the view's width
_EYE_M, _BACK_M = 1.7, 6.0  # of the eye over the floor, and behind the start
_AMBIENT, _REACH_M, _GAIN = 0.35, 9.0, 1.6  # light from nowhere, and how far the eye's lamp reaches; by eye


def draw_export(path: Path) -> None:
    """Draw two views along the default world's first drift."""
    record = read_record(_WORLD)
    scene = read_scene(record, load_checked(_WORLD), "not stated")
    network: DriftNetwork = decode(_WORLD / TOPOLOGY, DriftNetwork)
    heading = heading_at(network, record.spawn.anchor_m)
    ahead = np.array([np.cos(heading), np.sin(heading), -0.06])
    eye = np.array([*record.spawn.anchor_m, _EYE_M]) - _BACK_M * ahead
    T = Z_UP_TO_Y_UP @ np.array(record.T_world_mine)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{record.name}.glb"
        file.write_bytes(write_gltf(scene)[file.name])
        picture = _views(trimesh.load_scene(file, process=False), apply(T, eye[None])[0], T[:3, :3] @ ahead)
    Pillow.fromarray(picture).save(path, quality=80)


def _views(scene: trimesh.Scene, eye_m: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Return two views (rows, cols, 3) uint8 side by side, by rays from an eye (3,) m in the file's frame."""
    mesh, colours, label = _joined(scene)
    width, height = _VIEW_PX
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    across, down = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height) * height / width)
    rays = ahead + _HALF_WIDTH * (across[..., None] * right - down[..., None] * np.cross(right, ahead))
    rays = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3)
    face = mesh.ray.intersects_first(np.tile(eye_m, (len(rays), 1)), rays)
    slant = (mesh.face_normals[face] * rays).sum(axis=1)
    across_m = (mesh.face_normals[face] * (mesh.triangles[face, 0] - eye_m)).sum(axis=1)
    far = np.abs(across_m) / np.maximum(np.abs(slant), 1e-6)
    light = ((_AMBIENT + np.abs(slant)) / (1 + (far / _REACH_M) ** 2))[:, None]
    palette = mpl.colormaps["tab10"](np.arange(10))[:, :3]
    seen = (face >= 0)[:, None]
    views = [
        np.where(seen, colour, 0.0) for colour in (_GAIN * light * colours[face], palette[label[face]] * (0.5 + light))
    ]
    picture = np.concatenate([view.reshape(height, width, 3) for view in views], axis=1)
    return (255 * np.clip(picture, 0, 1)).astype(np.uint8)


def _joined(scene: trimesh.Scene) -> tuple[trimesh.Trimesh, np.ndarray, np.ndarray]:
    """Return all meshes as one, the colour (n, 3) of each face, and the number (n,) of its label."""
    edges, labels = scene.graph.transforms, list[str]()
    vertices, colours, numbers = [], [], []
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph.get(node)
        mesh = scene.geometry[geometry]
        label = edges.edge_data[(edges.parents[node], node)]["metadata"]["label"]
        labels += [] if label in labels else [label]
        vertices.append(trimesh.transform_points(mesh.vertices, matrix)[mesh.faces])
        paint = np.atleast_2d(mesh.visual.to_color().vertex_colors)[:, :3] / 255
        by_corner = paint[mesh.faces].mean(axis=1) if len(paint) == len(mesh.vertices) else paint[:1]
        colours.append(np.broadcast_to(by_corner, (len(mesh.faces), 3)))
        numbers.append(np.full(len(mesh.faces), labels.index(label) % 10))
    corners = np.concatenate(vertices).reshape(-1, 3)
    whole = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    return whole, np.concatenate(colours), np.concatenate(numbers)
