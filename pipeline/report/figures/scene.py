"""The meshes of a world as a 3D scene for a browser: rock and floor, from above or with a headlamp."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path

import fast_simplification
import numpy as np
import shapely
import trimesh
from trimesh.viewer.notebook import scene_to_html

from minexplore.bundle import MESHES, ROOF, WALLS
from pipeline.errors import ArtifactError
from pipeline.geometry.polyline import resample
from pipeline.geometry.raycast import upright_walls
from pipeline.geometry.rock.partition import triangulate
from pipeline.mjcf.bundle import WorldRecord
from pipeline.store.codecs import decode
from pipeline.types import DriftNetwork, FreeSpace, Mesh

MOST_FACES = {WALLS: 140_000, ROOF: 80_000}  # 10 bytes of the page each
_ROCK_RGB = (150, 139, 127)
_LOW_RGB, _HIGH_RGB, _BANDS = (40, 70, 150), (235, 205, 90), 12  # of a floor by elevation
_ASIDE, _DOWN = np.radians(-25.0), np.radians(50.0)
_FIELD_DEG, _MARGIN = (70.0, 40.0), 1.05  # the page's frame is twice as wide as high
_EYE_M = 1.3  # of the headlamp above the floor
_STEPS_PER_M = 128  # of places in the page: equal bits pack well, and 4 mm are not seen
_MESHES = re.compile(r'base64_data="([A-Za-z0-9+/=]*)"')
_LOAD = 'loader.load("data:text/plain;base64,"+base64_data,function(gltf){'
_LOADED = "animate();onWindowResize();});}"
_UNPACK = """<script>
async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
</script>"""
_CONTROLS = """<style>
#ways { position: absolute; left: 8px; top: 8px; font: 13px sans-serif; color: #888; }
</style>
<div id="ways">
<button id="above">From above</button> <button id="headlamp">Headlamp</button>
<button id="known" title="how the survey knows walls, roof and floor" hidden>Known how</button>
<button id="deviation" title="red: 10 cm in the rock, blue: in the free space, grey: none, yellow: not seen" hidden>
</button> <span id="how"></span> <span id="legend" hidden><b style="color:#2f5d8a">measured</b>,
<b style="color:#c98a12">interpolated</b>, <b style="color:#c0392b">assumed</b></span>
</div>
<script>
"""


def scene_page(bundle: Path, record: WorldRecord, free_space: FreeSpace, network: DriftNetwork) -> str:
    """Return an HTML page that draws the workings; it contains three.js and the meshes, and needs no network.

    It has two ways to look: from above, without the roof, and along the main drift with a headlamp that moves with the
    camera.
    """
    _, drift = resample(np.array(network.main_drift_m), 1.0)
    west, south, east, north = free_space.polygon.bounds
    x, y = (drift - [(west + east) / 2, (south + north) / 2]).T
    return walked_page(mine_scene(bundle, record, free_space), np.column_stack([x, y, np.zeros(len(x))]))


def walked_page(scene: trimesh.Scene, drift_m: np.ndarray) -> str:
    """Return the page of a scene; the headlamp goes along places (n, 3) m on a floor, about the scene's middle."""
    for mesh in scene.geometry.values():
        mesh.vertices = np.round(mesh.vertices * _STEPS_PER_M) / _STEPS_PER_M
    page = _packed(scene_to_html(scene))
    x, y, z = drift_m.T
    places = np.column_stack([x, z + _EYE_M, -y]).round(2).tolist()
    script = (Path(__file__).parent / "headlamp.js").read_text().replace("$DRIFT", json.dumps(places))
    before, end, after = page.rpartition("</body>")
    if not end:
        raise ArtifactError("the page of trimesh's viewer has no </body>; its template has changed")
    return f"{before}{_CONTROLS}{script}</script>{end}{after}"


def _packed(page: str) -> str:
    """Return a page of trimesh's viewer with its meshes compressed, which the browser unpacks."""
    meshes = _MESHES.search(page)
    if meshes is None or page.count(_LOAD) != 1 or page.count(_LOADED) != 1:
        raise ArtifactError("the page of trimesh's viewer does not load its meshes as before; its template has changed")
    text = base64.b64encode(gzip.compress(base64.b64decode(meshes[1]), 9, mtime=0)).decode()
    before, after = page[: meshes.start()], page[meshes.end() :]
    after = after.replace(_LOAD, 'unpacked(base64_data).then(meshes=>loader.parse(meshes,"",function(gltf){')
    after = after.replace(_LOADED, "animate();onWindowResize();}));}")
    return f'{before.replace("<body>", f"<body>{_UNPACK}", 1)}base64_data="{text}"{after}'


def mine_scene(bundle: Path, record: WorldRecord, free_space: FreeSpace) -> trimesh.Scene:
    """Return walls, roof and floor, with y up and the middle of the mine at the origin, where the lights point.

    Walls and roof are the bundle's rough surface, simplified by quadric edge collapse to at most `MOST_FACES`. Without
    visible rock the walls are the outline's, upright, and the roof is level.
    """
    scene = trimesh.Scene()
    look_at(scene, *_add_flat(scene, bundle, record, free_space))
    return scene


def look_at(
    scene: trimesh.Scene, west: float, south: float, low: float, east: float, north: float, high: float
) -> None:
    """Move a scene's middle to the origin, turn its heights along y, and look at it from above."""
    scene.apply_translation([-(west + east) / 2, -(south + north) / 2, -(low + high) / 2])
    scene.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))  # browsers have y up
    turned = trimesh.transformations.euler_matrix(-_DOWN, _ASIDE, 0.0)
    corners = trimesh.bounds.corners(scene.bounds)  # the browser's camera turns about the origin
    seen = trimesh.scene.cameras.look_at(corners, _FIELD_DEG, turned, center=np.zeros(3), pad=_MARGIN)
    scene.camera.fov = _FIELD_DEG
    scene.camera_transform = seen


def add_bands(scene: trimesh.Scene, places: np.ndarray, names: np.ndarray) -> None:
    """Add the triangles (n, 3, 3) m of floors, coloured by elevation; those of other names (n,) are other meshes."""
    level = places[:, :, 2].mean(axis=1)
    band = np.minimum(_BANDS - 1, ((level - level.min()) / max(np.ptp(level), 1e-9) * _BANDS).astype(int))
    for k in np.unique(band).tolist():
        rgb = np.round(np.array(_LOW_RGB) + k / (_BANDS - 1) * np.subtract(_HIGH_RGB, _LOW_RGB)).astype(int)
        for name in np.unique(names[band == k]).tolist():
            own = places[(band == k) & (names == name)].reshape(-1, 3)
            mesh = coloured(own, np.arange(len(own)).reshape(-1, 3), tuple(rgb.tolist()))
            scene.add_geometry(mesh, node_name=f"band{k}_{name}", geom_name=f"band{k}_{name}")


def _add_flat(scene: trimesh.Scene, bundle: Path, record: WorldRecord, free_space: FreeSpace) -> list[float]:
    """Add rock and floor zones of a flat mine; return the bounds, m."""
    for name, (vertices, faces) in _rock(bundle, record, free_space).items():
        scene.add_geometry(coloured(vertices, faces, _ROCK_RGB), node_name=name, geom_name=name)
    for zone in record.zones:
        part = free_space.polygon.intersection(shapely.box(zone.west_m, zone.south_m, zone.east_m, zone.north_m))
        if part.area > 0:
            rgb = tuple(round(255 * v) for v in zone.rgba[:3])
            scene.add_geometry(coloured(*_level(part, 0.0), rgb), node_name=zone.geom, geom_name=zone.geom)
    west, south, east, north = free_space.polygon.bounds
    return [west, south, 0.0, east, north, 0.0]


def _rock(bundle: Path, record: WorldRecord, free_space: FreeSpace) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return vertices (n, 3) m and faces (m, 3) of walls and roof by name."""
    if not record.has_visible_rock:
        walls = upright_walls(free_space.polygon, record.height_m).reshape(-1, 3)
        return {
            WALLS: (walls, np.arange(len(walls)).reshape(-1, 3)),
            ROOF: _level(free_space.polygon, record.height_m),
        }
    return {
        piece: _simplified([decode(path, Mesh) for path in sorted((bundle / MESHES).glob(f"{piece}_*.msh"))], most)
        for piece, most in MOST_FACES.items()
    }


def _simplified(meshes: list[Mesh], most: int) -> tuple[np.ndarray, np.ndarray]:
    """Join meshes at equal vertices, and simplify what has more faces than `most`."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    places = np.concatenate([mesh.vertices for mesh in meshes]).round(4)
    vertices, index = np.unique(places, axis=0, return_inverse=True)
    numbers = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    faces = index.ravel()[numbers].astype(np.int32)
    points = vertices.astype(np.float32)
    for keep_border in (True, False):  # borders of the walls meet the roof; those of a very large mine are too many
        if len(faces) > most:
            points, faces = fast_simplification.simplify(points, faces, target_count=most, preserve_border=keep_border)
    return points, faces


def _level(part: shapely.Polygon, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    points, faces = triangulate(part)
    return np.column_stack([points, np.full(len(points), height_m)]), faces


def coloured(vertices: np.ndarray, faces: np.ndarray, rgb: tuple[int, ...]) -> trimesh.Trimesh:
    """Return a mesh of one colour that is seen from both sides."""
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[*rgb, 255], doubleSided=True, roughnessFactor=1.0, metallicFactor=0.0
    )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh
