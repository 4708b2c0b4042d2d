"""Write triangles as planning programs do: every mesh format that is read."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import ezdxf.filemanagement
import numpy as np
import trimesh
from ezdxf.render.mesh import MeshBuilder


def write_surpac(path: Path, vertices: np.ndarray, faces: np.ndarray, parted: tuple[int, ...] = ()) -> None:
    """Write a triangulation and its strings, which end before the corners in `parted`, numbered by record if so."""
    rows, number = [], np.arange(1, len(vertices) + 1)
    for k, (x, y, z) in enumerate(vertices.tolist()):
        if k in parted:
            rows.append("0, 0.000, 0.000, 0.000,")
            number[k:] += 1
        rows.append(f"32000, {y:.6f}, {x:.6f}, {z:.6f},")
    strings = ["mine, 01-Jan-26,,", "0, 0, 0, 0, 0, 0, 0", *rows, "0, 0, 0, 0, END"]
    path.with_suffix(".str").write_text("\n".join(strings) + "\n")
    triangles = [f"{k}, {a}, {b}, {c}, 0, 0, 0," for k, (a, b, c) in enumerate(number[faces].tolist(), start=1)]
    head = [
        f"{path.stem}.str,",
        "0, 0.000, 0.000, 0.000, END",
        "OBJECT, 1,",
        "TRISOLATION, 1, neighbours=no,closed=yes",
    ]
    path.write_text("\n".join([*head, *triangles, "END"]) + "\n")


def write_landxml(
    path: Path,
    vertices: np.ndarray,
    faces: np.ndarray,
    units: str = '<Metric linearUnit="meter"/>',
    marks: str = "",
) -> None:
    """Write a surface whose points are northing, easting and elevation; `marks` are further faces."""
    points = "".join(f'<P id="{k + 7}">{n!r} {e!r} {z!r}</P>' for k, (e, n, z) in enumerate(vertices.tolist()))
    shown = "".join(f"<F>{a + 7} {b + 7} {c + 7}</F>" for a, b, c in faces.tolist())
    path.write_text(
        '<?xml version="1.0"?><LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2">'
        f'<Units>{units}</Units><Surfaces><Surface name="drift"><Definition surfType="TIN"><Pnts>{points}</Pnts>'
        f"<Faces>{shown}{marks}</Faces></Definition></Surface></Surfaces></LandXML>"
    )


def write_collada(
    path: Path,
    vertices: np.ndarray,
    faces: Iterable[Any],
    metres: float = 1.0,
    up: str = "Z_UP",
    moves: Iterable[Callable[[Any], Any]] = (),
) -> None:
    """Write polygons by pycollada, whose numbers have 32 bits; `moves` make transformations of its module `scene`."""
    import collada  # for the samples of one format

    document = collada.Collada()
    document.assetInfo.unitmeter, document.assetInfo.unitname, document.assetInfo.upaxis = metres, "unit", up
    source = collada.source.FloatSource("places", vertices.ravel(), ("X", "Y", "Z"))
    geometry = collada.geometry.Geometry(document, "drift", "drift", [source])
    inputs = collada.source.InputList()
    inputs.addInput(0, "VERTEX", "#places")
    polygons = [np.asarray(face, np.int32) for face in faces]
    sizes, corners = np.array([len(face) for face in polygons], np.int32), np.concatenate(polygons)
    geometry.primitives.append(
        geometry.createTriangleSet(corners, inputs, "rock")
        if (sizes == 3).all()
        else geometry.createPolylist(corners, sizes, inputs, "rock")
    )
    document.geometries.append(geometry)
    placed = [move(collada.scene) for move in moves]
    node = collada.scene.Node("drift", [collada.scene.GeometryNode(geometry, [])], placed)
    document.scenes.append(collada.scene.Scene("scene", [node]))
    document.scene = document.scenes[0]
    document.write(str(path))


def write_usd(
    path: Path, vertices: np.ndarray, faces: np.ndarray, metres: float | None = 1.0, up: str | None = "Z"
) -> None:
    """Write a mesh by usd-core, with an instance of it moved up by 20 units and mirrored, and one that is not shown."""
    from pxr import Gf, Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateNew(str(path))
    if metres:
        UsdGeom.SetStageMetersPerUnit(stage, metres)
    if up:
        UsdGeom.SetStageUpAxis(stage, up)
    mesh = UsdGeom.Mesh.Define(stage, "/Rock/drift")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(vertices.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([int(corner) for face in faces for corner in face])
    above = UsdGeom.Xform.Define(stage, "/Above")
    above.AddTranslateOp().Set(Gf.Vec3d(0, 0, 20))
    above.AddScaleOp().Set(Gf.Vec3f(1, 1, -1))
    above.GetPrim().GetReferences().AddInternalReference("/Rock")
    above.GetPrim().SetInstanceable(True)
    UsdGeom.Mesh.Define(stage, "/Hidden").CreateVisibilityAttr("invisible")
    stage.GetRootLayer().Save()


def write_omf(
    path: Path,
    vertices: np.ndarray,
    faces: np.ndarray,
    unit: str = "m",
    origins: tuple[list[float], list[float]] = ([0.0] * 3, [0.0] * 3),
) -> None:
    """Write a surface and a set of points by omf, from the origins of the project and of the surface."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # omf 1.0.1 is of 2019, before numpy 2
        import omf

        project = omf.Project(name="mine", units=unit, origin=origins[0])
        surface = omf.SurfaceGeometry(vertices=vertices, triangles=faces, origin=origins[1])
        points = omf.PointSetGeometry(vertices=vertices)
        project.elements = [
            omf.SurfaceElement(name="drift", geometry=surface),
            omf.PointSetElement(name="holes", geometry=points),
        ]
        omf.OMFWriter(project, str(path))


_WRITERS: dict[str, Callable[[Path, np.ndarray, np.ndarray], None]] = {
    ".dtm": write_surpac,
    ".xml": write_landxml,
    ".dae": write_collada,
    ".usd": write_usd,
    ".omf": write_omf,
}


def write(path: Path, vertices: np.ndarray, faces: np.ndarray, entity: str = "MESH") -> None:
    """Write triangles in the format of the suffix: GLB with y up, DXF in metres as entities of one kind."""
    if path.suffix in _WRITERS:
        _WRITERS[path.suffix](path, vertices, faces)
        return
    if path.suffix != ".dxf":
        up = vertices[:, [0, 2, 1]] * [1, 1, -1] if path.suffix == ".glb" else vertices
        trimesh.Trimesh(up, faces, process=False).export(path)
        return
    drawing = ezdxf.filemanagement.new(units=6)
    space, builder = drawing.modelspace(), MeshBuilder()
    builder.vertices, builder.faces = [tuple(v) for v in vertices.tolist()], faces.tolist()
    if entity == "3DFACE":
        builder.render_3dfaces(space, dxfattribs={"layer": "STOPE"})
    elif entity == "POLYFACE":
        builder.render_polyface(space, dxfattribs={"layer": "STOPE"})
    else:
        builder.render_mesh(space, dxfattribs={"layer": "STOPE"})
    drawing.saveas(path)
