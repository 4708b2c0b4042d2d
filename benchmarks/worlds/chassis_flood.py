"""Find the places of a world where a robot can stand, and those that it reaches from one of them.

At each place of a grid on the floors MuJoCo is asked whether the robot's chassis touches rock; its wheels and castors
must be over floor, whichever way it is turned. Places that lie beside each other, with floors that a robot climbs
between them, form one region.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from minexplore.floors.volume_arrays import FacetLabel
from minexplore.physics.robot import CASTOR_M, RobotParams
from minexplore.rotations import quaternion
from minexplore.volume.columns import FloorColumns
from minexplore.volume.rock import add_part
from minexplore.world import World

STEP_M = 0.1  # of the grid
_STEEPEST, _STEP_M = 0.364, 0.05  # rise over run of floors that robots drive on, and the step that they take besides
_DROP_M = 0.1  # under the plane that the robot stands on: floor is over it, or ends there
_RINGS, _AROUND = (0.5, 1.0), 24  # parts of the radius within which wheels and castors touch, and places on each
_TILE_M, _BESIDE_M = 4.0, 1.0  # of the models in which contacts are looked for


@dataclass(frozen=True)
class ChassisFlood:
    """Places (n, 3) m of a grid on floors where a robot can stand, and the number of the region (n,) of each.

    Regions are numbered from 0.
    """

    places_m: np.ndarray
    region: np.ndarray

    def from_place(self, place_m: np.ndarray) -> np.ndarray:
        """Return the places (k, 3) m that are connected to the one nearest to a place (3,) m."""
        start = int(np.linalg.norm(self.places_m - place_m, axis=1).argmin())
        found: np.ndarray = self.places_m[self.region == self.region[start]]
        return found


def flood(world: World, robot: RobotParams, step_m: float = STEP_M) -> ChassisFlood:
    """Return where a robot's chassis touches no rock and hangs over no edge, and which of these places are connected.

    Floors are those under plumb lines through a grid. The chassis stands on the facet under its middle. Under 48 places
    about it, as far as its castors, the floor is no more than 10 cm below its plane. Places beside each other,
    diagonals included, are connected if their floors differ by what a robot climbs.
    """
    assert world.volume is not None
    columns = FloorColumns(world.volume.facets)
    places, normals, headroom = _floors(world, columns, step_m)
    steep = np.hypot(normals[:, 0], normals[:, 1]) > _STEEPEST * normals[:, 2]
    fits = ~steep & (headroom >= robot.top_m)
    fits[fits] = ~touches_rock(world, robot, places[fits], normals[fits])
    fits[fits] = ~_hangs_over(columns, robot, places[fits], normals[fits])
    places = places[fits]
    return ChassisFlood(places, _regions(places, step_m))


def _hangs_over(columns: FloorColumns, robot: RobotParams, places_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return at which places (n, 3) m of floors with normals (n, 3) a wheel or a castor may be over an edge (n,)."""
    far = robot.radius_m - CASTOR_M
    turn = np.arange(_AROUND) * 2 * np.pi / _AROUND
    disc = np.concatenate([share * far * np.column_stack([np.cos(turn), np.sin(turn)]) for share in _RINGS])
    beside = np.zeros((len(places_m), len(disc), 3))
    beside[:, :, :2] = disc
    beside[:, :, 2] = -(normals[:, :2] @ disc.T) / normals[:, 2:]
    plane = (places_m[:, None] + beside).reshape(-1, 3)
    under = plane + np.array([0.0, 0.0, robot.ground_clearance_m])
    floor = columns.heights_on(columns.facets_under(under), under[:, :2])
    is_held = (floor >= plane[:, 2] - _DROP_M).reshape(len(places_m), len(disc))  # not where there is no floor
    found: np.ndarray = ~np.asarray(is_held.all(axis=1))
    return found


def _floors(world: World, columns: FloorColumns, step_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places (n, 3) m on floors, their normals (n, 3) and the free heights (n,) m over them."""
    assert world.volume is not None
    facets = world.volume.facets
    low, high = facets.vertices.min(axis=0)[:2], facets.vertices.max(axis=0)[:2]
    first, end = np.floor(low / step_m), np.ceil(high / step_m)
    axes = [(np.arange(first[k], end[k]) + 0.5) * step_m for k in (0, 1)]
    plan = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    hits = columns.hits(plan)
    order = np.lexsort([hits.height_m, hits.place])
    place, z, facet = hits.place[order], hits.height_m[order], hits.facet[order]
    floor = columns.is_floor[facet]
    under = np.flatnonzero((place[1:] == place[:-1]) & floor[:-1] & ~floor[1:])
    normal = -columns.normals[facet[under]]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.column_stack([plan[place[under]], z[under]]), normal, z[under + 1] - z[under]


def touches_rock(world: World, robot: RobotParams, places_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return at which places (n, 3) m of floors with normals (n, 3) a robot's chassis touches walls or roofs (n,)."""
    assert world.volume is not None
    parts = world.volume.parts
    low, high = parts.boxes_m
    rock = parts.label != FacetLabel.FLOOR
    tile = np.floor(places_m / _TILE_M).astype(int)
    _, which = np.unique(tile, axis=0, return_inverse=True)
    found = np.zeros(len(places_m), bool)
    for number in range(int(which.max(initial=-1)) + 1):
        own = np.flatnonzero(which.reshape(-1) == number)
        lowest, highest = places_m[own].min(axis=0) - _BESIDE_M, places_m[own].max(axis=0) + _BESIDE_M
        near = np.flatnonzero(rock & ((low < highest) & (high > lowest)).all(axis=1))
        if len(near):
            found[own] = _contacts(robot, [parts[k] for k in near.tolist()], places_m[own], normals[own])
    return found


def _contacts(robot: RobotParams, parts: list[np.ndarray], places_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
    spec = mujoco.MjSpec()
    middle = places_m.mean(axis=0)
    for number, corners in enumerate(parts):
        add_part(spec, spec.worldbody, f"part_{number}", corners - middle)
    chassis = spec.worldbody.add_body(name="chassis")
    chassis.add_freejoint()  # MuJoCo tests no pair of bodies without joints
    half = robot.height_m / 2
    chassis.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[robot.radius_m, half, 0], contype=0, conaffinity=1)
    model = spec.compile()
    data, found = mujoco.MjData(model), np.zeros(len(places_m), bool)
    for k, (place, normal) in enumerate(zip(places_m - middle, normals, strict=True)):
        ahead = np.array([1.0, 0.0, -normal[0] / normal[2]])
        ahead /= np.linalg.norm(ahead)
        axes = np.column_stack([ahead, np.cross(normal, ahead), normal])
        data.qpos[:3] = place + (robot.ground_clearance_m + half) * normal
        data.qpos[3:] = quaternion(axes)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found[k] = (data.contact.dist[: data.ncon] < 0).any()
    return found


def _regions(places_m: np.ndarray, step_m: float) -> np.ndarray:
    """Return the connected set (n,) of each place."""
    at = np.floor(places_m[:, :2] / step_m).astype(np.int64)
    at -= at.min(axis=0) - 1
    wide = int(at[:, 0].max()) + 2
    key = at[:, 1] * wide + at[:, 0]
    order = np.argsort(key, kind="stable")
    keys, pairs = key[order], []
    for step, run in ((1, 1.0), (wide, 1.0), (wide - 1, np.sqrt(2)), (wide + 1, np.sqrt(2))):
        start, end = (np.searchsorted(keys, key + step, side=side) for side in ("left", "right"))
        for k in range(int((end - start).max(initial=0))):
            one = np.flatnonzero(start + k < end)
            two = order[start[one] + k]
            near = np.abs(places_m[one, 2] - places_m[two, 2]) <= _STEEPEST * step_m * run + _STEP_M
            pairs.append(np.column_stack([one[near], two[near]]))
    joined = np.concatenate(pairs)
    graph = coo_matrix((np.ones(len(joined)), joined.T), (len(key),) * 2)
    found: np.ndarray = connected_components(graph, directed=False)[1]
    return found
