"""A world as a robot needs it: the MJCF, the places it fits in, and the zones of the floor."""

from __future__ import annotations

import functools
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from minexplore.bundle import CLEARANCE_GRID, MODEL, RECORD, read_bundle
from minexplore.floor_zones import FloorZone, read_zones

DEFAULT_WORLD = "chilean_mine"


@dataclass(frozen=True)
class World:
    """A bundle that was checked and read.

    `clearance_m[i, j]` is the distance to rock at origin + (j + 0.5, i + 0.5) * cell, 0 in rock (m, mine frame).
    """

    folder: Path
    record: dict[str, Any]
    T_world_mine: np.ndarray
    clearance_m: np.ndarray
    origin_m: np.ndarray
    cell_m: float
    floor_zones: list[FloorZone]

    def spec(self) -> mujoco.MjSpec:
        """Return the world's MJCF to attach robots to."""
        return mujoco.MjSpec.from_file(str(self.folder / MODEL))

    def places_m(self, clearance_m: float) -> np.ndarray:
        """Return the centres (n, 2) m, mine frame, of the grid's cells that have at least this clearance."""
        row, col = np.nonzero(self.clearance_m >= clearance_m)
        return self.origin_m + (np.column_stack([col, row]) + 0.5) * self.cell_m

    def active_zones(self, terrain: bool) -> list[FloorZone]:
        """Return the zones with their effects, or with none of them where a task has no terrain."""
        return self.floor_zones if terrain else [zone.without_effects() for zone in self.floor_zones]

    def zones_at(self, east_m: np.ndarray) -> np.ndarray:
        """Return the numbers of the zones at eastings (n,) m; beyond the ends, the nearest."""
        edges = [zone.east_m for zone in self.floor_zones[:-1]]
        return np.searchsorted(edges, east_m, side="right")

    @functools.cached_property
    def zone_names(self) -> np.ndarray:
        """Return the zones' names, west to east."""
        return np.array([zone.name for zone in self.floor_zones])


def find_world(world: str | Path | None) -> Path:
    """Return the folder of a bundle given by path, or by the name of one that ships with the package.

    Raises
    ------
    FileNotFoundError
        If there is none; the message lists the names.
    """
    if world is None:
        raise FileNotFoundError("no world: give world=, the path of a world bundle or one of its names")
    shipped = Path(__file__).parent / "worlds"
    built = Path(__file__).parents[1] / "artifacts" / "realism" / "world"  # of a source checkout
    names = {p.name: p for p in shipped.iterdir() if p.is_dir()} if shipped.is_dir() else {}
    if (built / RECORD).is_file():
        names.setdefault(DEFAULT_WORLD, built)
    if str(world) in names:
        return names[str(world)]
    if Path(world).is_dir():
        return Path(world)
    known = ", ".join(sorted(names)) or "none; `make all` builds one, `make wheel` packs it"
    raise FileNotFoundError(f"world = {str(world)!r}: no such folder, and no world of that name (there are: {known})")


@functools.lru_cache(maxsize=8)
def load_world(folder: Path) -> World:
    """Check a bundle and read it, once a process.

    Raises
    ------
    BundleError
        If a file of the bundle is missing or changed, or a floor zone is not whole; see `read_bundle`, `read_zones`.
    """
    record = read_bundle(folder)
    with np.load(io.BytesIO((folder / CLEARANCE_GRID).read_bytes()), allow_pickle=False) as grid:
        clearance, origin, cell = grid["clearance_m"], grid["origin_m"], float(grid["cell_m"])
    zones = read_zones(folder / RECORD, record.get("zones"))
    return World(folder, record, np.array(record["T_world_mine"]), clearance, origin, cell, zones)
