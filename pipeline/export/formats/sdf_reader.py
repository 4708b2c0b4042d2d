"""SDF read back by Python's XML reader, its meshes by trimesh."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh

from minexplore.bundle import TriangleMesh
from pipeline.errors import ArtifactError
from pipeline.export.formats.sdf import MODEL_NAME, NAMESPACE, WORLD_FILE
from pipeline.export.frames import apply
from pipeline.export.scene import ConvexPart, ReadScene, Surface, WorldFacts, box_corners, placed_part


def read_sdf(folder: Path, facts: WorldFacts) -> ReadScene:
    """Return what a folder's `mine.sdf` holds, in the mine frame that `facts` places in the world."""
    world = _child(ElementTree.parse(folder / WORLD_FILE).getroot(), "world")
    stated = json.loads(_value(world, f"{{{NAMESPACE}}}world"))
    if stated != facts.to_json():
        raise ArtifactError(f"{WORLD_FILE}: the facts of the world differ from {facts.name}'s record")
    model = next(model for model in world.findall("model") if model.get("name") == MODEL_NAME)
    mine_from_model = np.linalg.inv(np.array(facts.T_world_mine)) @ _pose(model)
    link = _child(model, "link")
    parts = [_part(folder, element, mine_from_model) for element in link.findall("collision")]
    surfaces = [_surface(folder, element, mine_from_model) for element in link.findall("visual")]
    return ReadScene(stated, parts, surfaces, len(world.findall("light")))


def _part(folder: Path, element: ElementTree.Element, T: np.ndarray) -> ConvexPart:
    box = element.find("geometry/box/size")
    if box is None:
        mesh = trimesh.load_mesh(folder / _value(element, "geometry/mesh/uri"), process=False)
        corners = np.unique(np.asarray(mesh.vertices, np.float64), axis=0)
    else:
        corners = box_corners(np.array((box.text or "").split(), float) / 2)
    friction = float(_value(element, "surface/friction/ode/mu"))
    vertices = apply(T @ _pose(element), corners)
    return placed_part(element.get("name", ""), *_label(element), friction, vertices, box is not None)


def _surface(folder: Path, element: ElementTree.Element, T: np.ndarray) -> Surface:
    mesh = trimesh.load_mesh(folder / _value(element, "geometry/mesh/uri"), process=False, skip_materials=True)
    vertices = apply(T @ _pose(element), np.asarray(mesh.vertices, np.float64))
    plain = TriangleMesh(vertices, np.asarray(mesh.faces), np.zeros((0, 2)), np.zeros((0, 3)))
    return Surface(element.get("name", ""), *_label(element), "", plain)


def _label(element: ElementTree.Element) -> tuple[str, str]:
    return _value(element, f"{{{NAMESPACE}}}label"), element.findtext(f"{{{NAMESPACE}}}zone", "")


def _pose(element: ElementTree.Element) -> np.ndarray:
    x, y, z, *turns = (float(value) for value in element.findtext("pose", "0 0 0 0 0 0").split())
    T: np.ndarray = trimesh.transformations.euler_matrix(*turns, "sxyz")
    T[:3, 3] = x, y, z
    return T


def _child(element: ElementTree.Element, name: str) -> ElementTree.Element:
    found = element.find(name)
    if found is None:
        raise ArtifactError(f"{WORLD_FILE}: <{element.tag}> has no <{name}>")
    return found


def _value(element: ElementTree.Element, path: str) -> str:
    text = element.findtext(path)
    if not text:
        raise ArtifactError(f"{WORLD_FILE}: {element.get('name')}: no {path}")
    return text
