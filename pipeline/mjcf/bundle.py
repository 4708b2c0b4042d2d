"""The world bundle: `mine.xml`, its meshes, and the record `world.json`, which lists every file with its hash."""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pydantic import ValidationError

from minesurveys.refusals import in_own_words
from minexplore.bundle import (
    COVER_M,
    FITTINGS_BODY,
    GEOM_GROUPS,
    MADE_BY,
    MINE_BODY,
    MODEL,
    NO_OVERLAY,
    RECORD,
    SURFACE_BODY,
    VOLUME_FORMAT,
    BundleError,
    is_volume,
    line_of,
    world_sha256,
)
from minexplore.sealed.files import read_bounded
from minexplore.sealed.json_text import read_json
from pipeline.errors import ArtifactError
from pipeline.mjcf.loading import read_spec, text_of
from pipeline.mjcf.scene import MineScene, ZoneStrip
from pipeline.mjcf.visible import Visible, compile_visible, compile_with
from pipeline.mjcf.world import build_spec
from pipeline.params.made_by import MadeBy
from pipeline.store.files import adapter_of
from pipeline.store.hashing import require_plain, sha256_bytes
from pipeline.store.verify import verify_world
from pipeline.types import Areas, Frame, Spawn

_LEVEL_M = 1e-3


@dataclass(frozen=True)
class WorldRecord:
    """The content of `world.json`; all units are m, rad, kg and s, except where a name states another.

    `overlay` is "none" in a world without visible rock, else "rough". `rough_floor` is absent in one
    whose floor is level.
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
    rough_floor: bool = False

    @property
    def has_visible_rock(self) -> bool:
        """Return whether meshes show the rock."""
        return self.overlay != NO_OVERLAY

    @property
    def top_m(self) -> float:
        """Return how high the rock reaches in the mine frame, m."""
        return self.height_m


@dataclass(frozen=True)
class OpenedBundle:
    """A bundle that was read back: record, compiled model, visible meshes, MuJoCo's warnings, and size in bytes.

    The visible meshes of `model` are hidden tetrahedra: `visible` has them, and `load_model` compiles them all.
    """

    record: WorldRecord
    model: mujoco.MjModel
    visible: Visible
    warnings: int
    bytes: int


def compile_bundle(scene: MineScene) -> tuple[dict[str, bytes], mujoco.MjSpec | None]:
    """Return `mine.xml` and the meshes and textures that it names.

    With visible rock, the specification that the text and the files give is returned for pictures.

    Raises
    ------
    ArtifactError
        If MuJoCo refuses the world; the message is MuJoCo's.
    """
    spec = build_spec(scene)
    assets = {name: bytes(data) for name, data in spec.assets.items()}
    text = text_of(spec, Path(MODEL))
    return {MODEL: text.encode(), **assets}, mujoco.MjSpec.from_string(text, assets=assets) if assets else None


def seal_bundle(files: dict[str, bytes], record: WorldRecord, made_by: MadeBy) -> dict[str, bytes]:
    """Add `world.json`: the record, the sha256 of each file, and the world's hash over both; and `made_by.json`."""
    fields = adapter_of(WorldRecord).dump_python(record, mode="json")
    if not record.rough_floor:
        del fields["rough_floor"]
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

    Without `checked`, neither the tables of `pipeline.schema` nor hashes are applied; see `open_bundle`.

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
        return adapter_of(WorldRecord).validate_json(data, strict=True)
    except FileNotFoundError:
        raise ArtifactError(f"{folder / RECORD}: missing; not a world bundle") from None
    except BundleError as error:
        raise ArtifactError(f"{folder}/{error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise ArtifactError(f"{folder / RECORD}: {'.'.join(map(str, first['loc']))}: {in_own_words(first)}") from error


def open_bundle(folder: Path, checked: bool = True) -> OpenedBundle:
    """Check that a bundle holds what a world may, read its record and load its model.

    Without `checked` the tables of `pipeline.schema` are not applied: the tests of the measures behind them need
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
        spec = read_spec(folder / MODEL)
        visible = compile_visible(spec, folder / MODEL)
        model = compile_with(spec, folder / MODEL)
        mujoco.mj_forward(model, mujoco.MjData(model))
    except ValueError as error:
        raise ArtifactError(f"{folder / MODEL}: MuJoCo does not load it: {line_of(error)}") from error
    finally:
        mujoco.set_mju_user_warning(None)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, MINE_BODY) < 0:
        raise ArtifactError(f"{folder / MODEL}: no body of the name {MINE_BODY}, which carries the mine frame")
    size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    return OpenedBundle(record, model, visible, len(warnings), size)


def geom_triangles(model: mujoco.MjModel, group: int) -> np.ndarray:
    """Return the triangles (n, 3, 3), m, mine frame, of all mesh geoms of a group of a compiled world."""
    triangles = [np.zeros((0, 3, 3))]
    for geom in _mesh_geoms(model, group):
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


def obstacles(model: mujoco.MjModel, T_world_mine: np.ndarray, height_m: float) -> list[np.ndarray]:
    """Return the corners (n, 3), m, of whatever can be touched or seen, whatever its name, group or body.

    They are in the mine frame that `T_world_mine` (4, 4) gives.

    Left out are the level boxes that are the floor and the roof, the height fields of a rough floor,
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
        is_floor = _is_slab(model, geom, mine, height_m) or _is_rough_floor(model, geom, mine)
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
