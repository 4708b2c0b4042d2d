"""USD as binary `.usdc` by `usd-core`: a prim a chunk, colliders as convex hulls, friction, labels and lights.

Lengths are metres and z is up. Colliders have the purpose `guide`, so that renderers pass over them.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from minexplore.bundle import ROCK_TEXTURE, TriangleMesh
from pipeline.export.frames import turn_quaternion, upwards
from pipeline.export.scene import ConvexPart, ExportScene, Files, Light, Material, Surface, hull_of

WORLD, MINE = "/World", "/World/mine"
SEEN, TOUCHED = f"{MINE}/seen", f"{MINE}/touched"
FACTS, TAXONOMY, ZONES = "minexplore_world", "class", "zone"
_MATERIALS, _LIGHTS = f"{WORLD}/materials", f"{MINE}/lights"
_GRAVITY = 9.81
_LAMP_M, _INTENSITY = 0.1, 30_000.0  # radius of a lamp, and its light; by eye


def write_usd(scene: ExportScene) -> Files:
    """Return `NAME.usdc` and its texture."""
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateInMemory()
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, WORLD).GetPrim())
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    layer = stage.GetRootLayer()
    layer.customLayerData = {FACTS: json.dumps(scene.facts.to_json())}
    layer.documentation = f"World {scene.facts.world_sha256}; licence: {scene.facts.licence}"
    physics = UsdPhysics.Scene.Define(stage, f"{WORLD}/physics")
    physics.CreateGravityDirectionAttr((0, 0, -1))
    physics.CreateGravityMagnitudeAttr(_GRAVITY)
    _place(UsdGeom.Xform.Define(stage, MINE), np.array(scene.facts.T_world_mine))
    for path in (SEEN, TOUCHED, _LIGHTS, _MATERIALS):
        UsdGeom.Scope.Define(stage, path)
    used = {surface.material for surface in scene.surfaces}
    paints = {name: _add_material(stage, scene.materials[name]) for name in sorted(used)}
    for surface in scene.surfaces:
        _add_surface(stage, surface, paints[surface.material])
    frictions: dict[str, Any] = {}
    for part in scene.parts:
        _add_part(stage, part, frictions)
    for light in scene.lights:
        _add_light(stage, light)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "world.usdc"
        layer.Export(str(file))
        files = {f"{scene.facts.name}.usdc": file.read_bytes()}
    return files if scene.texture is None else {**files, ROCK_TEXTURE: scene.texture}


def _place(xform: Any, T: np.ndarray) -> None:
    from pxr import Gf

    xform.AddTransformOp().Set(Gf.Matrix4d(T.T.tolist()))  # USD multiplies rows


def _add_surface(stage: Any, surface: Surface, material: Any) -> None:
    from pxr import UsdGeom, UsdShade

    seen = _welded(surface.mesh)
    mesh, count = _mesh(stage, f"{SEEN}/{surface.name}", seen.vertices, seen.faces), len(seen.vertices)
    if len(seen.normals) == count:
        mesh.CreateNormalsAttr(_vectors(seen.normals))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    else:
        _add_flat_normals(mesh, seen.vertices, seen.faces)
    if len(seen.texcoords) == count:
        from pxr import Sdf, Vt

        st, index = np.unique(upwards(seen.texcoords).astype(np.float32), axis=0, return_inverse=True)
        kind = Sdf.ValueTypeNames.TexCoord2fArray
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.vertex)
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(st)))
        primvar.SetIndices(Vt.IntArray.FromNumpy(index.ravel().astype(np.int32)))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    _add_labels(mesh.GetPrim(), surface)


def _welded(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh whose vertices that agree in place, normal and texture are one."""
    count = len(mesh.vertices)
    own = [values for values in (mesh.vertices, mesh.normals, mesh.texcoords) if len(values) == count]
    _, first, number = np.unique(np.column_stack(own), axis=0, return_index=True, return_inverse=True)
    if len(first) == count:
        return mesh
    texcoords, normals = (
        values[first] if len(values) == count else values for values in (mesh.texcoords, mesh.normals)
    )
    return TriangleMesh(mesh.vertices[first], number.ravel()[mesh.faces], texcoords, normals)


def _add_flat_normals(mesh: Any, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Give each corner of a triangle the triangle's own normal."""
    from pxr import UsdGeom

    corners = np.asarray(vertices, np.float64)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0, normals / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
    mesh.CreateNormalsAttr(_vectors(np.repeat(normals, 3, axis=0)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)


def _add_part(stage: Any, part: ConvexPart, frictions: dict[str, Any]) -> None:
    from pxr import Gf, UsdGeom, UsdPhysics, UsdShade

    path = f"{TOUCHED}/{part.name}"
    if part.is_box:
        shape = UsdGeom.Cube.Define(stage, path)
        shape.CreateSizeAttr(2.0)
        shape.CreateExtentAttr([(-1, -1, -1), (1, 1, 1)])
    else:
        vertices, faces = hull_of(part)
        shape = _mesh(stage, path, vertices, faces)
        _add_flat_normals(shape, vertices, faces)
    shape.AddTranslateOp().Set(Gf.Vec3d(*part.centre_m.tolist()))
    if part.is_box:
        shape.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*part.half_m.tolist()))
    prim = shape.GetPrim()
    shape.CreatePurposeAttr(UsdGeom.Tokens.guide)
    UsdPhysics.CollisionAPI.Apply(prim)
    if not part.is_box:
        UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    key = "_".join(filter(None, ("friction", part.label, part.zone)))
    if key not in frictions:
        frictions[key] = _add_friction(stage, key, part.friction or 0.0)
    strength, purpose = UsdShade.Tokens.weakerThanDescendants, "physics"
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(frictions[key], strength, purpose)
    _add_labels(prim, part)


def _add_friction(stage: Any, name: str, friction: float) -> Any:
    from pxr import UsdPhysics, UsdShade

    material = UsdShade.Material.Define(stage, f"{_MATERIALS}/{name}")
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(friction)
    physics.CreateDynamicFrictionAttr(friction)
    physics.CreateRestitutionAttr(0.0)
    return material


def _mesh(stage: Any, path: str, vertices: np.ndarray, faces: np.ndarray) -> Any:
    from pxr import UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(_vectors(vertices))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(faces.ravel(), np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(_vectors(np.stack([vertices.min(axis=0), vertices.max(axis=0)])))
    return mesh


def _vectors(values: np.ndarray) -> Any:
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def _add_labels(prim: Any, item: ConvexPart | Surface) -> None:
    from pxr import UsdSemantics

    for taxonomy, label in ((TAXONOMY, item.label), (ZONES, item.zone)):
        if label:
            UsdSemantics.LabelsAPI.Apply(prim, taxonomy).CreateLabelsAttr([label])


def _add_light(stage: Any, light: Light) -> None:
    from pxr import Gf, UsdLux

    lamp = UsdLux.SphereLight.Define(stage, f"{_LIGHTS}/{light.name}")
    lamp.AddTranslateOp().Set(Gf.Vec3d(*light.place_m.tolist()))
    w, x, y, z = turn_quaternion(np.array([0.0, 0.0, -1.0]), light.direction).tolist()
    lamp.AddOrientOp().Set(Gf.Quatf(w, x, y, z))
    lamp.CreateRadiusAttr(_LAMP_M)
    lamp.CreateIntensityAttr(_INTENSITY)
    lamp.CreateColorAttr(Gf.Vec3f(*light.rgb))
    UsdLux.ShapingAPI.Apply(lamp.GetPrim()).CreateShapingConeAngleAttr(light.cutoff_deg)


def _add_material(stage: Any, material: Material) -> Any:
    from pxr import Sdf, UsdShade

    path = f"{_MATERIALS}/{material.name}"
    made = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0 - material.shininess)
    surface.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(material.rgba[3])
    colour = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if material.textured:
        colour.ConnectToSource(_texture(stage, path, material).ConnectableAPI(), "rgb")
    else:
        colour.Set(material.rgba[:3])
    made.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return made


def _texture(stage: Any, path: str, material: Material) -> Any:
    from pxr import Gf, Sdf, UsdShade

    types = Sdf.ValueTypeNames
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", types.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", types.Asset).Set(f"./{ROCK_TEXTURE}")
    texture.CreateInput("st", types.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    texture.CreateInput("wrapS", types.Token).Set("repeat")
    texture.CreateInput("wrapT", types.Token).Set("repeat")
    texture.CreateInput("scale", types.Float4).Set(Gf.Vec4f(*material.rgba))
    texture.CreateOutput("rgb", types.Float3)
    return texture
