"""A world as a robot needs it: the MJCF, the places it fits in, and the zones of the floor."""

from __future__ import annotations

import functools
import hashlib
import os
import threading
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from minexplore.bundle import MODEL, RECORD, BundleError, TriangleMesh, decode_msh, line_of
from minexplore.floors.floor_zones import FloorZone, read_zones
from minexplore.sealed.files import read_folder
from minexplore.sealed.world import SealedWorld, hash_files, open_files
from minexplore.unfinished import command_to_end

if TYPE_CHECKING:
    from minexplore.floors.volume_arrays import VolumeArrays

DEFAULT_WORLD = "chilean_mine"

_KEPT = 8
_LOADED: OrderedDict[tuple[Path, tuple[tuple[str, str], ...]], World] = OrderedDict()
_LOADING = threading.Lock()


@dataclass(frozen=True)
class World:
    """A bundle that was checked and read.

    `clearance_m[i, j]` is the distance to rock at origin + (j + 0.5, i + 0.5) * cell, 0 in rock (m). The plan is the
    mine frame seen from above. In a world that is one `volume` a cell has the largest clearance of the floors in it.
    """

    folder: Path
    record: dict[str, Any]
    T_world_mine: np.ndarray
    clearance_m: np.ndarray
    origin_m: np.ndarray
    cell_m: float
    floor_zones: list[FloorZone]
    volume: VolumeArrays | None = None

    @property
    def has_heights(self) -> bool:
        """Return whether the floor is not one level plane."""
        return self.volume is not None

    def spec(self) -> mujoco.MjSpec:
        """Return the world's MJCF to attach robots to.

        Raises
        ------
        BundleError
            If the file has changed since the world was loaded, or MuJoCo refuses it.
        """
        self.read(MODEL)
        try:
            return mujoco.MjSpec.from_file(str(self.folder / MODEL))
        except ValueError as error:
            raise BundleError(f"{self.folder / MODEL}: MuJoCo does not read it: {line_of(error)}") from error

    def compile(self, spec: mujoco.MjSpec) -> mujoco.MjModel:
        """Return the model of a spec that was made of this world's.

        Raises
        ------
        BundleError
            If MuJoCo refuses a part; the message is MuJoCo's.
        """
        try:
            return spec.compile()
        except ValueError as error:
            raise BundleError(f"{self.folder / MODEL}: MuJoCo does not compile it: {line_of(error)}") from error

    def read(self, name: str) -> bytes:
        """Return a file of the bundle.

        Raises
        ------
        BundleError
            If it has changed since the world was loaded.
        """
        path = self.folder / name
        try:
            data = path.read_bytes()
        except OSError as error:
            raise BundleError(f"{path}: cannot be read ({error.strerror})") from error
        if hashlib.sha256(data).hexdigest() != self.record["files"][name]:
            raise BundleError(f"{path}: changed since the world was loaded")
        return data

    def mesh(self, name: str) -> TriangleMesh:
        """Return a mesh of the bundle by its file.

        Raises
        ------
        BundleError
            As `read`, or if a place is not finite, or a face names a vertex that is not there.
        """
        try:
            mesh = decode_msh(self.read(name))
        except ValueError as error:
            raise error if isinstance(error, BundleError) else BundleError(f"{self.folder / name}: {error}") from error
        highest = int(mesh.faces.view(np.uint32).max(initial=0))
        if highest >= len(mesh.vertices) or not np.isfinite(mesh.vertices).all():
            raise BundleError(f"{self.folder / name}: a place that is not finite, or a face of a vertex that is absent")
        return mesh

    def places_m(self, clearance_m: float) -> np.ndarray:
        """Return the centres (n, 2) m, plan, of the grid's cells that have at least this clearance."""
        row, col = np.nonzero(self.clearance_m >= clearance_m)
        return self.origin_m + (np.column_stack([col, row]) + 0.5) * self.cell_m

    def active_zones(self, terrain: bool) -> list[FloorZone]:
        """Return the zones with their effects, or with none of them where a task has no terrain."""
        return self.floor_zones if terrain else [zone.without_effects() for zone in self.floor_zones]

    def zones_at(self, east_m: np.ndarray) -> np.ndarray:
        """Return the numbers of the zones at eastings (n,) m of the mine frame; beyond the ends, the nearest."""
        return self._zone_edges.searchsorted(east_m, side="right")

    @functools.cached_property
    def _zone_edges(self) -> np.ndarray:
        return np.array([zone.east_m for zone in self.floor_zones[:-1]])

    @functools.cached_property
    def zone_names(self) -> np.ndarray:
        """Return the zones' names, west to east."""
        return np.array([zone.name for zone in self.floor_zones])


def find_world(world: str | Path | None) -> Path:
    """Return the folder of a bundle given by path, or by the name of one that is shipped or built in this checkout.

    Raises
    ------
    FileNotFoundError
        If there is none; the message lists the names.
    BundleError
        If it is a world of this checkout whose last stage has not ended; the message has the command that ends it.
    """
    folder = _find(world)
    command = command_to_end(folder)
    if command is not None:
        raise BundleError(f"{folder}: unfinished: its last stage has not ended; `{command}` ends it")
    return folder


def _find(world: str | Path | None) -> Path:
    if world is None:
        raise FileNotFoundError("no world: give world=, the path of a world bundle or one of its names")
    if not isinstance(world, str | os.PathLike) or not os.fspath(world):
        raise FileNotFoundError(f"world = {world!r:.80}: want the path of a world bundle, or one of its names")
    shipped = Path(__file__).parent / "worlds"
    artifacts = Path(__file__).parents[1] / "artifacts"  # of a source checkout
    names = {record.parents[2].name: record.parent for record in artifacts.glob(f"worlds/*/realism/world/{RECORD}")}
    names |= {p.name: p for p in shipped.iterdir() if p.is_dir()} if shipped.is_dir() else {}
    if (artifacts / "realism" / "world" / RECORD).is_file():
        names.setdefault(DEFAULT_WORLD, artifacts / "realism" / "world")
    if str(world) in names:
        return names[str(world)]
    try:
        if Path(world).is_dir():
            return Path(world)
    except OSError as error:  # a name that no file system takes
        raise FileNotFoundError(f"world = {str(world)[:200]!r}: {error.strerror}") from error
    if Path(world).is_file():
        raise FileNotFoundError(f"world = {str(world)!r}: a file; a bundle is a folder, so unpack one that is packed")
    known = ", ".join(sorted(names)) or "none; `make all` builds one, `make wheel` packs it"
    raise FileNotFoundError(f"world = {str(world)!r}: no such folder, and no world of that name (there are: {known})")


def load_world(folder: Path) -> World:
    """Open a bundle and read it.

    Every call reads and hashes all files, so that a change is noticed. Equal content is checked once a process.

    Raises
    ------
    BundleError
        If it is no sealed bundle, see `minexplore.sealed`, or a floor zone is not whole.
    """
    files = read_folder(folder)
    hashes = hash_files(files)
    key = (folder, tuple(hashes.items()))
    with _LOADING:
        if key not in _LOADED:
            _LOADED[key] = _read(folder, open_files(folder, files, hashes))
        _LOADED.move_to_end(key)
        while len(_LOADED) > _KEPT:
            _LOADED.popitem(last=False)
        return _LOADED[key]


def checked_world(folder: Path, world_sha256: str) -> World:
    """Return a world that this process has checked; one that it has not, or forgot, is loaded.

    No file is read again: what is read of it later is compared with its hash then.
    """
    with _LOADING:
        for (where, _), world in _LOADED.items():
            if where == folder and world.record["world_sha256"] == world_sha256:
                return world
    return load_world(folder)


def _read(folder: Path, sealed: SealedWorld) -> World:
    record, grid = sealed.record, sealed.grid
    zones = read_zones(folder / RECORD, record.get("zones"))
    transform = np.array(record["T_world_mine"])
    origin, cell = grid["origin_m"], float(grid["cell_m"])
    return World(folder, record, transform, grid["clearance_m"], origin, cell, zones, sealed.volume)
