"""Deliberate faults: how each is done to a copy of a good bundle, and which check has to see it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import mujoco
import numpy as np
import shapely

from minexplore.bundle import (
    CLEARANCE_GRID,
    FREE_SPACE,
    MINE_BODY,
    MODEL,
    NAV2_MAP,
    RECORD,
    ROCK_CLASS,
    ROOF_GEOM,
    WALLS,
    decode_msh,
    floor_geom,
    is_floor,
    is_rock,
    rock_geom,
    surface_geom,
    world_sha256,
)
from pipeline.errors import MineError
from pipeline.store.codecs import decode, encode
from pipeline.store.hashing import sha256_bytes
from pipeline.types import FreeSpace


@dataclass(frozen=True)
class Mutant:
    """A fault: what it is, how it is done to a copy of the bundle, and which check has to see it.

    `expected` is a metric that must breach its limit or a clause of the certificate that must fail; `refused` the
    words of the error that must end the validation instead.
    """

    name: str
    inject: Callable[[Path], object]
    expected: str = ""
    refused: str = ""


def edit_model(change: Callable[[mujoco.MjSpec], object]) -> Callable[[Path], None]:
    """Return a fault of the MJCF."""

    def inject(bundle: Path) -> None:
        spec = mujoco.MjSpec.from_file(str(bundle / MODEL))
        change(spec)
        (bundle / MODEL).write_text(spec.to_xml())

    return inject


def edit_record(change: Callable[[dict], None]) -> Callable[[Path], None]:
    """Return a fault of `world.json`."""

    def inject(bundle: Path) -> None:
        record = json.loads((bundle / RECORD).read_text())
        change(record)
        (bundle / RECORD).write_text(json.dumps(record))

    return inject


def move_vertices(prefix: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a fault of the rough surface's mesh files whose names begin so."""

    def inject(bundle: Path) -> None:
        for path in sorted((bundle / "meshes").glob(f"{prefix}*.msh")):
            data = path.read_bytes()
            vertices = decode_msh(data).vertices
            moved = change(vertices.astype(np.float64)).astype("<f4").tobytes()
            path.write_bytes(data[:16] + moved + data[16 + len(moved) :])

    return inject


def move_rock(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a fault between stages: plan geometry transformed, collision rock and stated free space alike."""

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


def at_a_wall(bundle: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return a place on the workings' outline, m, in a long straight of it, and the unit vector into the workings."""
    free = decode(bundle / FREE_SPACE, FreeSpace).polygon
    ring = np.asarray(free.exterior.coords)[:, :2]
    edge = int(np.linalg.norm(np.diff(ring, axis=0), axis=1).argmax())
    along = ring[edge + 1] - ring[edge]
    return (ring[edge] + ring[edge + 1]) / 2, np.array([-along[1], along[0]]) / np.linalg.norm(along)


def block_drift(bundle: Path) -> None:
    """Put half a metre of rock across a drift, from wall to wall."""
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
    """Cut a slot of 0.4 m through the part behind a wall."""
    place, inward = at_a_wall(bundle)

    def change(spec: mujoco.MjSpec) -> None:
        behind = shapely.Point(place - 0.1 * inward)
        for geom in rock_geoms(spec):
            vertices = np.array(spec.mesh(geom.meshname).uservert).reshape(-1, 3) + geom.pos
            outline = shapely.convex_hull(shapely.multipoints(vertices[:, :2]))
            if not outline.contains(behind):
                continue
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
            return
        raise MineError("mutants: no part behind the wall")

    edit_model(change)(bundle)


def beside_wall(spec: mujoco.MjSpec, bundle: Path) -> object:
    """Return the collision part behind the long straight wall."""
    place, inward = at_a_wall(bundle)
    behind = shapely.Point(place - 0.1 * inward)
    for geom in rock_geoms(spec):
        vertices = np.array(spec.mesh(geom.meshname).uservert).reshape(-1, 3) + geom.pos
        if shapely.convex_hull(shapely.multipoints(vertices[:, :2])).contains(behind):
            return geom
    raise MineError("mutants: no part behind the wall")


def remove_prism(bundle: Path) -> None:
    """Take one prism away."""
    edit_model(lambda spec: spec.delete(beside_wall(spec, bundle)))(bundle)


def shift_prism(bundle: Path) -> None:
    """Shift one prism by 0.3 m into the workings."""
    _, inward = at_a_wall(bundle)

    def change(spec: mujoco.MjSpec) -> None:
        geom = beside_wall(spec, bundle)
        geom.pos = geom.pos + 0.3 * np.array([*inward, 0.0])  # type: ignore[attr-defined]

    edit_model(change)(bundle)


def raise_prism(bundle: Path) -> None:
    """Lift one prism by half a metre off the floor."""

    def change(spec: mujoco.MjSpec) -> None:
        geom = beside_wall(spec, bundle)
        geom.pos = geom.pos + np.array([0.0, 0.0, 0.6])  # type: ignore[attr-defined]

    edit_model(change)(bundle)


def drop_island(bundle: Path) -> None:
    """Take away all rock of the largest island, and its hole from the stated free space."""
    path = bundle / FREE_SPACE
    free = decode(path, FreeSpace)
    island = max((shapely.Polygon(ring) for ring in free.polygon.interiors), key=lambda p: p.area)

    def change(spec: mujoco.MjSpec) -> None:
        for geom in rock_geoms(spec):
            vertices = np.array(spec.mesh(geom.meshname).uservert).reshape(-1, 3) + geom.pos
            if island.contains(shapely.Point(vertices[:, :2].mean(axis=0))):
                spec.delete(geom)

    edit_model(change)(bundle)
    kept = [ring for ring in free.polygon.interiors if not island.exterior.equals(shapely.LinearRing(ring))]
    whole = shapely.Polygon(free.polygon.exterior, kept)
    path.write_bytes(encode(path, FreeSpace(whole, free.areas, free.tolerance_m, free.frame)))


def set_geom(name: str, **values: object) -> Callable[[Path], None]:
    """Return a fault of one geom's attributes."""

    def change(spec: mujoco.MjSpec) -> None:
        for key, value in values.items():
            setattr(spec.geom(name), key, value)

    return edit_model(change)


def set_all(geoms: list, **values: object) -> None:
    """Set attributes of many geoms."""
    for geom in geoms:
        for key, value in values.items():
            setattr(geom, key, value)


def swap_zones(spec: mujoco.MjSpec) -> None:
    """Exchange the places of the first and the last floor zone."""
    floors = [g for g in spec.geoms if is_floor(g.name)]
    one, two = np.array(floors[0].pos), np.array(floors[-1].pos)
    floors[0].pos, floors[-1].pos = two, one


def flip_tilt(spec: mujoco.MjSpec) -> None:
    """Turn the mine the other way."""
    mine = spec.body(MINE_BODY)
    mine.quat = [mine.quat[0], 0.0, -mine.quat[2], 0.0]


def change_image(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Return a fault of a picture in the bundle."""

    def inject(bundle: Path) -> None:
        grey = cv2.imread(str(bundle / name), cv2.IMREAD_UNCHANGED)
        if grey is None:
            raise MineError(f"{bundle / name}: cannot be read as a picture")
        cv2.imwrite(str(bundle / name), change(grey))

    return inject


def stale_occupancy(bundle: Path) -> None:
    """Leave the grid of a plan that lay two metres farther east."""
    path = bundle / CLEARANCE_GRID
    with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as grid:
        values = {key: grid[key] for key in grid.files}
    values["free"] = np.roll(values["free"], 8, axis=1)
    values["clearance_m"] = np.roll(values["clearance_m"], 8, axis=1)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **values)
    path.write_bytes(buffer.getvalue())


def _shifted(text: str, east_m: float) -> str:
    west = text.split("origin: [")[1].split(",")[0]
    return text.replace(f"origin: [{west}", f"origin: [{float(west) + east_m:.6f}")


def crop_occupancy(bundle: Path) -> None:
    """Keep the grid's south-west corner only."""
    path = bundle / CLEARANCE_GRID
    with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as grid:
        values = {key: grid[key] for key in grid.files}
    for key in ("free", "clearance_m"):
        values[key] = values[key][:40, :40]
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **values)
    path.write_bytes(buffer.getvalue())


def flip_byte(bundle: Path) -> None:
    """Change one byte of a mesh after the bundle was sealed."""
    path = sorted((bundle / "meshes").glob("*.msh"))[0]
    data = bytearray(path.read_bytes())
    data[100] ^= 1
    path.write_bytes(bytes(data))


def out_along_normals(vertices: np.ndarray, factor: float, free: shapely.Polygon) -> np.ndarray:
    """Return wall vertices (n, 3) whose distance from the plan's wall is multiplied."""
    wall = free.boundary
    points = shapely.points(vertices[:, :2])
    foot = shapely.get_coordinates(shapely.line_interpolate_point(wall, shapely.line_locate_point(wall, points)))
    moved = vertices.copy()
    moved[:, :2] = foot + factor * (vertices[:, :2] - foot)
    return moved


def _turned(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return lambda xy: xy @ np.array([[c, s], [-s, c]])


def faults(bundle: Path) -> list[Mutant]:
    """Return all faults for a bundle."""
    free = decode(bundle / FREE_SPACE, FreeSpace).polygon
    south, north = free.bounds[1], free.bounds[3]
    sealed = [
        Mutant("a drift blocked by 0.5 m of rock", block_drift, "certificate.intrusion_m2"),
        Mutant("the same, as a robot finds it", block_drift, "certificate.same_graph"),
        Mutant("a 0.4 m leak in a wall", leak_wall, "certificate.widest_gap_m"),
        Mutant("one prism removed", remove_prism, "certificate.missing_m2"),
        Mutant("one prism shifted by 0.3 m", shift_prism, "certificate.intrusion_m2"),
        Mutant("one prism shifted, by MuJoCo's distances", shift_prism, "certificate.clearance_error_m"),
        Mutant("one prism lifted off the floor", raise_prism, "certificate.missing_m2"),
        Mutant("scale x 1.02", move_rock(lambda xy: 1.02 * xy), "iou.free_space_vs_cleaned"),
        Mutant(
            "plan mirrored",
            move_rock(lambda xy: np.column_stack([xy[:, 0], south + north - xy[:, 1]])),
            "iou.free_space_vs_cleaned",
        ),
        Mutant("plan rotated by 1 deg", move_rock(_turned(1.0)), "iou.free_space_vs_cleaned"),
        Mutant("plan moved by 1 m", move_rock(lambda xy: xy + np.array([1.0, 0.0])), "navigability.blocked"),
        Mutant("island dropped", drop_island, "topology.loops_difference"),
        Mutant("floor zones swapped", edit_model(swap_zones), "world.zones_wrong"),
        Mutant(
            "friction of a zone wrong", set_geom(floor_geom("mud"), friction=[1.0, 0.005, 0.0001]), "world.zones_wrong"
        ),
        Mutant("a zone without priority", set_geom(floor_geom("water"), priority=0), "world.zones_wrong"),
        Mutant("friction of rock wrong", set_geom(rock_geom(3), friction=[0.1, 0.005, 0.0001]), "world.friction_error"),
        Mutant("tilt's sign flipped", edit_model(flip_tilt), "world.tilt_error_deg"),
        Mutant(
            "no tilt at all",
            edit_model(lambda spec: setattr(spec.body(MINE_BODY), "quat", [1.0, 0, 0, 0])),
            "world.frame_error_m",
        ),
        Mutant(
            "gravity halved",
            edit_model(lambda spec: setattr(spec.option, "gravity", [0, 0, -4.905])),
            "world.gravity_error",
        ),
        Mutant("a light missing", edit_model(lambda spec: spec.delete(spec.light("spot_05"))), "world.lights_missing"),
        Mutant(
            "the floor lowered by 0.2 m",
            edit_model(
                lambda spec: setattr(
                    spec.geom(floor_geom("dry")), "pos", spec.geom(floor_geom("dry")).pos - np.array([0, 0, 0.2])
                )
            ),
            "certificate.floor_open_m2",
        ),
        Mutant(
            "the roof missing", edit_model(lambda spec: spec.delete(spec.geom(ROOF_GEOM))), "certificate.roof_open_m2"
        ),
        Mutant(
            "rough amplitude x 2",
            move_vertices("walls_", lambda v: out_along_normals(v, 2.0, free)),
            "texture.bump_ratio",
        ),
        Mutant(
            "rough without its rock",
            move_vertices("walls_", lambda v: out_along_normals(v, 0.0, free)),
            "texture.strict.overall",
        ),
        Mutant(
            "rough shifted by 0.3 m",
            move_vertices("walls_", lambda v: v + np.array([0.0, 0.3, 0.0])),
            "walls.gap_p95_m",
        ),
        Mutant("rough in millimetres", move_vertices("walls_", lambda v: 1000.0 * v), "walls.gap_max_m"),
        Mutant(
            "spawn in rock",
            edit_record(lambda r: r["spawn"].update(anchor_m=[free.bounds[0] - 2.0, south - 2.0])),
            "world.spawn_clearance_m",
        ),
        Mutant(
            "frame of the record shifted",
            edit_record(lambda r: r["T_world_mine"][0].__setitem__(3, 0.0)),
            "world.frame_error_m",
        ),
        Mutant(
            "a frame without rock to fill",
            edit_record(lambda r: r.update(world_m=list(free.bounds))),
            "certificate.rock_round_m",
        ),
        Mutant("stale occupancy grid", stale_occupancy, "world.occupancy_wrong"),
        Mutant("Nav2 map upside down", change_image("map.png", lambda grey: grey[::-1]), "world.map_wrong"),
        Mutant(
            "Nav2 map's origin shifted",
            lambda b: (b / NAV2_MAP).write_text(_shifted((b / NAV2_MAP).read_text(), 0.5)),
            "world.map_wrong",
        ),
        Mutant("grids cropped to a corner", crop_occupancy, "world.occupancy_wrong"),
        Mutant(
            "rock that does not collide",
            edit_model(lambda spec: set_all(rock_geoms(spec), contype=0, conaffinity=0)),
            "world.colliders_wrong",
        ),
        Mutant(
            "rough that collides",
            edit_model(
                lambda spec: set_all([g for g in spec.geoms if g.name.startswith(surface_geom(WALLS))], contype=1)
            ),
            "world.colliders_wrong",
        ),
        Mutant(
            "a wall in a group of its own",
            edit_model(
                lambda spec: spec.body(MINE_BODY).add_geom(
                    name="more", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 6, 2], pos=[50, 0, 2], group=1
                )
            ),
            "world.colliders_wrong",
        ),
    ]
    broken = [
        Mutant("world.json edited", edit_record(lambda r: r.update(tilt_deg=4.0)), refused="record"),
        Mutant("one byte of a mesh changed", flip_byte, refused="sha256"),
        Mutant("a mesh missing", lambda b: sorted((b / "meshes").glob("*.msh"))[3].unlink(), refused="missing"),
        Mutant("a file too many", lambda b: (b / "more.xml").write_text("<mujoco/>"), refused="more.xml"),
    ]
    return [*sealed, *broken]


def seal(bundle: Path) -> None:
    """Give a changed bundle hashes that hold, so that only what is wrong with it can be found."""
    record = json.loads((bundle / RECORD).read_text())
    names = [p.relative_to(bundle).as_posix() for p in sorted(bundle.rglob("*")) if p.is_file()]
    record["files"] = {name: sha256_bytes((bundle / name).read_bytes()) for name in names if name != RECORD}
    record["world_sha256"] = world_sha256(record)
    (bundle / RECORD).write_text(json.dumps(record))
