"""What two models of one mine have in common, by code that neither of them uses: beams, areas, reach and pushes."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import shapely
from scipy.ndimage import label as number_areas
from scipy.spatial import ConvexHull
from shapely import Polygon

from minexplore.floors.volume_arrays import FloorSpans
from pipeline.types import Occupancy

ROBOT_M = 0.35  # radius of what is pushed, and of what is to reach a place
_TALL_M, _OVER_M = 0.3, 0.15  # height of what is pushed, and how far it is over the floor
_CHUNK = 2000  # beams
_GRID_M = 1e-9  # of sections: sides that meet differ in the last digit
_FORCE_N, _DAMPING, _MASS_KG = 30.0, 20.0, 10.0
_STEP_S, _PUSH_S = 0.002, 2.5
_SOLREF, _SOLIMP = (
    [0.004, 1.0],
    [0.99, 0.999, 1e-4, 0.5, 2.0],
)  # stiff: how deep discs sink in depends on the number of contacts
_TOGETHER = 100  # that are pushed in one model, and do not feel each other
_WALL, _PUSHED = 1, 2  # bits of contact


@dataclass(frozen=True)
class Beams:
    """Beams from places (n, 3) m in directions (n, 3)."""

    places_m: np.ndarray
    ways: np.ndarray

    @classmethod
    def random(cls, outline: Polygon, height_m: float, count: int, rng: np.random.Generator) -> Beams:
        """Start beams all over the free space, in all directions."""
        places = places_in(outline.buffer(-0.02), count, rng)
        ways = rng.normal(size=(count, 3))
        z = rng.uniform(0.05, height_m - 0.05, count)
        return cls(np.column_stack([places, z]), ways / np.linalg.norm(ways, axis=1, keepdims=True))

    def in_slab(self, outline: Polygon, height_m: float) -> np.ndarray:
        """Return the ranges (n,) m to the floor, the roof and the walls on an outline."""
        z, rise = self.places_m[:, 2], self.ways[:, 2]
        with np.errstate(divide="ignore"):
            found = np.where(rise < 0, -z / rise, np.where(rise > 0, (height_m - z) / rise, np.inf))
        rings = [shapely.get_coordinates(ring) for ring in (outline.exterior, *outline.interiors)]
        start = np.concatenate([ring[:-1] for ring in rings])
        side = np.concatenate([np.diff(ring, axis=0) for ring in rings])
        for first in range(0, len(found), _CHUNK):
            rows = slice(first, first + _CHUNK)
            place, way = self.places_m[rows, None, :2], self.ways[rows, None, :2]
            across = way[..., 0] * side[:, 1] - way[..., 1] * side[:, 0]
            to = start - place
            with np.errstate(divide="ignore", invalid="ignore"):
                along = (to[..., 0] * side[:, 1] - to[..., 1] * side[:, 0]) / across
                share = (to[..., 0] * way[..., 1] - to[..., 1] * way[..., 0]) / across
            hits = (along >= 0) & (share >= -1e-12) & (share <= 1 + 1e-12)
            found[rows] = np.minimum(found[rows], np.where(hits, along, np.inf).min(axis=1))
        return found

    def among(self, parts: list[np.ndarray]) -> np.ndarray:
        """Return the ranges (n,) m to convex parts, corners (k, 3) m each; inf where a beam meets none."""
        found = np.full(len(self.places_m), np.inf)
        solids = [np.unique(ConvexHull(corners).equations.round(12), axis=0).T for corners in parts]
        for first in range(0, len(found), _CHUNK):
            rows = slice(first, first + _CHUNK)
            for planes in solids:
                over = self.places_m[rows] @ planes[:3] + planes[3]
                rate = self.ways[rows] @ planes[:3]
                with np.errstate(divide="ignore", invalid="ignore"):
                    at = -over / rate
                enter = np.where(rate < 0, at, -np.inf).max(axis=1)
                leave = np.where(rate > 0, at, np.inf).min(axis=1)
                beside = ((rate == 0) & (over > 0)).any(axis=1)
                hits = (enter <= leave + 1e-9) & (leave >= 0) & ~beside
                found[rows] = np.minimum(found[rows], np.where(hits, np.maximum(enter, 0.0), np.inf))
        return found


def places_in(area: Polygon, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return random places (count, 2) m in an area."""
    shapely.prepare(area)
    west, south, east, north = area.bounds
    found = np.zeros((0, 2))
    while len(found) < count:
        tried = rng.uniform((west, south), (east, north), (4 * count, 2))
        found = np.concatenate([found, tried[shapely.contains_xy(area, *tried.T)]])
    return found[:count]


def enclosed_area(parts: list[np.ndarray], height_m: float, place_m: tuple[float, float]) -> Polygon:
    """Return the area about a place that parts enclose at a height: what no section of a part covers."""
    some = [section for part in parts if (section := _section(part, height_m)) is not None]
    sections = shapely.union_all(some, grid_size=_GRID_M)
    west, south, east, north = sections.bounds
    free = shapely.box(west - 1, south - 1, east + 1, north + 1).difference(sections)
    found: Polygon = next(area for area in shapely.get_parts(free) if area.contains(shapely.Point(place_m)))
    return found


def _section(corners: np.ndarray, height_m: float) -> Polygon | None:
    low, high = corners[corners[:, 2] < height_m], corners[corners[:, 2] > height_m]
    if not len(low) or not len(high):
        return None
    share = ((height_m - low[:, 2])[:, None] / (high[:, 2] - low[:, 2, None]))[..., None]
    found: Polygon = shapely.MultiPoint((low[:, None] * (1 - share) + high * share)[..., :2].reshape(-1, 2)).convex_hull
    return found if found.area > 0 else None


def reach_by_outline(outline: Polygon, place_m: tuple[float, float]) -> float:
    """Return the area, m2, in which the middle of a disc of 0.35 m can be, on ways from a place."""
    parts = shapely.get_parts(outline.buffer(-ROBOT_M, quad_segs=64))
    return float(parts[shapely.distance(parts, shapely.Point(place_m)).argmin()].area)


def reach_on_grid(grid: Occupancy, place_m: tuple[float, float]) -> float:
    """Return the area, m2, of a level grid's cells with so much room that are joined to a place."""
    areas, _ = number_areas(grid.clearance_m >= ROBOT_M, np.ones((3, 3)))
    column, row = np.floor((np.array(place_m) - grid.origin_m) / grid.cell_m).astype(int)
    return float((areas == areas[row, column]).sum() * grid.cell_m**2)


def reach_on_spans(cells: FloorSpans, place_m: tuple[float, float]) -> float:
    """Return the area, m2, of a volume's spans whose middles have so much room that are joined to a place."""
    column, row = cells.column - cells.column.min(), cells.row - cells.row.min()
    usable = np.zeros((row.max() + 1, column.max() + 1), bool)
    fits = cells.clearance_m - np.hypot(*cells.aside_m[:, :2].T) >= ROBOT_M
    fits |= (cells.aside_m == 0).all(axis=1) & (cells.clearance_m >= ROBOT_M)
    usable[row[fits], column[fits]] = True
    areas, _ = number_areas(usable, np.ones((3, 3)))
    corner = cells.origin_m + np.array([cells.column.min(), cells.row.min()]) * cells.cell_m
    at_column, at_row = np.floor((np.array(place_m) - corner) / cells.cell_m).astype(int)
    return float((areas == areas[at_row, at_column]).sum() * cells.cell_m**2)


@dataclass(frozen=True)
class Pushes:
    """Where discs end (n, 2) m that are pushed for 2.5 s, and which (n,) touch rock then."""

    ends_m: np.ndarray
    touch: np.ndarray

    def deepest_mm(self, outline: Polygon) -> float:
        """Return how far the deepest disc is beyond the outline."""
        apart = shapely.distance(outline.boundary, shapely.points(self.ends_m))
        inside = shapely.contains_xy(outline, *self.ends_m.T)
        return float(1e3 * (ROBOT_M - np.where(inside, apart, -apart)).max())


def push(parts: list[np.ndarray], places_m: np.ndarray, headings: np.ndarray) -> Pushes:
    """Push upright cylinders from places (n, 2) m along headings (n,), rad, among parts as MuJoCo compiles them."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = _STEP_S, [0.0, 0.0, 0.0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for number, corners in enumerate(parts):
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        mesh = spec.add_mesh(name=f"part{number}", uservert=(corners - middle).ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"part{number}",
            pos=middle,
            contype=_WALL,
            conaffinity=0,
            friction=[0, 0, 0],
        )
    for _ in range(_TOGETHER):
        body = spec.worldbody.add_body(pos=[0, 0, _OVER_M + _TALL_M / 2])
        for axis in ([1, 0, 0], [0, 1, 0]):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, damping=[_DAMPING, 0, 0])
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[ROBOT_M, _TALL_M / 2, 0],
            mass=_MASS_KG,
            contype=0,
            conaffinity=_WALL,
            friction=[0, 0, 0],
            condim=1,
            priority=1,
            solref=_SOLREF,
            solimp=_SOLIMP,
        )
    model = spec.compile()
    data, ends, touch = mujoco.MjData(model), np.zeros_like(places_m), np.zeros(len(places_m), bool)
    for start in range(0, len(places_m), _TOGETHER):
        rows = slice(start, start + _TOGETHER)
        count = len(places_m[rows])
        mujoco.mj_resetData(model, data)
        data.qpos[: 2 * count] = places_m[rows].ravel()
        data.qpos[2 * count :] = np.tile(places_m[start], _TOGETHER - count)
        way = np.column_stack([np.cos(headings[rows]), np.sin(headings[rows])])
        data.qfrc_applied[: 2 * count] = _FORCE_N * way.ravel()
        for _ in range(round(_PUSH_S / _STEP_S)):
            mujoco.mj_step(model, data)
        ends[rows] = data.qpos[: 2 * count].reshape(-1, 2)
        bodies = model.geom_bodyid[data.contact.geom].max(axis=1) - 1
        touch[start + np.unique(bodies[bodies < count])] = True
    return Pushes(ends, touch)
