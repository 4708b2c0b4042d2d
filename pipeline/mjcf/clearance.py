"""Clearance to the collision rock, measured by MuJoCo's distance queries."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import shapely

from minexplore.bundle import MODEL
from pipeline.geometry.rock.extrude import section_footprint
from pipeline.mjcf.bundle import placed_parts
from pipeline.mjcf.loading import compile_spec, read_spec
from pipeline.mjcf.visible import leave_out

_PROBE_M = 0.01
_AT_ONCE = 1_000_000  # places that are searched


def rock_clearance(world: Path, T_world_mine: np.ndarray, group: int, places: np.ndarray, most_m: float) -> np.ndarray:
    """Return the distance (n,), m, from places (n, 3), m, to the nearest collision part; 0 inside rock.

    Distances above `most_m` are returned as `most_m`. Places are in the mine frame that `T_world_mine` (4, 4) gives.
    A small sphere is added to the world and moved to every place that has a part within `most_m`.
    """
    spec = read_spec(world / MODEL)
    _keep_group(spec, group)
    add_probe(spec)
    model = compile_spec(spec, world / MODEL)
    of_group = [
        np.flatnonzero((model.geom_group == group) & (model.geom_type == kind))
        for kind in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_BOX)
    ]
    rock = np.concatenate(of_group)  # in the order of `placed_parts`
    return clearance_to_parts(model, rock, placed_parts(model, group, T_world_mine), T_world_mine, places, most_m)


def add_probe(spec: mujoco.MjSpec) -> None:
    """Add the small sphere whose distances `clearance_to_parts` asks for to a world."""
    spec.worldbody.add_body(name="probe", mocap=True).add_geom(
        name="probe", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[_PROBE_M, 0, 0], contype=0, conaffinity=0
    )


def clearance_to_parts(
    model: mujoco.MjModel,
    rock: np.ndarray,
    parts: Sequence[np.ndarray],
    T_world_mine: np.ndarray,
    places: np.ndarray,
    most_m: float,
) -> np.ndarray:
    """Return the distance (n,), m, from places (n, 3), m, mine frame, to the nearest part; see `rock_clearance`.

    `rock` (p,) are the geoms of a model with a probe, and `parts` their corners (k, 3), m, mine frame, in this order.
    """
    data, probe = mujoco.MjData(model), model.geom("probe").id
    mujoco.mj_forward(model, data)
    tree = shapely.STRtree([section_footprint(part) for part in parts])
    low, high = (np.array([end(part[:, 2]) for part in parts]) for end in (np.min, np.max))
    clearance = [most_m] * len(places)
    xpos, segment = data.geom_xpos[probe], np.zeros(6)
    for begin in range(0, len(places), _AT_ONCE):
        some = places[begin : begin + _AT_ONCE]
        place, part = tree.query(shapely.points(some[:, :2]), predicate="dwithin", distance=most_m)
        near = (some[place, 2] > low[part] - most_m) & (some[place, 2] < high[part] + most_m)
        place, part = place[near], part[near]
        at = some @ T_world_mine[:3, :3].T + T_world_mine[:3, 3]
        for i, geom in zip((begin + place).tolist(), rock[part].tolist(), strict=True):
            if clearance[i] == 0.0:  # in another part; nothing is nearer
                continue
            xpos[:] = at[i - begin]
            distance = mujoco.mj_geomDistance(model, data, probe, geom, most_m, segment) + _PROBE_M
            if distance < clearance[i]:
                clearance[i] = max(distance, 0.0)
    return np.array(clearance)


def _keep_group(spec: mujoco.MjSpec, group: int) -> None:
    """Make all other geoms small spheres, and leave out the files that only they use: most meshes are visible rock."""
    for geom in spec.geoms:
        if geom.group != group:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [_PROBE_M, 0, 0]
            geom.meshname = geom.hfieldname = ""
    used = {geom.meshname for geom in spec.geoms}
    leave_out(mesh for mesh in spec.meshes if mesh.file and mesh.name not in used)
