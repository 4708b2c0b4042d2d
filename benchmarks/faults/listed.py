"""Deliberate faults of rock, surface and files: how each is injected into a good bundle, and which check must find it.

Wrong values of single fields are changes that `benchmarks.faults.judge` makes of every field.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.faults.injection import (
    block_drift,
    drop_island,
    edit_model,
    edit_record,
    flip_byte,
    leak_wall,
    move_rock,
    move_vertices,
    raise_prism,
    remove_prism,
    rotation,
    scale_wall_distance,
    shift_prism,
)
from minexplore.bundle import (
    FREE_SPACE,
    ROOF_GEOM,
    floor_geom,
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
            "an extent without rock around the workings",
            edit_record(lambda r: r.update(world_m=list(free.bounds))),
            "certificate.rock_round_m",
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
