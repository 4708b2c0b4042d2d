"""Valid solids of workings for the readers of triangle meshes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from benchmarks.fuzzing.builders import Files, saved


def _drift(name: str) -> Files:
    import trimesh

    drift = trimesh.creation.box(extents=[30.0, 4.0, 3.0])
    room = trimesh.creation.box(
        extents=[8.0, 12.0, 3.0], transform=trimesh.transformations.translation_matrix([9, 0, 0])
    )
    both = trimesh.util.concatenate([drift, room])
    return saved(name, lambda path: both.export(path))


def _faces(entity: str) -> Files:
    """Return a drawing of a drift's six sides as 3DFACE, POLYFACE or MESH."""
    import ezdxf.filemanagement
    from ezdxf.math import Vec3
    from ezdxf.render.mesh import MeshBuilder

    corners = [(x, y, z) for x in (0.0, 30.0) for y in (0.0, 4.0) for z in (0.0, 3.0)]
    drift = MeshBuilder()
    drift.vertices.extend(Vec3.list(corners))
    drift.faces.extend([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])

    def write(path: Path) -> None:
        drawing = ezdxf.filemanagement.new()
        getattr(drift, f"render_{entity}")(drawing.modelspace())
        drawing.saveas(path)

    return saved("m.dxf", write)


def _surpac() -> Files:
    import trimesh

    drift = trimesh.creation.box(extents=[30.0, 4.0, 3.0])
    points = [f"1, {y:.3f}, {x:.3f}, {z:.3f}," for x, y, z in drift.vertices.tolist()]
    triangles = [f"{k}, {a}, {b}, {c}, 0, 0, 0," for k, (a, b, c) in enumerate((drift.faces + 1).tolist(), start=1)]
    strings = ["drift, 01-Jan-26,,", "0, 0, 0, 0, 0, 0, 0", *points, "0, 0, 0, 0, END", ""]
    head = ["m.str,", "0, 0, 0, 0, END", "OBJECT, 1,", "TRISOLATION, 1, neighbours=no,closed=yes"]
    return {"m.dtm": "\n".join([*head, *triangles, "END", ""]).encode(), "m.str": "\n".join(strings).encode()}


SOLIDS: dict[str, Callable[[], Files]] = {
    "obj solid": lambda: _drift("m.obj"),
    "stl solid": lambda: _drift("m.stl"),
    "ply solid": lambda: _drift("m.ply"),
    "glb solid": lambda: _drift("m.glb"),
    "dxf faces": lambda: _faces("3dfaces"),
    "dxf polyface": lambda: _faces("polyface"),
    "dxf mesh": lambda: _faces("mesh"),
    "dtm solid": _surpac,
}
