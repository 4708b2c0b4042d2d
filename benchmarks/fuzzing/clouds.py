"""Valid clouds and meshes for the readers of scans."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.fuzzing.saved import Files, saved


def _cave() -> np.ndarray:
    """Return points (300, 3) m on the walls of a drift 4 m high."""
    at = np.arange(300)
    return np.column_stack([2.5 * np.cos(at), at / 100, 2 + 2 * np.sin(at)])


def _ply() -> Files:
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 300\n"
    return {"c.ply": head + b"".join(b"property float %c\n" % c for c in b"xyz") + b"end_header\n" + _bytes_of(_cave())}


def _pcd() -> Files:
    head = b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 300\nHEIGHT 1\n"
    return {"c.pcd": head + b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 300\nDATA binary\n" + _bytes_of(_cave())}


def _bytes_of(points: np.ndarray) -> bytes:
    return points.astype("<f4").tobytes()


def _las() -> Files:
    import laspy

    def write(path: Path) -> None:
        cloud = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
        cloud.x, cloud.y, cloud.z = _cave().T
        cloud.write(str(path))

    return saved("c.las", write)


def _mesh(name: str) -> Files:
    import trimesh

    lying = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    drift = trimesh.creation.cylinder(2.0, 30.0, sections=24, transform=lying)
    return saved(name, lambda path: drift.export(path))


CLOUDS: dict[str, Callable[[], Files]] = {
    "xyz": lambda: {"c.xyz": b"".join(b"%.3f %.3f %.3f 9\n" % tuple(p) for p in _cave())},
    "ply": _ply,
    "pcd": _pcd,
    "las": _las,
    "stl": lambda: _mesh("c.stl"),
    "obj": lambda: _mesh("c.obj"),
}
