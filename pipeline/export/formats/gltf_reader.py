"""glTF read back by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from minexplore.bundle import TriangleMesh
from pipeline.errors import ArtifactError
from pipeline.export.frames import Z_UP_TO_Y_UP, apply
from pipeline.export.scene import ConvexPart, ReadScene, Surface, WorldFacts, placed_part


def read_gltf(folder: Path, facts: WorldFacts) -> ReadScene:
    """Return what the files of a folder hold, in the mine frame that `facts` places in the world."""
    mine_from_file = np.linalg.inv(Z_UP_TO_Y_UP @ np.array(facts.T_world_mine))
    parts: list[ConvexPart] = []
    surfaces: list[Surface] = []
    lights = 0
    for path in sorted(folder.glob("*.glb")):
        scene = trimesh.load_scene(path, process=False)
        stated = dict(scene.metadata)
        extensions = stated.pop("gltf_extensions", {})
        lights += len(extensions.get("KHR_lights_punctual", {}).get("lights", []))
        if {key: stated.get(key) for key in facts.to_json()} != facts.to_json():
            raise ArtifactError(f"{path.name}: the facts of the world differ from {facts.name}'s record")
        for node in scene.graph.nodes_geometry:
            matrix, geometry = scene.graph.get(node)
            mesh, extras = scene.geometry[geometry], _extras(scene, node)
            vertices = apply(mine_from_file @ matrix, np.asarray(mesh.vertices, np.float64))
            what, zone = extras["label"], extras.get("zone", "")
            if extras.get("collides"):
                is_box = geometry == "box"
                parts.append(placed_part(node, what, zone, extras["friction"], vertices, is_box))
            else:
                surfaces.append(Surface(node, what, zone, "", _plain(vertices, mesh.faces)))
    return ReadScene(facts.to_json(), parts, surfaces, lights)


def _extras(scene: trimesh.Scene, node: str) -> dict:
    return scene.graph.transforms.edge_data[(scene.graph.transforms.parents[node], node)].get("metadata", {})


def _plain(vertices: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    return TriangleMesh(vertices, np.asarray(faces), np.zeros((0, 2)), np.zeros((0, 3)))
