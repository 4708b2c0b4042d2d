"""The contract of a world bundle: format, file names, names in the MJCF, geom groups, frames, meshes, and its proof.

The pipeline writes bundles by this module and the environment reads them by it. Nothing else spells these names.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

FORMAT = "minexplore-world/2"
VOLUME_FORMAT = "minexplore-world/3"  # of a world that is one closed volume of free space

# Files of a bundle, relative to its folder.
RECORD = "world.json"
MODEL = "mine.xml"
CLEARANCE_GRID = "occupancy.npz"
FREE_SPACE = "free_space.geojson"
TOPOLOGY = "topology.json"
OCTREE = "free_space.bt"
NAV2_MAP, NAV2_PICTURE = "map.yaml", "map.png"
PREVIEW = "preview.png"
FOLDED_FLOOR = "floor.npz"  # of worlds that older versions made, which are refused
VOLUME, PARTS, CELLS = "volume.npz", "parts.npz", "cells.npz"  # only of a world that is one volume
ROCK_TEXTURE = "textures/rock.png"
MADE_BY = "made_by.json"  # what the bundle states to be made by; no part of the world, and not in its hash
UNSEALED = (RECORD, MADE_BY)  # every other file has its hash in the record

ROUGH_OVERLAY, NO_OVERLAY = "rough", "none"  # `overlay` of `world.json`: a world with visible rock, and one without
BARE_ROCK_RGBA = (0.54, 0.44, 0.36, 1.0)  # its collision parts' colour

# Frames that a bundle states coordinates in.
FRAMES = {
    "mine": "x east, y north, z up from the floor, origin at the survey's origin; plan and geometry use it",
    "world": "MuJoCo's: the mine frame's centre at its origin, the mine tilted about Y; gravity is -z",
}

# Bodies of the MJCF. The mine's body carries the mine frame. What is seen and never touched is in two bodies: the
# rock's surface, and the fittings, which are the visible floor, its puddles, and what hangs in a drift.
MINE_BODY = "mine"
SURFACE_BODY = "surface"
FITTINGS_BODY = "fittings"

# Default classes of the MJCF: collision parts with the roof, and visible meshes.
ROCK_CLASS = "rock"
SURFACE_CLASS = "surface"

ROOF_GEOM = "roof"

INERTIAL_QUAT = (0.8, 0.6, 0.0, 0.0)  # of the mine's body where it states an inertia: no upright part has these axes

# Pieces of a surface: the rough one is cut into chunks of walls and roof, the smooth one has a mesh a piece.
WALLS, ROOF, FLOOR_CHAMFER = "walls", "roof", "floor_chamfer"

ENTRANCE_CAMERA, OVERVIEW_CAMERA = "entrance", "overview"

MESHES = "meshes/"  # folder of visible meshes
_MESH_SUFFIX = ".msh"
HFIELDS = "hfields/"  # folder of the heights of a rough floor

_MAP, _GROUND, _SPOT = "map_", "ground_", "spot_"
_FLOOR, _ROCK, _SURFACE, _SMOOTH = "floor_", "rock_", "surface_", "smooth_"


# Fittings, and where they may be above the flat floor, m: the visible floor lies below `COVER_M`, furniture hangs above
# every robot. Lines run along a rib or under the roof.
FURNITURE = ("bolts", "cable", "duct", "pipe", "weldmesh")
SHADE_MESH = "shade"
_LET_BEAMS_PASS = ("cover", "puddle", SHADE_MESH, "weldmesh")
WATER_MATERIAL, SHADE_MATERIAL = "water", "shade"
COVER_M, FURNITURE_ABOVE_M, LINES_ABOVE_M = 0.1, 1.0, 2.0
_COVER, _FITTING, _PUDDLE, _SHADE = "cover_", "fitting_", "puddle_", "shade_"
_ROUGH = "rough_"

# Patterns of names that end in a number. Other patterns are those of a zone or of a mesh in the functions below.
ROCK_NAMES, SPOT_NAMES = rf"{_ROCK}\d{{4,6}}", rf"{_SPOT}\d{{2,5}}"
SHADE_NAMES, COVER_MESHES = rf"{_SHADE}\d", rf"{_COVER}\d{{3,4}}_\d{{2,4}}_\d{{2,4}}"
ROUGH_FLOORS = r"rough_\d{3,4}_\d{2,4}_\d{2,4}"
STOREY_MAPS = rf"{_MAP}\d{{2,4}}\.(?:yaml|png)"
SMOOTH_MESHES = tuple(f"{_SMOOTH}{piece}" for piece in (FLOOR_CHAMFER, WALLS, ROOF))
ROUGH_MESH = rf"(?:{WALLS}|{ROOF})_\d{{2,4}}_\d{{2,4}}"
VISIBLE_MESH = rf"(?:{ROUGH_MESH}|{'|'.join(SMOOTH_MESHES)})"
FURNITURE_MESH = rf"(?:{'|'.join(FURNITURE)})_\d{{2,4}}_\d{{2,4}}"
FITTING_MESH = rf"(?:{COVER_MESHES}|{FURNITURE_MESH}|{SHADE_MESH}|{_PUDDLE}[a-z][a-z0-9_]*)"

_MOST_MESSAGE = 2000  # characters of an error


class BundleError(ValueError):
    """A bundle is incomplete or changed, or the folder holds none; the message names the file.

    What a file says can add neither lines nor control characters to the message, and no more than 2,000 characters.
    """

    def __init__(self, message: str) -> None:
        """Take the message, which may quote a file."""
        clean = "".join(c if c.isprintable() else repr(c)[1:-1] for c in message[:_MOST_MESSAGE])
        super().__init__(clean if len(message) <= _MOST_MESSAGE else f"{clean} ...")


def line_of(error: BaseException) -> str:
    """Return a library's message on one line."""
    return " ".join(str(error).split())


class GeomGroup(IntEnum):
    """What a geom is. MuJoCo's viewers show groups 0 to 2 and hide the rest."""

    FLOOR = 0
    ROBOT = 1
    ROUGH_SURFACE = 2
    COLLISION = 3
    ROOF = 4
    SMOOTH_SURFACE = 5


# The groups as `world.json` names them under `geom_groups`.
GEOM_GROUPS = {
    "floor": GeomGroup.FLOOR.value,
    "rough_surface": GeomGroup.ROUGH_SURFACE.value,
    "collision": GeomGroup.COLLISION.value,
    "roof": GeomGroup.ROOF.value,
    "smooth_surface": GeomGroup.SMOOTH_SURFACE.value,
}


def has_visible_rock(record: Mapping[str, Any]) -> bool:
    """Return whether a world has visible rock, by its record; without it robots see the collision parts."""
    return record["overlay"] != NO_OVERLAY


def floor_geom(zone: str) -> str:
    """Return the name of a floor zone's geom."""
    return f"{_FLOOR}{zone}"


def ground_material(zone: str) -> str:
    """Return the name of the material of a floor zone's geoms, which no surface covers."""
    return f"{_GROUND}{zone}"


def spot_light(number: int) -> str:
    """Return the name of one of the lights along the drifts."""
    return f"{_SPOT}{number:02d}"


def has_rough_floor(record: Mapping[str, Any]) -> bool:
    """Return whether robots stand on the visible floor of a world, by its record, and not on level planes."""
    return "rough_floor" in record


def is_volume(record: Mapping[str, Any]) -> bool:
    """Return whether a world is one closed volume of free space, by its record."""
    return record.get("format") == VOLUME_FORMAT


def storey_map(storey: int) -> tuple[str, str]:
    """Return the files of the Nav2 map of one storey of a volume: map and picture."""
    return f"{_MAP}{storey:02d}.yaml", f"{_MAP}{storey:02d}.png"


def is_floor(geom: str) -> bool:
    """Return whether a geom of this name is a floor zone, or a part of the floor of a volume."""
    return geom.startswith(_FLOOR)


def floor_part(zone: str, number: int) -> str:
    """Return the name of the geom and mesh of one convex part under the floor of a volume, in a zone."""
    return f"{floor_geom(zone)}_{number:05d}"


def rough_floor(zone: int, col: int, row: int) -> str:
    """Return the name of the geom and height field of one tile of a rough floor, in a zone by number."""
    return f"{_ROUGH}{zone:03d}_{col:02d}_{row:02d}"


def is_rough_floor(geom: str) -> bool:
    """Return whether a geom of this name is a tile of a rough floor."""
    return geom.startswith(_ROUGH)


def zone_of_rough_floor(name: str) -> int:
    """Return the number of the zone that a tile of a rough floor is in."""
    return int(name.split("_")[1])


def hfield_file(name: str) -> str:
    """Return the file of a height field."""
    return f"{HFIELDS}{name}.png"


def is_roof(geom: str) -> bool:
    """Return whether a geom of this name is the level roof."""
    return geom == ROOF_GEOM


def rock_geom(number: int) -> str:
    """Return the name of a convex collision part's geom and mesh."""
    return f"{_ROCK}{number:04d}"


def is_rock(geom: str) -> bool:
    """Return whether a geom of this name is a collision part; the roof is none."""
    return geom.startswith(_ROCK)


def chunk_mesh(piece: str, col: int, row: int) -> str:
    """Return the name of the mesh of one tile of a piece of the rough surface, or of a kind of furniture."""
    return f"{piece}_{col:02d}_{row:02d}"


def smooth_mesh(piece: str) -> str:
    """Return the name of the mesh of one piece of the smooth surface."""
    return f"{_SMOOTH}{piece}"


def mesh_file(mesh: str) -> str:
    """Return the file of a visible mesh."""
    return f"{MESHES}{mesh}{_MESH_SUFFIX}"


def mesh_of(file: str) -> str:
    """Return the mesh of a file of `MESHES`."""
    return file.removeprefix(MESHES).removesuffix(_MESH_SUFFIX)


def surface_geom(mesh: str) -> str:
    """Return the name of the geom that shows a mesh, or what the names of a piece's geoms begin with."""
    return f"{_SURFACE}{mesh}"


def cover_mesh(zone: int, col: int, row: int) -> str:
    """Return the name of the mesh of one piece of the visible floor, in a zone by number."""
    return f"{_COVER}{zone:03d}_{col:02d}_{row:02d}"


def is_cover(mesh: str) -> bool:
    """Return whether a mesh of this name is a piece of the visible floor."""
    return mesh.startswith(_COVER)


def is_fitting(mesh: str) -> bool:
    """Return whether a mesh of this name is part of the visible floor or of the furniture."""
    return mesh.partition("_")[0] in (*FURNITURE, *_LET_BEAMS_PASS)


def stops_beams(mesh: str) -> bool:
    """Return whether LiDAR sees a visible mesh of this name.

    Beams pass the visible floor, to end on the flat floor that robots stand on, and weld mesh, whose wires cover less
    than a tenth of it and hang a few centimetres before the rock.
    """
    return mesh.partition("_")[0] not in _LET_BEAMS_PASS


def fitting_geom(mesh: str) -> str:
    """Return the name of the geom that shows a fitting's mesh."""
    return f"{_FITTING}{mesh}"


def cover_material(zone: str) -> str:
    """Return the material of a zone's visible floor."""
    return f"{_COVER}{zone}"


def fitting_material(mesh: str, zones: Sequence[str]) -> str:
    """Return the material of a fitting's mesh: that of its zone's floor, or of its kind of furniture."""
    parts = mesh.split("_")
    return cover_material(zones[int(parts[1])]) if is_cover(mesh) else f"{_FITTING}{parts[0]}"


def puddle_geom(zone: str) -> str:
    """Return the name of the plane that shows water in the hollows of a flooded zone."""
    return f"{_PUDDLE}{zone}"


def shade_geom(layer: int) -> str:
    """Return the name of one of the clear planes that darken hollows of the visible floor, from the lowest."""
    return f"{_SHADE}{layer}"


def is_shade(geom: str) -> bool:
    """Return whether a geom's name is that of a plane that darkens hollows."""
    return geom.startswith(_SHADE)


_FLOAT32, _INT32 = np.dtype("<f4"), np.dtype("<i4")


@dataclass(frozen=True)
class TriangleMesh:
    """A triangle mesh as a `.msh` file holds it.

    `vertices` (n, 3) m, `faces` (m, 3) vertex numbers, `texcoords` (n, 2) with v downwards from a picture's first row,
    `normals` (n, 3) unit vectors; texture coordinates and normals may be absent, (0, 2) and (0, 3).
    """

    vertices: np.ndarray
    faces: np.ndarray
    texcoords: np.ndarray
    normals: np.ndarray


def decode_msh(data: bytes) -> TriangleMesh:
    """Read MuJoCo's binary mesh: four counts, then positions, normals, texture coordinates and faces.

    Returns
    -------
    TriangleMesh
        In the file's own precision, float32 and int32; read-only.

    Raises
    ------
    ValueError
        If the counts do not match the size.
    """
    counts = struct.unpack_from("<4i", data) if len(data) >= 16 else (-1,)
    if min(counts) < 0 or len(data) != 16 + 12 * (counts[0] + counts[1] + counts[3]) + 8 * counts[2]:
        raise ValueError(f"a .msh of {len(data)} bytes: its counts {list(counts)} do not match its size")
    ends = list(itertools.accumulate((3 * counts[0], 3 * counts[1], 2 * counts[2])))
    numbers = np.frombuffer(data, _FLOAT32, ends[2], 16)
    vertices, normals = numbers[: ends[0]].reshape(-1, 3), numbers[ends[0] : ends[1]].reshape(-1, 3)
    texcoords = numbers[ends[1] :].reshape(-1, 2)
    faces = np.frombuffer(data, _INT32, 3 * counts[3], 16 + 4 * ends[2]).reshape(-1, 3)
    return TriangleMesh(vertices, faces, texcoords, normals)


def encode_msh(mesh: TriangleMesh) -> bytes:
    """Return a mesh as MuJoCo's binary `.msh`, which `decode_msh` reads back."""
    arrays = (mesh.vertices, mesh.normals, mesh.texcoords, mesh.faces)
    head = np.array([len(a) for a in arrays], dtype="<i4").tobytes()
    kinds = ("<f4", "<f4", "<f4", "<i4")
    return head + b"".join(np.asarray(a).astype(kind).tobytes() for a, kind in zip(arrays, kinds, strict=True))


def world_sha256(record: dict[str, Any]) -> str:
    """Return the hash of a world: over its files' hashes and all else that the record says."""
    about = {k: v for k, v in record.items() if k != "world_sha256"}
    lines = {RECORD: hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest(), **record["files"]}
    text = "".join(f"{digest}  {name}\n" for name, digest in sorted(lines.items()))
    return hashlib.sha256(text.encode()).hexdigest()
