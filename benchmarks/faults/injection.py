"""Injection of faults: each function changes a copy of a good bundle."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import shapely

from minexplore.bundle import (
    FREE_SPACE,
    MINE_BODY,
    MODEL,
    RECORD,
    ROCK_CLASS,
    UNSEALED,
    decode_msh,
    is_rock,
    world_sha256,
)
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
            mesh, vertices = spec.mesh(geom.meshname), vertices_of(spec, geom)
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


def at_a_wall(bundle: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of the outline's longest straight, m, and the unit vector from it into the workings."""
    free = decode(bundle / FREE_SPACE, FreeSpace).polygon
    ring = np.asarray(free.exterior.coords)[:, :2]
    edge = int(np.linalg.norm(np.diff(ring, axis=0), axis=1).argmax())
    along = ring[edge + 1] - ring[edge]
    return (ring[edge] + ring[edge + 1]) / 2, np.array([-along[1], along[0]]) / np.linalg.norm(along)


def block_drift(bundle: Path) -> None:
    """Add 0.5 m of rock across a drift, from wall to wall."""
    place, inward = at_a_wall(bundle)

    def change(spec: mujoco.MjSpec) -> None:
        yaw = float(np.arctan2(inward[1], inward[0]))
        spec.body(MINE_BODY).add_geom(
            spec.find_default(ROCK_CLASS),
            name="rock_fault",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[6.0, 0.25, 1.75],
            pos=[*(place + 5.0 * inward), 1.75],
            quat=[np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)],
        )

    edit_model(change)(bundle)


def leak_wall(bundle: Path) -> None:
    """Cut a slot 0.4 m wide through the part behind a wall."""
    place, inward = at_a_wall(bundle)

    def change(spec: mujoco.MjSpec) -> None:
        geom = part_behind_wall(spec, bundle)
        vertices = vertices_of(spec, geom)
        outline = shapely.convex_hull(shapely.multipoints(vertices[:, :2]))
        slot = shapely.LineString([place + inward, place - 500.0 * inward]).buffer(0.2, cap_style="flat")
        low, high = vertices[:, 2].min(), vertices[:, 2].max()
        spec.delete(geom)
        for k, piece in enumerate(shapely.get_parts(outline.difference(slot))):
            xy = shapely.get_coordinates(piece)[:-1]
            prism = np.concatenate([np.column_stack([xy, np.full(len(xy), z)]) for z in (low, high)])
            spec.add_mesh(name=f"rock_half_{k}", uservert=prism.ravel().tolist())
            spec.body(MINE_BODY).add_geom(
                spec.find_default(ROCK_CLASS),
                name=f"rock_half_{k}",
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=f"rock_half_{k}",
            )

    edit_model(change)(bundle)


def vertices_of(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> np.ndarray:
    """Return the vertices (n, 3) m of a collision part, in the mine frame."""
    return np.array(spec.mesh(geom.meshname).uservert).reshape(-1, 3) + geom.pos


def part_behind_wall(spec: mujoco.MjSpec, bundle: Path) -> mujoco.MjsGeom:
    """Return the collision part behind the outline's longest straight."""
    place, inward = at_a_wall(bundle)
    behind = shapely.Point(place - 0.1 * inward)
    for geom in rock_geoms(spec):
        if shapely.convex_hull(shapely.multipoints(vertices_of(spec, geom)[:, :2])).contains(behind):
            return geom
    raise MineError("mutants: no part behind the wall")


def remove_prism(bundle: Path) -> None:
    """Remove one prism."""
    edit_model(lambda spec: spec.delete(part_behind_wall(spec, bundle)))(bundle)


def move_prism(bundle: Path, inward_m: float, up_m: float) -> None:
    """Move one prism into the workings and up."""
    _, inward = at_a_wall(bundle)

    def change(spec: mujoco.MjSpec) -> None:
        geom = part_behind_wall(spec, bundle)
        geom.pos = geom.pos + np.array([*(inward_m * inward), up_m])

    edit_model(change)(bundle)


def shift_prism(bundle: Path) -> None:
    """Shift one prism by 0.3 m into the workings."""
    move_prism(bundle, 0.3, 0.0)


def raise_prism(bundle: Path) -> None:
    """Lift one prism by 0.6 m off the floor."""
    move_prism(bundle, 0.0, 0.6)


def drop_island(bundle: Path) -> None:
    """Remove all collision parts of the largest island, and its hole from the stated free space."""
    path = bundle / FREE_SPACE
    free = decode(path, FreeSpace)
    island = max((shapely.Polygon(ring) for ring in free.polygon.interiors), key=lambda p: p.area)

    def change(spec: mujoco.MjSpec) -> None:
        for geom in rock_geoms(spec):
            if island.contains(shapely.Point(vertices_of(spec, geom)[:, :2].mean(axis=0))):
                spec.delete(geom)

    edit_model(change)(bundle)
    others = [ring for ring in free.polygon.interiors if not island.exterior.equals(shapely.LinearRing(ring))]
    without_island = shapely.Polygon(free.polygon.exterior, others)
    path.write_bytes(encode(path, FreeSpace(without_island, free.areas, free.tolerance_m, free.frame)))


def flip_byte(bundle: Path) -> None:
    """Change one byte of a mesh without updating its hash."""
    path = sorted((bundle / "meshes").glob("*.msh"))[0]
    data = bytearray(path.read_bytes())
    data[100] ^= 1
    path.write_bytes(bytes(data))


def scale_wall_distance(vertices: np.ndarray, factor: float, free: shapely.Polygon) -> np.ndarray:
    """Return wall vertices (n, 3) with their distance from the plan's wall multiplied by a factor."""
    wall = free.boundary
    points = shapely.points(vertices[:, :2])
    foot = shapely.get_coordinates(shapely.line_interpolate_point(wall, shapely.line_locate_point(wall, points)))
    moved = vertices.copy()
    moved[:, :2] = foot + factor * (vertices[:, :2] - foot)
    return moved


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
