"""The meshes of a world as a 3D scene for a browser: simplified rock walls, and the floor in its zones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d
import shapely
import trimesh
from trimesh.viewer.notebook import scene_to_html

from minexplore.floor import Floor
from pipeline.geometry.partition import triangulate
from pipeline.geometry.raycast import upright_walls
from pipeline.mjcf.bundle import WorldRecord, read_floor
from pipeline.store.codecs import decode
from pipeline.types import FreeSpace, Mesh

_MAX_FACES = 120_000
_CELL_M = 0.3  # first cell for merging vertices; it grows until the page is small enough
_WALL_RGB = (150, 116, 92)
_LOW_RGB, _HIGH_RGB, _BANDS = (40, 70, 150), (235, 205, 90), 12  # of a floor by elevation
_ASIDE, _DOWN = np.radians(-25.0), np.radians(50.0)


def scene_page(bundle: Path, record: WorldRecord, free_space: FreeSpace) -> str:
    """Return an HTML page that draws the workings without roof; it contains three.js and the meshes.

    Without the roof, the drifts are visible from above. The walls are the bundle's rough surface; its vertices are
    merged in cells until it has at most 120,000 faces. Without visible rock they are the outline's, upright. The floor
    of a mine with heights is coloured by elevation.
    """
    scene = trimesh.Scene()
    if record.heights:
        bounds = _add_folded(scene, read_floor(bundle, record), record.height_m)
    else:
        bounds = _add_flat(scene, bundle, record, free_space)
    west, south, low, east, north, high = bounds
    # The lights of the scene point at the origin.
    scene.apply_translation([-(west + east) / 2, -(south + north) / 2, -(low + high) / 2])
    scene.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))  # browsers have y up
    short, long = sorted((east - west, north - south))
    scene.set_camera(angles=(-_DOWN, _ASIDE, 0.0), distance=max(0.75 * long, 1.5 * short), fov=(55, 40))
    return scene_to_html(scene)


def _add_folded(scene: trimesh.Scene, floor: Floor, height_m: float) -> list[float]:
    """Add the floor of a mine with heights, coloured by elevation, and its walls; return the bounds, m."""
    places = floor.vertices[floor.faces] - np.pad(floor.offset_m, [(0, 0), (0, 1)])[floor.sheet][:, None]
    walls = []
    for face, edge in floor.wall_edges():
        foot = floor.vertices[list(edge)] - np.append(floor.offset_m[floor.sheet[face]], 0.0)
        top = foot + np.array([0.0, 0.0, height_m])
        walls += [[foot[0], foot[1], top[1]], [foot[0], top[1], top[0]]]
    corners = np.array(walls).reshape(-1, 3)
    scene.add_geometry(_coloured(corners, np.arange(len(corners)).reshape(-1, 3), _WALL_RGB))
    level = places[:, :, 2].mean(axis=1)
    band = np.minimum(_BANDS - 1, ((level - level.min()) / max(np.ptp(level), 1e-9) * _BANDS).astype(int))
    for k in np.unique(band).tolist():
        rgb = np.round(np.array(_LOW_RGB) + k / (_BANDS - 1) * np.subtract(_HIGH_RGB, _LOW_RGB)).astype(int)
        own = places[band == k].reshape(-1, 3)
        scene.add_geometry(_coloured(own, np.arange(len(own)).reshape(-1, 3), tuple(rgb.tolist())))
    return [*places.min(axis=(0, 1)).tolist(), *places.max(axis=(0, 1)).tolist()]


def _add_flat(scene: trimesh.Scene, bundle: Path, record: WorldRecord, free_space: FreeSpace) -> list[float]:
    """Add the walls and the floor zones of a flat mine; return the bounds, m."""
    if record.has_visible_rock:
        walls = _simplify([decode(path, Mesh) for path in sorted((bundle / "meshes").glob("walls_*.msh"))])
    else:
        triangles = upright_walls(free_space.polygon, record.height_m)
        walls = triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    scene.add_geometry(_coloured(walls[0], walls[1], _WALL_RGB))
    for zone in record.zones:
        part = free_space.polygon.intersection(shapely.box(zone.west_m, zone.south_m, zone.east_m, zone.north_m))
        if part.area > 0:
            points, faces = triangulate(part)
            flat = np.column_stack([points, np.zeros(len(points))])
            scene.add_geometry(_coloured(flat, faces, tuple(round(255 * v) for v in zone.rgba[:3])))
    west, south, east, north = free_space.polygon.bounds
    return [west, south, 0.0, east, north, 0.0]


def _simplify(meshes: list[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.vstack([mesh.vertices for mesh in meshes])
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    whole = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))
    thin, cell_m = whole, _CELL_M
    while len(thin.triangles) > _MAX_FACES or thin is whole:
        thin = whole.simplify_vertex_clustering(cell_m)
        cell_m *= 1.4
    return np.asarray(thin.vertices), np.asarray(thin.triangles)


def _coloured(vertices: np.ndarray, faces: np.ndarray, rgb: tuple[int, ...]) -> trimesh.Trimesh:
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[*rgb, 255], doubleSided=True, roughnessFactor=1.0, metallicFactor=0.0
    )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh
