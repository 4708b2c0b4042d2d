"""USD read back by `usd-core`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import TriangleMesh
from pipeline.errors import ArtifactError
from pipeline.export.formats.usd import FACTS, TAXONOMY, ZONES
from pipeline.export.frames import apply
from pipeline.export.scene import ConvexPart, ReadScene, Surface, WorldFacts, box_corners, placed_part


def read_usd(folder: Path, facts: WorldFacts) -> ReadScene:
    """Return what a folder's `.usdc` holds, in the mine frame that `facts` places in the world."""
    from pxr import Usd, UsdGeom, UsdLux, UsdPhysics

    path = folder / f"{facts.name}.usdc"
    stage = Usd.Stage.Open(str(path))
    stated = json.loads(stage.GetRootLayer().customLayerData.get(FACTS, "{}"))
    if stated != facts.to_json():
        raise ArtifactError(f"{path.name}: the facts of the world differ from {facts.name}'s record")
    if UsdGeom.GetStageUpAxis(stage) != "Z" or UsdGeom.GetStageMetersPerUnit(stage) != 1.0:
        raise ArtifactError(f"{path.name}: z is not up, or lengths are not metres")
    mine_from_world = np.linalg.inv(np.array(facts.T_world_mine))
    places = UsdGeom.XformCache()
    parts: list[ConvexPart] = []
    surfaces: list[Surface] = []
    lights = 0
    for prim in stage.Traverse():
        lights += prim.IsA(UsdLux.SphereLight)
        if not prim.IsA(UsdGeom.Gprim):
            continue
        T = mine_from_world @ np.array(places.GetLocalToWorldTransform(prim)).T
        what, zone = _label(prim, TAXONOMY), _label(prim, ZONES)
        if prim.HasAPI(UsdPhysics.CollisionAPI):
            is_box = prim.IsA(UsdGeom.Cube)
            corners = box_corners(np.full(3, UsdGeom.Cube(prim).GetSizeAttr().Get() / 2)) if is_box else _points(prim)
            parts.append(placed_part(prim.GetName(), what, zone, _friction(prim), apply(T, corners), is_box))
        else:
            indices = UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get()
            faces = np.array(indices).reshape(-1, 3)
            mesh = TriangleMesh(apply(T, _points(prim)), faces, np.zeros((0, 2)), np.zeros((0, 3)))
            surfaces.append(Surface(prim.GetName(), what, zone, "", mesh))
    return ReadScene(stated, parts, surfaces, lights)


def _points(prim: Any) -> np.ndarray:
    from pxr import UsdGeom

    return np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), np.float64)


def _label(prim: Any, taxonomy: str) -> str:
    from pxr import UsdSemantics

    if not prim.HasAPI(UsdSemantics.LabelsAPI, taxonomy):
        return ""
    return str(UsdSemantics.LabelsAPI(prim, taxonomy).GetLabelsAttr().Get()[0])


def _friction(prim: Any) -> float:
    from pxr import UsdPhysics, UsdShade

    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
    return float(UsdPhysics.MaterialAPI(material.GetPrim()).GetDynamicFrictionAttr().Get())
