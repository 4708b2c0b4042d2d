"""Edits of a bundle that faults are made of: of its model, its record, its meshes and its pictures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import mujoco
import numpy as np
import shapely

from minexplore.bundle import FREE_SPACE, MODEL, RECORD, UNSEALED, decode_msh, is_rock, world_sha256
from pipeline.errors import MineError
from pipeline.store.codecs import decode, encode
from pipeline.store.hashing import sha256_bytes
from pipeline.types import FreeSpace


def edit_model(change: Callable[[mujoco.MjSpec], object]) -> Callable[[Path], None]:
    """Return a fault that changes the MJCF."""

    def inject(bundle: Path) -> None:
        spec = mujoco.MjSpec.from_file(str(bundle / MODEL))
        change(spec)
        spec.compiler.savecompiled = False  # keeps all digits
        (bundle / MODEL).write_text(spec.to_xml())

    return inject


def edit_record(change: Callable[[dict], None]) -> Callable[[Path], None]:
    """Return a fault that changes `world.json`."""

    def inject(bundle: Path) -> None:
        record = json.loads((bundle / RECORD).read_text())
        change(record)
        (bundle / RECORD).write_text(json.dumps(record))

    return inject


def move_vertices(prefix: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a fault that moves the vertices of the rough surface's meshes with this prefix."""

    def inject(bundle: Path) -> None:
        for path in sorted((bundle / "meshes").glob(f"{prefix}*.msh")):
            data = path.read_bytes()
            vertices = decode_msh(data).vertices
            moved = change(vertices.astype(np.float64)).astype("<f4").tobytes()
            path.write_bytes(data[:16] + moved + data[16 + len(moved) :])

    return inject


def move_rock(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a fault that transforms the collision parts and the stated free space in the same way."""

    def in_model(spec: mujoco.MjSpec) -> None:
        for geom in rock_geoms(spec):
            mesh = spec.mesh(geom.meshname)
            vertices = np.array(mesh.uservert).reshape(-1, 3) + geom.pos
            vertices[:, :2] = change(vertices[:, :2])
            geom.pos = [0.0, 0.0, 0.0]
            mesh.uservert = vertices.ravel().tolist()

    def inject(bundle: Path) -> None:
        edit_model(in_model)(bundle)
        path = bundle / FREE_SPACE
        free = decode(path, FreeSpace)
        moved = FreeSpace(shapely.transform(free.polygon, change), free.areas, free.tolerance_m, free.frame)
        path.write_bytes(encode(path, moved))

    return inject


def rock_geoms(spec: mujoco.MjSpec) -> list:
    """Return the collision parts."""
    return [g for g in spec.geoms if is_rock(g.name)]


def set_geom(name: str, **values: object) -> Callable[[Path], None]:
    """Return a fault that changes attributes of one geom."""

    def change(spec: mujoco.MjSpec) -> None:
        for key, value in values.items():
            setattr(spec.geom(name), key, value)

    return edit_model(change)


def set_all(geoms: list, **values: object) -> None:
    """Set attributes of several geoms."""
    for geom in geoms:
        for key, value in values.items():
            setattr(geom, key, value)


def change_image(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a fault that changes a picture in the bundle."""

    def inject(bundle: Path) -> None:
        grey = cv2.imread(str(bundle / name), cv2.IMREAD_UNCHANGED)
        if grey is None:
            raise MineError(f"{bundle / name}: cannot be read as a picture")
        cv2.imwrite(str(bundle / name), change(grey))

    return inject


def rotation(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that rotates points (n, 2) counter-clockwise."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return lambda xy: xy @ np.array([[c, s], [-s, c]])


def seal(bundle: Path) -> None:
    """Write correct hashes into a changed bundle, so that a check must find the fault itself."""
    record = json.loads((bundle / RECORD).read_text())
    names = [p.relative_to(bundle).as_posix() for p in sorted(bundle.rglob("*")) if p.is_file()]
    record["files"] = {name: sha256_bytes((bundle / name).read_bytes()) for name in names if name not in UNSEALED}
    record["world_sha256"] = world_sha256(record)
    (bundle / RECORD).write_text(json.dumps(record))
