"""Valid solids of workings for the readers of triangle meshes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from benchmarks.fuzzing.builders import Files, saved

_KINDS = ("obj", "stl", "ply", "glb", "dtm", "xml", "dae", "usd", "omf")


def _drift(name: str, entity: str = "") -> Files:
    """Return a drift with a room; entities are those of a drawing."""
    import trimesh

    from benchmarks.scans.solid_files import write

    room = trimesh.creation.box(
        extents=[8.0, 12.0, 3.0], transform=trimesh.transformations.translation_matrix([9, 0, 0])
    )
    both = trimesh.util.concatenate([trimesh.creation.box(extents=[30.0, 4.0, 3.0]), room])
    return saved(name, lambda path: write(path, both.vertices, both.faces, entity))


SOLIDS: dict[str, Callable[[], Files]] = {
    **{f"{kind} solid": partial(_drift, f"m.{kind}") for kind in _KINDS},
    "dxf faces": partial(_drift, "m.dxf", "3DFACE"),
    "dxf polyface": partial(_drift, "m.dxf", "POLYFACE"),
    "dxf mesh": partial(_drift, "m.dxf", "MESH"),
}
