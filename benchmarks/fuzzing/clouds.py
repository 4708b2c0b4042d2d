"""Valid clouds and meshes for the readers of scans."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fuzzing.builders import Files, saved


def _cave() -> np.ndarray:
    """Return points (300, 3) m on the walls of a drift 4 m high."""
    at = np.arange(300)
    return np.column_stack([2.5 * np.cos(at), at / 100, 2 + 2 * np.sin(at)])


def _drift() -> np.ndarray:
    """Return points (3,000, 3) m on all sides of a drift of 10 m."""
    rng, size = np.random.default_rng(0), np.array([10.0, 4.0, 3.0])
    points = rng.uniform(0, size, (3000, 3))
    side = rng.choice(3, len(points), p=[0.1, 0.38, 0.52])
    points[np.arange(len(points)), side] = rng.integers(0, 2, len(points)) * size[side]
    return points


def _ply(points: np.ndarray) -> Files:
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(points)
    names = ("x", "y", "z", "red", "green", "blue")
    columns = np.column_stack([points, np.abs(points) / 10])
    return {
        "c.ply": head
        + b"".join(b"property float %s\n" % n.encode() for n in names)
        + b"end_header\n"
        + _bytes_of(columns)
    }


def _pcd(points: np.ndarray) -> Files:
    count = len(points)
    head = b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\n"
    head += b"WIDTH %d\nHEIGHT 1\n" % count
    colours = (1000 * np.arange(count)).astype("<u4")[:, None].view("<f4")
    rows = _bytes_of(np.column_stack([points.astype("<f4"), colours]))
    return {"c.pcd": head + b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA binary\n" % count + rows}


def _open3d_pcd(points: np.ndarray, **how: bool) -> Files:
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    return saved("c.pcd", lambda path: open3d.io.write_point_cloud(str(path), cloud, **how))


def _bytes_of(points: np.ndarray) -> bytes:
    return points.astype("<f4").tobytes()


def _xyz(points: np.ndarray) -> Files:
    return {"c.xyz": b"".join(b"%.3f %.3f %.3f 9\n" % tuple(p) for p in points)}


def _csv(points: np.ndarray) -> Files:
    rows = b"".join(b"%d,%.3f,%.3f,%.3f,90,80,%d\n" % (k, *p, k % 256) for k, p in enumerate(points))
    return {"c.csv": b"time,x,y,z,red,green,blue\n" + rows}


def _zip(points: np.ndarray) -> Files:
    def write(path: Path) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for files in (_xyz(points[::2]), _csv(points[1::2])):
                for name, data in files.items():
                    archive.writestr(f"scan/{name}", data)

    return saved("c.zip", write)


def _e57(points: np.ndarray) -> Files:
    import pye57

    def write(path: Path) -> None:
        file = pye57.E57(str(path), mode="w")
        file.write_scan_raw({f"cartesian{axis}": points[:, k].copy() for k, axis in enumerate("XYZ")})
        file.close()

    return saved("c.e57", write)


def ptx_text(rows: np.ndarray) -> str:
    """Return a PTX file of one scan of rows (n, 3 to 7), whose scanner stood at the origin."""
    axes, place = "1 0 0\n0 1 0\n0 0 1", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1"
    lines = "\n".join(" ".join(f"{value:.3f}" for value in row) for row in rows.tolist())
    return f"{len(rows)}\n1\n0 0 0\n{axes}\n{place}\n{lines}\n"


def seen_drift(resolution: float = 0.1) -> Any:
    """Return an octree of OctoMap of a drift of 10 x 4 x 3 m that a scanner saw from its middle line."""
    import pyoctomap

    tree, rng = pyoctomap.OcTree(resolution), np.random.default_rng(0)
    low, high = np.array([0, -2, 0.0]), np.array([10, 2, 3.0])
    for along in np.arange(0.5, 10, 1.0):
        place = np.array([along, 0, 1.5])
        rays = rng.normal(size=(6000, 3))
        reach = np.where(rays > 0, (high - place) / rays, (low - place) / rays).min(axis=1)
        tree.insertPointCloud(place + rays * reach[:, None], place)
    tree.updateInnerOccupancy()
    return tree


def _las(points: np.ndarray, name: str = "c.las") -> Files:
    import laspy

    def write(path: Path) -> None:
        cloud = laspy.LasData(laspy.LasHeader(point_format=2, version="1.2"))
        cloud.x, cloud.y, cloud.z = points.T
        cloud.red = cloud.green = cloud.blue = np.arange(len(points))
        cloud.write(str(path))

    return saved(name, write)


def _mesh(name: str) -> Files:
    import trimesh

    lying = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    drift = trimesh.creation.cylinder(2.0, 30.0, sections=24, transform=lying)
    return saved(name, lambda path: drift.export(path))


CLOUDS: dict[str, Callable[[], Files]] = {
    "xyz": lambda: _xyz(_cave()),
    "ply": lambda: _ply(_cave()),
    "pcd": lambda: _pcd(_cave()),
    "las": lambda: _las(_cave()),
    "stl": lambda: _mesh("c.stl"),
    "obj": lambda: _mesh("c.obj"),
}
SCANS: dict[str, Callable[[], Files]] = {
    "xyz scan": lambda: _xyz(_drift()),
    "ply scan": lambda: _ply(_drift()),
    "pcd scan": lambda: _pcd(_drift()),
    "pcd text scan": lambda: _open3d_pcd(_drift(), write_ascii=True),
    "pcd packed scan": lambda: _open3d_pcd(_drift(), compressed=True),
    "las scan": lambda: _las(_drift()),
    "laz scan": lambda: _las(_drift(), "c.laz"),
    "csv scan": lambda: _csv(_drift()),
    "zip scan": lambda: _zip(_drift()),
    "e57 scan": lambda: _e57(_drift()),
    "ptx scan": lambda: {"c.ptx": ptx_text(_drift()).encode()},
    "octree": lambda: saved("c.bt", lambda path: seen_drift(0.2).writeBinary(str(path))),
    "full octree": lambda: saved("c.ot", lambda path: seen_drift(0.2).write(str(path))),
}
