"""Write triangles as planning programs do: every mesh format that is read."""

from __future__ import annotations

from pathlib import Path

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


def write(path: Path, vertices: np.ndarray, faces: np.ndarray, entity: str = "MESH") -> None:
    """Write triangles in the format of the suffix: GLB with y up, DXF in metres as entities of one kind."""
    if path.suffix == ".dtm":
        write_surpac(path, vertices, faces)
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
