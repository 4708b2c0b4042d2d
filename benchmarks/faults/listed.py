"""Deliberate faults: how each is injected into a copy of a good bundle, and which check must find it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.faults.injection import (
    block_drift,
    change_grid,
    change_image,
    drop_island,
    edit_model,
    edit_record,
    flip_byte,
    flip_tilt,
    leak_wall,
    move_rock,
    move_vertices,
    raise_prism,
    remove_prism,
    rock_geoms,
    rotation,
    scale_wall_distance,
    set_all,
    set_geom,
    shift_map_origin,
    shift_prism,
    swap_zones,
)
from minexplore.bundle import (
    FREE_SPACE,
    MINE_BODY,
    NAV2_MAP,
    ROOF_GEOM,
    WALLS,
    floor_geom,
    rock_geom,
    surface_geom,
)
from pipeline.store.codecs import decode
from pipeline.types import FreeSpace


@dataclass(frozen=True)
class Mutant:
    """A fault: its name, the function that injects it into a copy of the bundle, and the check that must find it.

    `expected` is a metric that must breach its limit, or a clause of the certificate that must fail. If `refused` is
    given instead, the validation must end with an error that contains it. A fault that is not `sealed` leaves the
    hashes as they were.
    """

    name: str
    inject: Callable[[Path], object]
    expected: str = ""
    refused: str = ""
    sealed: bool = True


def faults(bundle: Path) -> list[Mutant]:
    """Return all faults for a bundle."""
    free = decode(bundle / FREE_SPACE, FreeSpace).polygon
    south, north = free.bounds[1], free.bounds[3]
    found = [
        Mutant("a drift blocked by 0.5 m of rock", block_drift, "certificate.intrusion_mm"),
        Mutant("a drift blocked by 0.5 m of rock, by reach", block_drift, "certificate.same_graph"),
        Mutant("a 0.4 m leak in a wall", leak_wall, "certificate.gap_mm"),
        Mutant("one prism removed", remove_prism, "certificate.missing_mm"),
        Mutant("one prism shifted by 0.3 m", shift_prism, "certificate.intrusion_mm"),
        Mutant("one prism shifted, by MuJoCo's distances", shift_prism, "certificate.clearance_error_m"),
        Mutant("one prism lifted off the floor", raise_prism, "certificate.missing_mm"),
        Mutant("scale x 1.02", move_rock(lambda xy: 1.02 * xy), "iou.free_space_vs_cleaned"),
        Mutant(
            "plan mirrored",
            move_rock(lambda xy: np.column_stack([xy[:, 0], south + north - xy[:, 1]])),
            "iou.free_space_vs_cleaned",
        ),
        Mutant("plan rotated by 1 deg", move_rock(rotation(1.0)), "iou.free_space_vs_cleaned"),
        Mutant("plan moved by 1 m", move_rock(lambda xy: xy + np.array([1.0, 0.0])), "navigability.blocked"),
        Mutant("island dropped", drop_island, "topology.loops_difference"),
        Mutant("floor zones swapped", edit_model(swap_zones), refused="geom[floor_dry]@pos"),
        Mutant(
            "friction of a zone wrong",
            set_geom(floor_geom("mud"), friction=[1.0, 0.005, 0.0001]),
            refused="geom[floor_mud]@friction",
        ),
        Mutant(
            "a zone without priority", set_geom(floor_geom("water"), priority=0), refused="geom[floor_water]@priority"
        ),
        Mutant(
            "friction of rock wrong",
            set_geom(rock_geom(3), friction=[0.1, 0.005, 0.0001]),
            refused="geom[rock_0003]@friction",
        ),
        Mutant("tilt with the wrong sign", edit_model(flip_tilt), refused="body[mine]@quat"),
        Mutant(
            "no tilt",
            edit_model(lambda spec: setattr(spec.body(MINE_BODY), "quat", [1.0, 0, 0, 0])),
            refused="body[mine]@quat",
        ),
        Mutant(
            "gravity halved",
            edit_model(lambda spec: setattr(spec.option, "gravity", [0, 0, -4.905])),
            refused="<option> is not allowed",
        ),
        Mutant(
            "a light missing", edit_model(lambda spec: spec.delete(spec.light("spot_05"))), refused="want 'spot_05'"
        ),
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
            "amplitude of the rough surface x 2",
            move_vertices("walls_", lambda v: scale_wall_distance(v, 2.0, free)),
            "walls.gap_p95_m",
        ),
        Mutant(
            "rough surface without roughness",
            move_vertices("walls_", lambda v: scale_wall_distance(v, 0.0, free)),
            "texture.strict.overall",
        ),
        Mutant(
            "rough surface shifted by 0.3 m",
            move_vertices("walls_", lambda v: v + np.array([0.0, 0.3, 0.0])),
            "walls.gap_p95_m",
        ),
        Mutant("rough surface in millimetres", move_vertices("walls_", lambda v: 1000.0 * v), "walls.gap_max_m"),
        Mutant(
            "spawn region in rock",
            edit_record(lambda r: r["spawn"].update(anchor_m=[free.bounds[0] - 2.0, south - 2.0])),
            refused="statistic@center",
        ),
        Mutant(
            "frame in world.json shifted",
            edit_record(lambda r: r["T_world_mine"][0].__setitem__(3, 0.0)),
            refused="T_world_mine[0][3]",
        ),
        Mutant(
            "an extent without rock around the workings",
            edit_record(lambda r: r.update(world_m=list(free.bounds))),
            "certificate.rock_round_m",
        ),
        Mutant(
            "stale occupancy grid",
            change_grid(lambda cells: np.roll(cells, 8, axis=1)),
            refused="cells differ from the outline",
        ),
        Mutant(
            "Nav2 map upside down",
            change_image("map.png", lambda grey: grey[::-1]),
            refused="pixels differ from the clearance grid",
        ),
        Mutant(
            "Nav2 map's origin shifted",
            lambda b: (b / NAV2_MAP).write_text(shift_map_origin((b / NAV2_MAP).read_text(), 0.5)),
            refused="not the map of the clearance grid",
        ),
        Mutant(
            "clearance grid cropped to a corner",
            change_grid(lambda cells: cells[:40, :40]),
            refused="occupancy.npz: shapes",
        ),
        Mutant(
            "rock that does not collide",
            edit_model(lambda spec: set_all(rock_geoms(spec), contype=0, conaffinity=0)),
            refused="geom[rock_0000]@contype",
        ),
        Mutant(
            "rough surface that collides",
            edit_model(
                lambda spec: set_all([g for g in spec.geoms if g.name.startswith(surface_geom(WALLS))], contype=1)
            ),
            refused="@contype",
        ),
        Mutant(
            "a collision wall in a wrong geom group",
            edit_model(
                lambda spec: spec.body(MINE_BODY).add_geom(
                    name="more", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 6, 2], pos=[50, 0, 2], group=1
                )
            ),
            refused="geom[more]",
        ),
    ]
    broken = [
        Mutant("world.json edited", edit_record(lambda r: r.update(tilt_deg=4.0)), refused="record", sealed=False),
        Mutant("one byte of a mesh changed", flip_byte, refused="sha256", sealed=False),
        Mutant(
            "a mesh missing",
            lambda b: sorted((b / "meshes").glob("*.msh"))[3].unlink(),
            refused="missing",
            sealed=False,
        ),
        Mutant("an extra file", lambda b: (b / "more.xml").write_text("<mujoco/>"), refused="more.xml", sealed=False),
    ]
    return [*found, *broken]
