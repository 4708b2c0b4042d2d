"""The same rays cast in every representation of a world, and whether their ranges agree."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import shapely
from shapely import Polygon

from minesurveys.grid.nav2 import read_nav2_map
from minexplore.bundle import NAV2_MAP, GeomGroup
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.bundle import OpenedBundle, geom_triangles

_HEIGHT_M, _RANGE_M = 0.3, 10.0
_AGREE_M = 0.01
_CLEAR_M = 0.4  # rays start where a robot can stand
_LISTED = 20
_STEP_SHARE = 0.05  # of a cell: the step of a ray over the map


@dataclass(frozen=True)
class Disagreement:
    """A ray on which a backend differs: start, m, bearing, rad, and the ranges by MuJoCo and by the backend, m."""

    x_m: float
    y_m: float
    bearing_rad: float
    bundle_m: float
    backend_m: float


@dataclass(frozen=True)
class Parity:
    """One backend against `mj_ray` on the bundle: compared rays, agreeing rays, worst difference, some disagreements.

    Differences and `tolerance_m` are of ranges. For the map they are distances of the rays' ends from the rock, and the
    tolerance is the diagonal of a cell, because along a wall one cell can mean metres of range.
    """

    rays: int
    agree: int
    worst_m: float
    tolerance_m: float
    disagreements: list[Disagreement]


@dataclass(frozen=True)
class ParityReport:
    """All compared backends, and for each omitted backend the reason."""

    backends: dict[str, Parity]
    left_out: dict[str, str]


def compare_backends(folder: Path, world: OpenedBundle, free: Polygon, rays: int, seed: int) -> ParityReport:
    """Cast level rays at the collision rock from random places where a robot can stand.

    Parameters
    ----------
    folder : Path
    world : OpenedBundle
        The bundle, opened.
    free : shapely.Polygon, m, mine frame
    rays : int
    seed : int

    Raises
    ------
    InputError
        If the bundle's Nav2 map cannot be read.
    """
    rng = np.random.default_rng(seed)
    places, bearings = _rays(free.buffer(-_CLEAR_M), rays, rng)
    rock = GeomGroup.COLLISION
    exact = _by_mujoco(world.model, np.array(world.record.T_world_mine), places, bearings, rock)
    backends = {"Open3D RaycastingScene": _ranges(places, bearings, exact, _by_open3d(world, rock, places, bearings))}
    inside, in_local_models = _by_local_models(folder, places, bearings, exact, rock)
    backends["local models of the environment"] = _ranges(
        places[inside], bearings[inside], exact[inside], in_local_models[inside]
    )
    backends["Nav2 map"] = _by_map(folder, free, places, bearings, exact)
    left_out = {}
    if find_spec("mujoco_warp") is None:
        left_out["MuJoCo Warp"] = "mujoco_warp is not installed"
    else:
        warped = _by_warp(world.model, np.array(world.record.T_world_mine), places, bearings, rock)
        backends["MuJoCo Warp"] = _ranges(places, bearings, exact, warped)
    return ParityReport(backends, left_out)


def _rays(standing: Polygon, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    west, south, east, north = standing.bounds
    places = np.zeros((0, 2))
    while len(places) < count:
        drawn = rng.uniform([west, south], [east, north], (4 * count, 2))
        places = np.concatenate([places, drawn[shapely.contains_xy(standing, drawn[:, 0], drawn[:, 1])]])
    return places[:count], rng.uniform(-np.pi, np.pi, count)


def _directions(bearings: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)])


def _by_mujoco(
    model: mujoco.MjModel, T_world_mine: np.ndarray, places: np.ndarray, bearings: np.ndarray, group: int
) -> np.ndarray:
    """Return ranges (n,) m, at most 10 m, by `mj_ray` against one geom group."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = np.zeros(mujoco.mjNGROUP, np.uint8)
    groups[group] = 1
    starts = np.column_stack([places, np.full(len(places), _HEIGHT_M)]) @ T_world_mine[:3, :3].T + T_world_mine[:3, 3]
    ahead = _directions(bearings) @ T_world_mine[:3, :3].T
    hit = np.zeros(1, np.int32)
    ranges = np.array(
        [mujoco.mj_ray(model, data, p, v, groups, 1, -1, hit, None) for p, v in zip(starts, ahead, strict=True)]
    )
    return np.where((ranges < 0) | (ranges > _RANGE_M), _RANGE_M, ranges)


def _by_open3d(world: OpenedBundle, group: int, places: np.ndarray, bearings: np.ndarray) -> np.ndarray:
    caster = RayCaster(geom_triangles(world.model, group))
    starts = np.column_stack([places, np.full(len(places), _HEIGHT_M)])
    return np.minimum(caster.cast(starts, _directions(bearings)), _RANGE_M)


def _by_local_models(
    folder: Path, places: np.ndarray, bearings: np.ndarray, exact: np.ndarray, group: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return which rays end inside the area whose rock their local model holds, and the ranges by that model."""
    models = LocalModels(load_world(folder), TaskParams(), RobotParams())
    ends = places + exact[:, None] * _directions(bearings)[:, :2]
    tiles = models.tiles_of(places)
    low, high = models.reach(tiles)
    inside = (exact < _RANGE_M) & ((ends >= low) & (ends <= high)).all(axis=1)
    ranges = np.full(len(places), _RANGE_M)
    for tile in np.unique(tiles[inside], axis=0).tolist():
        selected = inside & (tiles == tile).all(axis=1)
        model = models.model(tuple(tile))
        ranges[selected] = _by_mujoco(model, models.T_world_mine, places[selected], bearings[selected], group)
    return inside, ranges


def _by_warp(
    model: mujoco.MjModel, T_world_mine: np.ndarray, places: np.ndarray, bearings: np.ndarray, group: int
) -> np.ndarray:
    """Return ranges (n,) m, at most 10 m, by MuJoCo Warp on the CPU."""
    import mujoco_warp
    import warp

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = warp.types.vector(mujoco.mjNGROUP, warp.float32)(*[1.0 * (k == group) for k in range(mujoco.mjNGROUP)])
    starts = np.column_stack([places, np.full(len(places), _HEIGHT_M)]) @ T_world_mine[:3, :3].T + T_world_mine[:3, 3]
    ahead = _directions(bearings) @ T_world_mine[:3, :3].T
    with warp.ScopedDevice("cpu"):
        m, d = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
        count = len(places)
        distance = warp.empty((1, count), dtype=float)
        mujoco_warp.rays(
            m,
            d,
            warp.array(starts[None], dtype=warp.vec3),
            warp.array(ahead[None], dtype=warp.vec3),
            groups,
            True,
            warp.full(count, -1, dtype=int),
            distance,
            warp.empty((1, count), dtype=int),
            warp.empty((1, count), dtype=warp.vec3),
        )
        ranges = distance.numpy()[0].astype(np.float64)
    return np.where((ranges < 0) | (ranges > _RANGE_M), _RANGE_M, ranges)


def _by_map(folder: Path, free: Polygon, places: np.ndarray, bearings: np.ndarray, exact: np.ndarray) -> Parity:
    """Step the rays over the bundle's Nav2 map; a hit agrees if it lies within a cell of rock."""
    nav2 = read_nav2_map(folder / NAV2_MAP)
    cell, (west, south), occupied = nav2.cell_m, nav2.origin_m, ~nav2.free
    step = _STEP_SHARE * cell
    at, ranges = places.copy(), np.full(len(places), _RANGE_M)
    going = np.ones(len(places), bool)
    for k in range(1, int(_RANGE_M / step) + 1):
        at[going] = places[going] + k * step * _directions(bearings[going])[:, :2]
        col, row = np.floor((at[going] - [west, south]) / cell).astype(int).T
        hit = np.ones(len(col), bool)
        inside = (row >= 0) & (row < occupied.shape[0]) & (col >= 0) & (col < occupied.shape[1])
        hit[inside] = occupied[row[inside], col[inside]]
        stopped = np.flatnonzero(going)[hit]
        ranges[stopped] = k * step
        going[stopped] = False
    ahead = _directions(bearings)[:, :2]
    map_ends, true_ends = (shapely.points(places + r[:, None] * ahead) for r in (ranges, exact))
    # A ray that ends too early must end within a cell of rock. One that ends too late may pass only rock that lies
    # within a cell's diagonal of the free space.
    ends = [shapely.get_coordinates(points) for points in (true_ends, map_ends)]
    passed = shapely.linestrings(np.stack(ends, axis=1))
    short = np.where(ranges < _RANGE_M, shapely.distance(free.boundary, map_ends), 0.0)
    deepest = np.where(ranges > exact, shapely.length(shapely.difference(passed, free.buffer(2**0.5 * cell))), 0.0)
    difference = np.where(ranges <= exact, short, np.where(deepest > 0, cell + deepest, 0.0))
    return _parity(places, bearings, exact, ranges, difference, 2**0.5 * cell)


def _ranges(places: np.ndarray, bearings: np.ndarray, exact: np.ndarray, ranges: np.ndarray) -> Parity:
    return _parity(places, bearings, exact, ranges, np.abs(ranges - exact), _AGREE_M)


def _parity(
    places: np.ndarray, bearings: np.ndarray, exact: np.ndarray, ranges: np.ndarray, difference: np.ndarray, most: float
) -> Parity:
    wrong = np.flatnonzero(difference > most)
    listed = [
        Disagreement(*(round(float(v), 4) for v in (*places[i], bearings[i], exact[i], ranges[i])))
        for i in wrong[:_LISTED]
    ]
    worst = round(float(difference.max()), 6) if len(difference) else 0.0
    return Parity(len(difference), len(difference) - len(wrong), worst, round(most, 4), listed)
