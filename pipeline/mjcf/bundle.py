"""The world bundle: `mine.xml`, its meshes, and the record `world.json`, which lists every file with its hash."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pydantic import TypeAdapter, ValidationError

from minexplore.bundle import (
    COVER_M,
    FITTINGS_BODY,
    FLOOR,
    GEOM_GROUPS,
    MADE_BY,
    MINE_BODY,
    MODEL,
    NO_OVERLAY,
    RECORD,
    SLAB_M,
    SURFACE_BODY,
    VOLUME_FORMAT,
    BundleError,
    GeomGroup,
    is_volume,
    line_of,
    rock_geom,
    smooth_mesh,
    surface_geom,
    world_sha256,
)
from minexplore.floors.floor import Floor
from minexplore.floors.folding import Folding
from minexplore.schema.files import read_bounded
from minexplore.schema.readers.json_text import read_json
from pipeline.errors import ArtifactError
from pipeline.geometry.openings.fit import filled_floor
from pipeline.geometry.openings.shaft_parts import OVER_ROOF, sheets_of_parts
from pipeline.mjcf.compiled import text_of
from pipeline.mjcf.loading import compile_spec, load_model, read_spec
from pipeline.mjcf.scene import MineScene, ZoneStrip
from pipeline.mjcf.world import build_spec
from pipeline.params.made_by import MadeBy
from pipeline.params.reading.refusals import in_own_words
from pipeline.store.codecs import decode
from pipeline.store.hashing import require_plain, sha256_bytes
from pipeline.store.verify import verify_world
from pipeline.types import Areas, Frame, Opening, Openings, Spawn

_LEVEL_M = 1e-3
Unfold = Callable[[np.ndarray], np.ndarray]  # triangles (n, 3, 3) m, into the plan


@dataclass(frozen=True)
class HeightFigures:
    """What `world.json` says of a floor with heights: lowest and highest place, steepest face, numbers of pieces.

    `roof_m` is the lowest and the highest roof over the floor; it is absent if that is `height_m` everywhere.
    """

    low_m: float
    high_m: float
    steepest_deg: float
    sheets: int
    floor_wedges: int
    roof_wedges: int
    roof_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class WorldRecord:
    """The content of `world.json`; all units are m, rad, kg and s, except where a name states another.

    `overlay` is "none" in a world without visible rock, else "rough". `heights` is absent in a flat world, `openings`
    and whether they are `fenced` in one without openings, `rough_floor` in one whose floor is level.
    """

    format: str
    name: str
    frames: dict[str, str]
    T_world_mine: list[list[float]]
    tilt_deg: float
    gain_m: dict[str, float]
    height_m: float
    world_m: tuple[float, float, float, float]
    plan_frame: Frame
    areas: Areas
    zones: list[ZoneStrip]
    rock_friction: float
    lights: int
    collision_parts: int
    loops: int
    drifts: int
    spawn: Spawn
    look: str
    overlay: str
    geom_groups: dict[str, int]
    files: dict[str, str]
    world_sha256: str
    heights: HeightFigures | None = None
    openings: list[Opening] = field(default_factory=list)
    fenced: bool = True
    rough_floor: bool = False

    @property
    def has_visible_rock(self) -> bool:
        """Return whether meshes show the rock."""
        return self.overlay != NO_OVERLAY

    @property
    def top_m(self) -> float:
        """Return how high the rock reaches in the mine frame, m."""
        if self.heights is None:
            return self.height_m
        return max((self.height_m, *(self.heights.roof_m or ()))) + (self.heights.high_m + SLAB_M)

    @property
    def bottom_m(self) -> float:
        """Return how high the lowest floor is in the mine frame, m."""
        return self.heights.low_m if self.heights else 0.0


@dataclass(frozen=True)
class OpenedBundle:
    """A bundle that was read back: record, compiled model, number of MuJoCo's warnings, and size in bytes."""

    record: WorldRecord
    model: mujoco.MjModel
    warnings: int
    bytes: int


def compile_bundle(scene: MineScene) -> tuple[dict[str, bytes], mujoco.MjModel | None]:
    """Return `mine.xml` and the meshes and textures that it names, after a check that MuJoCo compiles them.

    With visible rock, the compiled model is returned for pictures.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the world; the message is MuJoCo's.
    """
    spec = build_spec(scene)
    assets = {name: bytes(data) for name, data in spec.assets.items()}
    text = text_of(spec, Path(MODEL))
    del spec
    model = compile_spec(mujoco.MjSpec.from_string(text, assets=assets), Path(MODEL)) if assets else None
    return {MODEL: text.encode(), **assets}, model


def seal_bundle(files: dict[str, bytes], record: WorldRecord, made_by: MadeBy) -> dict[str, bytes]:
    """Add `world.json`: the record, the sha256 of each file, and the world's hash over both; and `made_by.json`."""
    fields = TypeAdapter(WorldRecord).dump_python(record, mode="json")
    if record.heights is None:
        del fields["heights"]
    elif record.heights.roof_m is None:
        del fields["heights"]["roof_m"]
    if not record.rough_floor:
        del fields["rough_floor"]
    if not record.openings:
        del fields["openings"], fields["fenced"]
    for opening in fields.get("openings", []):
        if not opening["bends_m"]:  # a plumb shaft
            del opening["bends_m"]
    fields["files"] = {name: sha256_bytes(data) for name, data in sorted(files.items())}
    fields["world_sha256"] = world_sha256(fields)
    return {**files, RECORD: _text(fields), MADE_BY: _text(made_by.model_dump(mode="json"))}


def _text(fields: dict[str, Any]) -> bytes:
    return (json.dumps(fields, indent=2, allow_nan=False) + "\n").encode()


def read_made_by(folder: Path) -> MadeBy:
    """Return what a bundle states to be made by.

    Raises
    ------
    ArtifactError
        If the file is missing, or a field is unknown, missing or out of its range.
    """
    path = folder / MADE_BY
    try:
        fields = read_json(MADE_BY, read_bounded(path, MADE_BY))
        return MadeBy.model_validate(fields)
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; an older version made this world, make it again") from None
    except BundleError as error:
        raise ArtifactError(str(error)) from error
    except OSError as error:
        raise ArtifactError(f"{path}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ascii(".".join(map(str, first["loc"])))[1:-1]  # a key is the file's text
        value = f"{where:.80} = {first['input']!r:.80}: " if where else ""
        raise ArtifactError(f"{path}: {value}{in_own_words(first)}") from error


def read_record(folder: Path, checked: bool = True) -> WorldRecord:
    """Check that a bundle holds what a world may, and read its record.

    Without `checked`, neither the tables of `minexplore.schema` nor hashes are applied; see `open_bundle`.

    Raises
    ------
    ArtifactError
        If a file is missing, changed or not allowed, or the record is invalid.
    """
    if checked:
        verify_world(folder)
    require_plain(folder / RECORD)
    try:
        data = (folder / RECORD).read_bytes()
        stated = read_json(RECORD, data)
        if isinstance(stated, dict) and is_volume(stated):
            raise ArtifactError(f"{folder}: a world of one volume ({VOLUME_FORMAT}), which this command does not read")
        return TypeAdapter(WorldRecord).validate_json(data, strict=True)
    except FileNotFoundError:
        raise ArtifactError(f"{folder / RECORD}: missing; not a world bundle") from None
    except BundleError as error:
        raise ArtifactError(f"{folder}/{error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise ArtifactError(f"{folder / RECORD}: {'.'.join(map(str, first['loc']))}: {in_own_words(first)}") from error


def open_bundle(folder: Path, checked: bool = True) -> OpenedBundle:
    """Check that a bundle holds what a world may, read its record and load its model.

    Without `checked` the tables of `minexplore.schema` are not applied: the tests of the measures behind them need
    worlds that the tables refuse.

    Raises
    ------
    ArtifactError
        If a file is missing, changed or not allowed, the record is invalid, or MuJoCo refuses the model.
    """
    record = read_record(folder, checked)
    if record.geom_groups != GEOM_GROUPS:
        raise ArtifactError(f"{folder / RECORD}: geom_groups = {record.geom_groups}, a world has {GEOM_GROUPS}")
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)
    try:
        model = load_model(folder / MODEL)
        mujoco.mj_forward(model, mujoco.MjData(model))
    except ValueError as error:
        raise ArtifactError(f"{folder / MODEL}: MuJoCo does not load it: {line_of(error)}") from error
    finally:
        mujoco.set_mju_user_warning(None)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, MINE_BODY) < 0:
        raise ArtifactError(f"{folder / MODEL}: no body of the name {MINE_BODY}, which carries the mine frame")
    size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    return OpenedBundle(record, model, len(warnings), size)


def visible_triangles(model: mujoco.MjModel, piece: str, unfold: Unfold | None = None) -> np.ndarray:
    """Return the visible triangles (n, 3, 3), m, mine frame, of a piece (walls or roof) of a compiled world.

    They belong to the rough surface, or to the smooth surface if the world has no rough one. With `unfold` they are in
    the plan.
    """
    rough = _triangles_of_geoms(model, surface_geom(piece), unfold)
    return rough if len(rough) else smooth_triangles(model, piece, unfold)


def smooth_triangles(model: mujoco.MjModel, piece: str, unfold: Unfold | None = None) -> np.ndarray:
    """Return the triangles (n, 3, 3), m, mine frame, of a piece of the smooth surface of a compiled world."""
    return _triangles_of_geoms(model, surface_geom(smooth_mesh(piece)), unfold)


def unfold_surfaces(folder: Path, record: WorldRecord) -> Unfold | None:
    """Return what moves triangles (n, 3, 3) m into the plan, or None for a flat world."""
    if record.heights is None:
        return None
    return partial(Folding(read_whole_floor(folder, record)).unfold_each, height_m=record.height_m)


def _triangles_of_geoms(model: mujoco.MjModel, prefix: str, unfold: Unfold | None) -> np.ndarray:
    geoms = [geom for geom in range(model.ngeom) if model.geom(geom).name.startswith(prefix)]
    triangles = _triangles(model, geoms)
    return triangles if unfold is None else unfold(triangles)


def geom_triangles(model: mujoco.MjModel, group: int) -> np.ndarray:
    """Return the triangles (n, 3, 3), m, mine frame, of all mesh geoms of a group of a compiled world."""
    return _triangles(model, _mesh_geoms(model, group))


def _triangles(model: mujoco.MjModel, geoms: list[int]) -> np.ndarray:
    triangles = [np.zeros((0, 3, 3))]
    for geom in geoms:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        triangles.append(_mesh_vertices(model, geom)[model.mesh_face[first : first + count]])
    return np.concatenate(triangles)


def placed_parts(model: mujoco.MjModel, group: int, T_world_mine: np.ndarray) -> list[np.ndarray]:
    """Return the vertices (n, 3), m, of every mesh or box of a group, in the mine frame that `T_world_mine` gives.

    The pose of the model's body `mine` moves them to the world, and `T_world_mine` (4, 4) moves them back. If the two
    differ, the parts are elsewhere than `part_vertices` returns them.
    """
    T = mine_from_body(model, T_world_mine)
    return [vertices @ T[:3, :3].T + T[:3, 3] for vertices in part_vertices(model, group)]


def mine_from_body(model: mujoco.MjModel, T_world_mine: np.ndarray) -> np.ndarray:
    """Return the pose (4, 4) of the model's body `mine` in the mine frame that `T_world_mine` (4, 4) gives."""
    body = model.body(MINE_BODY)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, body.quat)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), body.pos
    return np.linalg.solve(T_world_mine, pose)


def part_vertices(model: mujoco.MjModel, group: int) -> list[np.ndarray]:
    """Return the vertices (n, 3), m, of every mesh or box of a group, in the frame of the model's body `mine`."""
    boxes = np.flatnonzero((model.geom_group == group) & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)).tolist()
    return [_mesh_vertices(model, geom) for geom in _mesh_geoms(model, group)] + [_box_corners(model, g) for g in boxes]


def _box_corners(model: mujoco.MjModel, box: int) -> np.ndarray:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[box])
    corners = model.geom_size[box] * np.array(list(itertools.product((-1, 1), repeat=3)))
    return corners @ rotation.reshape(3, 3).T + model.geom_pos[box]


def _mesh_geoms(model: mujoco.MjModel, group: int) -> list[int]:
    of_group = (model.geom_group == group) & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    return np.flatnonzero(of_group).tolist()


def _mesh_vertices(model: mujoco.MjModel, geom: int) -> np.ndarray:
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    return vertices @ rotation.reshape(3, 3).T + model.geom_pos[geom]


def read_floor(folder: Path, record: WorldRecord) -> Floor:
    """Return the floor of a bundle."""
    floor: Floor = decode(folder / FLOOR, Floor) if record.heights else Floor()
    return floor


def read_whole_floor(folder: Path, record: WorldRecord) -> Floor:
    """Return the floor of a bundle with faces over its openings: visible rock is made over it."""
    return filled_floor(read_floor(folder, record), Openings(record.openings))


def model_in_plan(folder: Path, world: OpenedBundle) -> mujoco.MjModel:
    """Return the compiled model with the sheets side by side, as the plan shows them; of one sheet the model itself.

    Raises, which stand over the roof, are hidden with it, and so are shafts that lean under other places of the plan.
    """
    floor, openings = read_floor(folder, world.record), Openings(world.record.openings)
    if len(floor.offset_m) == 1 and all(o.sheet is not None and not o.bends_m for o in openings.shafts):
        return world.model
    spec, parts = read_spec(folder / MODEL), world.record.collision_parts
    sheets = sheets_of_parts(openings, world.record.fenced)
    own = {rock_geom(parts - len(sheets) + k): sheet for k, sheet in enumerate(sheets)}  # of shafts and fences
    for group, about_m in ((GeomGroup.FLOOR, 0.0), (GeomGroup.COLLISION, world.record.height_m / 2)):
        geoms = [geom for geom in spec.geoms if geom.meshname and geom.group == group]
        # A part is of the sheet of its centre of mass: `pos`, the middle of its box, may lie on a seam beside it.
        middles = np.array([world.model.geom(geom.name).pos for geom in geoms]).reshape(-1, 3)
        for geom, moved in zip(geoms, (floor.unfold(middles, about_m) - middles)[:, :2], strict=True):
            sheet = own.get(geom.name)
            if sheet == OVER_ROOF:
                geom.group = GeomGroup.ROOF
                continue
            geom.pos = [*(geom.pos[:2] + (moved if sheet is None else floor.offset_m[sheet])), geom.pos[2]]
    return compile_spec(spec, folder / MODEL)


def obstacles(model: mujoco.MjModel, T_world_mine: np.ndarray, height_m: float) -> list[np.ndarray]:
    """Return the corners (n, 3), m, of whatever can be touched or seen, whatever its name, group or body.

    They are in the mine frame that `T_world_mine` (4, 4) gives.

    Left out are the level boxes, or the wedges, that are the floor and the roof, the height fields of a rough floor,
    meshes of the surface's and the fittings' bodies that do not collide, and the level planes of puddles;
    `pipeline.proof` bounds where these may be.
    A sphere, capsule or another round shape is returned as the box around it.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mine = model.body(MINE_BODY).id
    surfaces = [body for body in range(model.nbody) if model.body(body).name in (SURFACE_BODY, FITTINGS_BODY)]
    found = []
    for geom in range(model.ngeom):
        collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        is_mesh = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
        seen_only = not collides and model.geom_bodyid[geom] in surfaces and (is_mesh or _is_puddle(model, geom))
        is_wedge = is_mesh and model.geom_group[geom] in (GeomGroup.FLOOR, GeomGroup.ROOF)
        is_floor = is_wedge or _is_slab(model, geom, mine, height_m) or _is_rough_floor(model, geom, mine)
        if seen_only or is_floor:
            continue
        own = _mesh_corners(model, geom) if is_mesh else _box_around(model, geom)
        world = own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        found.append((world - T_world_mine[:3, 3]) @ T_world_mine[:3, :3])
    return found


def _is_puddle(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether a geom is a level plane just above the floor."""
    is_plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    level = np.allclose(model.geom_quat[geom], [1, 0, 0, 0])
    return bool(is_plane and level and 0 < model.geom_pos[geom][2] <= COVER_M)


def _is_rough_floor(model: mujoco.MjModel, geom: int, mine: int) -> bool:
    """Return whether a geom is a level height field that ends as low over the floor as the visible one may."""
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_HFIELD or model.geom_bodyid[geom] != mine:
        return False
    top = model.geom_pos[geom][2] + model.hfield_size[model.geom_dataid[geom]][2]
    return bool(np.allclose(model.geom_quat[geom], [1, 0, 0, 0]) and top <= COVER_M + _LEVEL_M)


def _is_slab(model: mujoco.MjModel, geom: int, mine: int, height_m: float) -> bool:
    """Return whether a geom is a level box below the floor's level or above the roof's."""
    is_box = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX and model.geom_bodyid[geom] == mine
    level = np.allclose(model.geom_quat[geom], [1, 0, 0, 0])
    middle, half = model.geom_pos[geom][2], model.geom_size[geom][2]
    return bool(is_box and level and (middle + half < _LEVEL_M or middle - half > height_m - _LEVEL_M))


def _mesh_corners(model: mujoco.MjModel, geom: int) -> np.ndarray:
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return model.mesh_vert[start : start + count].astype(np.float64)


def _box_around(model: mujoco.MjModel, geom: int) -> np.ndarray:
    middle, half = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
    return middle + half * np.array(list(itertools.product((-1, 1), repeat=3)))
