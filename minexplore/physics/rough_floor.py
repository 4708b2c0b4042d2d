"""A floor that collides as it looks: height fields over the level planes, with ruts, banks and unevenness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from minexplore.bundle import HFIELDS, GeomGroup, is_rough_floor, zone_of_rough_floor
from minexplore.world import World

_BASE_M = 0.05  # of rock under a height field's lowest point
_FLAT_M = 1e-3  # height of a field that MuJoCo takes
_INVISIBLE = [0.0, 0.0, 0.0, 0.0]  # the visible floor shows it, and beams end on the planes below


@dataclass(frozen=True)
class RoughTile:
    """One tile of a rough floor: its zone, its south-west corner, m, and heights (rows, cols), m, over the planes.

    Rows go north, columns east, `step_m` (2,) apart.
    """

    name: str
    zone: int
    corner_m: np.ndarray
    step_m: np.ndarray
    heights_m: np.ndarray

    @property
    def size_m(self) -> np.ndarray:
        """Return its length (2,) m east and north."""
        rows, cols = self.heights_m.shape
        return self.step_m * [cols - 1, rows - 1]

    def within(self, low: np.ndarray, high: np.ndarray) -> RoughTile | None:
        """Return the part of the tile that a box of the plan reaches, to the next points; None if it reaches none."""
        rows, cols = self.heights_m.shape
        most = np.array([cols, rows]) - 1
        first = np.clip(np.floor((low - self.corner_m) / self.step_m), 0, most).astype(int)
        last = np.clip(np.ceil((high - self.corner_m) / self.step_m), 0, most).astype(int)
        if (first >= last).any():
            return None
        heights = self.heights_m[first[1] : last[1] + 1, first[0] : last[0] + 1]
        return replace(self, corner_m=self.corner_m + first * self.step_m, heights_m=heights)

    def add_to(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, friction: list[float], file: str | None = None) -> None:
        """Add the tile to a body of a spec: as the field of a file, or with its heights."""
        low, span = float(self.heights_m.min()), float(np.ptp(self.heights_m))
        half = self.size_m / 2
        field = spec.add_hfield(name=self.name, size=[*half, max(span, _FLAT_M), _BASE_M])
        if file is None:
            field.nrow, field.ncol = self.heights_m.shape
            field.userdata = ((self.heights_m - low) / max(span, _FLAT_M)).ravel()
        else:
            field.file = file
        body.add_geom(
            name=self.name,
            type=mujoco.mjtGeom.mjGEOM_HFIELD,
            hfieldname=self.name,
            pos=[*(self.corner_m + half), low],
            priority=1,
            friction=friction,
            group=GeomGroup.FLOOR,
            rgba=_INVISIBLE,
        )


class RoughFloor:
    """The tiles of a rough floor."""

    def __init__(self, tiles: list[RoughTile]) -> None:
        """Index the tiles by their boxes."""
        self.tiles = tiles
        self._low = np.array([tile.corner_m for tile in tiles]).reshape(-1, 2)
        self._high = self._low + np.array([tile.size_m for tile in tiles]).reshape(-1, 2)

    def within(self, low: np.ndarray, high: np.ndarray) -> list[RoughTile]:
        """Return the parts of the tiles that a box of the plan reaches."""
        near = np.flatnonzero(((self._low < high) & (self._high > low)).all(axis=1))
        parts = [self.tiles[k].within(low, high) for k in near]
        return [part for part in parts if part is not None]

    def highest_m(self, place_m: np.ndarray, radius_m: float) -> float:
        """Return how high the floor reaches over its planes within a square of the plan; 0 beside it."""
        parts = self.within(np.asarray(place_m) - radius_m, np.asarray(place_m) + radius_m)
        return max((float(part.heights_m.max()) for part in parts), default=0.0)


def read_rough_floor(world: World, spec: mujoco.MjSpec) -> RoughFloor:
    """Return the rough floor of a world, by its files and its MJCF.

    Raises
    ------
    BundleError
        If a file has changed since the world was loaded.
    """
    fields = {field.name: field for field in spec.hfields}
    alone = mujoco.MjSpec()
    for field in fields.values():
        alone.add_hfield(name=field.name, file=field.file, size=field.size)
        alone.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=field.name)
    alone.assets = {name: world.read(name) for name in world.record["files"] if name.startswith(HFIELDS)}
    model = world.compile(alone)
    tiles = []
    for geom in (geom for geom in spec.geoms if is_rough_floor(geom.name)):
        number = model.hfield(geom.name).id
        rows, cols = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
        first = int(model.hfield_adr[number])
        heights = model.hfield_data[first : first + rows * cols].reshape(rows, cols).astype(float)
        half = np.array(fields[geom.name].size[:2])
        tiles.append(
            RoughTile(
                geom.name,
                zone_of_rough_floor(geom.name),
                np.array(geom.pos[:2]) - half,
                2 * half / [cols - 1, rows - 1],
                heights * fields[geom.name].size[2] + geom.pos[2],
            )
        )
    return RoughFloor(tiles)
