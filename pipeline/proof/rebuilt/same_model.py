"""Build a world's model again from its record, outline and meshes, and compare the compiled models field by field."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from shapely import Polygon

from minexplore.bundle import (
    COVER_M,
    HFIELDS,
    MESHES,
    MODEL,
    RECORD,
    ROCK_TEXTURE,
    ROOF_GEOM,
    SMOOTH_MESHES,
    TOPOLOGY,
    is_fitting,
    is_rock,
    line_of,
    puddle_geom,
    rock_geom,
    shade_geom,
    smooth_mesh,
)
from minexplore.looks import SHADE_LEVELS
from minexplore.physics.local_models import part_vertices
from minexplore.sealed.files import read_folder
from pipeline.errors import ArtifactError
from pipeline.mjcf.assemble import heading_at
from pipeline.mjcf.bundle import WorldRecord
from pipeline.mjcf.loading import read_spec, text_of
from pipeline.mjcf.scene import ALONG, MineScene, SpotLight, level_lines, tilt_about_centre
from pipeline.mjcf.world import build_spec
from pipeline.proof.rebuilt.lights import remake_lights
from pipeline.proof.rebuilt.prisms import require_prisms
from pipeline.store.codecs import decode
from pipeline.types import ConvexParts, DriftNetwork, Image, Mesh, SolidExtent

_MARGIN = 1e-9  # relative and absolute: the text of a model has 16 digits
_LIGHT_OFF_M = 0.02  # along the drift: places have three decimals, and rounding adds up over a line
_LIGHT_TURNED = 0.05  # of the direction: it follows from two places 4 m apart
_LEVELS = 1  # of 255: another processor may round the other way
_SHOWN = ("geom_", "light_", "mat_")  # fields that say most come first: others follow from them
_PLACE_M = 2e-4  # centres have four decimals
_THINNEST_M = 0.05  # of floor and roof: a robot must not pass through them in one step
# Where files lie, a checksum of the sources, and the trees that speed up collisions, which follow from the rest.
_UNREAD = re.compile(r"signature|paths|.*_pathadr|bvh_.*|.*_bvhadr|.*_bvhnum|npaths|nbvh.*|nbuffer")


def require_same_model(
    folder: Path, record: WorldRecord, free: Polygon, prisms: bool = True, tile_m: float | None = None
) -> None:
    """Compare the compiled model with the one that the builder makes of the bundle's own parts.

    With `prisms`, the collision parts must be prisms on the corners of the outline, cut into tiles of at most `tile_m`;
    the parts of other methods are left
    to the certificate. Taken from the model are these, the thickness of the floor, and height, pitch, cut-off angle and
    distance of the lights. All else follows from `world.json`, the network, and the builder.

    Raises
    ------
    ArtifactError
        With the field of the compiled model, the element, the value and what it should be.
    """
    files, stated = read_folder(folder), read_spec(folder / MODEL)
    _require_parts(folder, record, stated)
    if prisms:
        require_prisms(folder, record, stated, free, tile_m)
    spec = _rebuilt(folder, record, files, stated)
    assets = {name: data for name, data in files.items() if name.startswith((MESHES, HFIELDS)) or name == ROCK_TEXTURE}
    _require_fields(folder, files, spec)
    if stated.compiler.degree:  # as without a statement
        raise ArtifactError(f"{folder / MODEL}: compiler: want angle = radian")
    text = text_of(spec, folder / MODEL)
    if text.encode() == files[MODEL]:  # then the compiled models are equal too
        return
    try:
        made, own = (mujoco.MjModel.from_xml_string(t, assets) for t in (text, files[MODEL].decode()))
    except ValueError as error:
        raise ArtifactError(f"{folder / MODEL}: MuJoCo does not compile it: {line_of(error)}") from error
    differs = _other_element(stated, spec) or model_difference(own, made)
    if differs:
        raise ArtifactError(f"{folder / MODEL}: {differs}, as the builder makes it")


def _require_parts(folder: Path, record: WorldRecord, stated: mujoco.MjSpec) -> None:
    """Refuse a model whose collision parts are not as many as recorded, each with its own mesh, or that has no roof."""
    names = [geom.name for geom in stated.geoms if is_rock(geom.name)]
    wanted = [rock_geom(number) for number in range(record.collision_parts)]
    if names != wanted:
        raise ArtifactError(f"{folder / MODEL}: {len(names)} collision parts, want rock_0000 to {wanted[-1]} in order")
    shaped = {mesh.name for mesh in stated.meshes if len(mesh.uservert) and len(mesh.uservert) % 3 == 0}
    for name in names:
        if name not in shaped or stated.geom(name).meshname != name:
            raise ArtifactError(f"{folder / MODEL}: geom {name}: want a mesh of its name with vertices")
    roof = next((geom for geom in stated.geoms if geom.name == ROOF_GEOM), None)
    if roof is None or not 2 * roof.size[2] >= _THINNEST_M:
        thick = "missing" if roof is None else f"{2 * roof.size[2]:g} m thick"
        raise ArtifactError(f"{folder / MODEL}: geom {ROOF_GEOM}: {thick}, want {_THINNEST_M} m")


def _lights(folder: Path, record: WorldRecord, stated: mujoco.MjSpec, network: DriftNetwork) -> list[SpotLight]:
    """Return the lights as the builder places them along the main drift or all drifts, as many as the record has."""
    lights = [
        SpotLight(tuple(light.pos.tolist()), tuple(light.dir.tolist()), float(light.cutoff)) for light in stated.lights
    ]
    if len(lights) != record.lights:
        raise ArtifactError(f"{folder / MODEL}: {len(lights)} lights, {RECORD} has {record.lights}")
    lines = (level_lines(network, along) for along in ALONG)
    return remake_lights(folder / MODEL, lights, lines, _LIGHT_OFF_M, _LIGHT_TURNED)


def _rebuilt(folder: Path, record: WorldRecord, files: Mapping[str, bytes], stated: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return the specification of the world that the builder makes of the bundle's parts."""
    network: DriftNetwork = decode(folder / TOPOLOGY, DriftNetwork)
    rock = [geom for geom in stated.geoms if is_rock(geom.name)]
    vertices = [part_vertices(stated, geom) for geom in rock]
    offsets = np.concatenate([[0], np.cumsum([len(v) for v in vertices])]).astype(np.int32)
    placed = np.concatenate([v + geom.pos for v, geom in zip(vertices, rock, strict=True)])
    meshes = {Path(name).stem: data for name, data in files.items() if name.startswith(MESHES)}
    chunks = {name: data for name, data in meshes.items() if name not in SMOOTH_MESHES}
    named = {geom.name: geom for geom in stated.geoms}
    lowest = named.get(shade_geom(0))
    water_m = float(lowest.pos[2]) / SHADE_LEVELS[0] if lowest else 0.0
    if lowest and not 0 < water_m <= COVER_M:
        raise ArtifactError(f"{folder / MODEL}: water at {water_m:g} m, want a height of at most {COVER_M:g} m")
    scene = MineScene(
        name=record.name,
        extent=SolidExtent(record.height_m, record.world_m),
        parts=ConvexParts(placed, offsets),
        rock_friction=record.rock_friction,
        floor_thickness_m=2 * float(stated.geom(ROOF_GEOM).size[2]),
        zones=record.zones,
        lights=_lights(folder, record, stated, network),
        smooth=_smooth(record),
        rough={f"{name}.msh": data for name, data in chunks.items() if not is_fitting(name)},
        texture=files.get(ROCK_TEXTURE, b""),
        anchor_m=record.spawn.anchor_m,
        heading_rad=heading_at(network, record.spawn.anchor_m),
        T_world_mine=tilt_about_centre(record.tilt_deg, record.world_m),
        look=record.look,
        fittings={f"{name}.msh": chunks[name] for name in sorted(chunks) if is_fitting(name)},
        puddles=tuple(zone.name for zone in record.zones if puddle_geom(zone.name) in named),
        water_m=water_m,
        is_rough=record.rough_floor,
    )
    spec = build_spec(scene)
    for geom, own, was in zip((g for g in spec.geoms if is_rock(g.name)), vertices, rock, strict=True):
        # MuJoCo stores vertices in 32 bits, so a centre may round to the next digit; it is compared and then replaced.
        if np.abs(geom.pos - was.pos).max() > _PLACE_M:
            raise ArtifactError(
                f"{folder / MODEL}: geom {was.name}: pos = {was.pos}, want its mesh's middle {geom.pos}"
            )
        geom.pos = was.pos
        spec.mesh(geom.meshname).uservert = own.ravel().tolist()
    return spec


def _other_element(stated: mujoco.MjSpec, made: mujoco.MjSpec) -> str | None:
    """Return the first element, by its name, that one of two specifications has alone, or None."""
    for kind in ("bodies", "geoms", "meshes", "materials", "textures", "hfields", "lights", "cameras"):
        one, two = ({element.name for element in getattr(spec, kind)} for spec in (stated, made))
        if one != two:
            name = min(one ^ two)
            return f"{kind}: {name!r} is {'missing' if name in two else 'one too many'}"
    return None


def _require_fields(folder: Path, files: Mapping[str, bytes], made: mujoco.MjSpec) -> None:
    """Compare the pictures of a rough floor with those that the visible floor gives."""
    stated_names, wanted_names = ({name for name in some if name.startswith(HFIELDS)} for some in (files, made.assets))
    if stated_names != wanted_names:
        odd = min(stated_names ^ wanted_names)
        raise ArtifactError(
            f"{folder / odd}: {'no picture of a' if odd in stated_names else 'missing from the'} rough floor"
        )
    for name, data in made.assets.items():
        if name.startswith(HFIELDS):
            stated: Image = decode(folder / name, Image)
            wanted = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
            if stated.shape != wanted.shape or np.abs(stated.astype(int) - wanted).max() > _LEVELS:
                raise ArtifactError(f"{folder / name}: not the heights of the visible floor")


def _smooth(record: WorldRecord) -> dict[str, Mesh]:
    """Return empty pieces of the smooth surface of a world with visible rock; their bytes are replaced later."""
    nothing = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 2)))
    return {name.removeprefix(smooth_mesh("")): nothing for name in sorted(SMOOTH_MESHES) if record.has_visible_rock}


def model_difference(found: mujoco.MjModel, wanted: mujoco.MjModel, margin: float = _MARGIN) -> str | None:
    """Return the first field in which two compiled models differ, with element and values, or None.

    Numbers are equal if they differ by at most `margin`, plus `margin` times their size.
    """
    for name in sorted(dir(wanted), key=lambda name: (not name.startswith(_SHOWN), name)):
        if name.startswith("_") or _UNREAD.fullmatch(name):
            continue
        differs = _difference(name, getattr(found, name), getattr(wanted, name), wanted, margin)
        if differs:
            return differs
    return None


def _difference(name: str, one: Any, two: Any, model: mujoco.MjModel, margin: float) -> str | None:
    if callable(two):
        return None
    if isinstance(two, np.ndarray):
        if one.shape != two.shape:
            return f"{name} has shape {one.shape}, want {two.shape}"
        exact = not np.issubdtype(two.dtype, np.floating)
        wrong = np.flatnonzero(one != two) if exact else _apart(one, two, margin)
        if not len(wrong):
            return None
        at = np.unravel_index(int(wrong[0]), two.shape)
        return f"{_element(name, int(at[0]), model)}{name}[{', '.join(map(str, at))}] = {one[at]}, want {two[at]}"
    if isinstance(two, bool | int | str | bytes):
        return None if one == two else f"{name} = {str(one)[:60]}, want {str(two)[:60]}"
    if isinstance(two, float):
        return None if math.isclose(one, two, rel_tol=margin, abs_tol=margin) else f"{name} = {one}, want {two}"
    for inner in sorted(dir(two)):  # options, statistics and visual settings are records of their own
        if not inner.startswith("_"):
            differs = _difference(f"{name}.{inner}", getattr(one, inner), getattr(two, inner), model, margin)
            if differs:
                return differs
    return None


def _apart(one: np.ndarray, two: np.ndarray, margin: float) -> np.ndarray:
    """Return the flat indices at which two arrays differ; NaN in one only is a difference."""
    return np.flatnonzero(~np.isclose(one, two, rtol=margin, atol=margin, equal_nan=True))


def _element(field: str, number: int, model: mujoco.MjModel) -> str:
    """Return the name of the element that a row of a field belongs to, and a colon."""
    accessor = {"geom": model.geom, "body": model.body, "mesh": model.mesh, "light": model.light, "cam": model.camera}
    kind = field.partition("_")[0]
    counts = {"geom": model.ngeom, "body": model.nbody, "mesh": model.nmesh, "light": model.nlight, "cam": model.ncam}
    if kind not in accessor or number >= counts[kind]:
        return ""
    return f"{kind} {accessor[kind](number).name}: "
