"""A volume as pictures show it: its model without the collision parts, whose facets a few meshes show instead.

MuJoCo's specs take minutes for the 100,000 parts of a large cave.
"""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import mujoco
import numpy as np

from minexplore.bundle import (
    MINE_BODY,
    MODEL,
    ROCK_CLASS,
    ROOF_GEOM,
    BundleError,
    GeomGroup,
    floor_part,
    ground_material,
    is_floor,
    is_rock,
    line_of,
    rock_geom,
)
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from minexplore.looks import floor_texture
from minexplore.sealed.xml import walk_xml
from minexplore.tiles import group_by_tile, tiles_at
from minexplore.world import World

_TILE_M = 20.0  # of the meshes
_FADING, _EXPONENT = (1.0, 0.0, 0.004), 8.0  # of lamps, which a volume's model without visible rock does not state
_LEAST_M2 = 1e-9  # of a mesh: MuJoCo refuses one without an area


def shown_spec(world: World) -> mujoco.MjSpec:
    """Return the spec of a world that is one volume for pictures; nothing in it collides.

    Floors have the material of their zone. Walls and roofs are in the groups of collision parts, which pictures show
    where a world has no visible rock. Its lamps fade and cast no shadows, as those of all other worlds.

    Raises
    ------
    BundleError
        If a file has changed since the world was loaded, or MuJoCo refuses it.
    """
    assert world.volume is not None
    try:
        spec = mujoco.MjSpec.from_string(without_parts(world.read(MODEL)))
    except ValueError as error:
        raise BundleError(f"{world.folder / MODEL}: MuJoCo does not read it: {line_of(error)}") from error
    spec.modelfiledir = str(world.folder)
    for light in spec.lights:
        light.castshadow, light.attenuation, light.exponent = False, _FADING, _EXPONENT
    mine, rock, facets = spec.body(MINE_BODY), spec.find_default(ROCK_CLASS), world.volume.facets
    apart = {"contype": 0, "conaffinity": 0}
    for number, (label, zone, some) in enumerate(_pieces(world, facets)):
        if label is FacetLabel.FLOOR:
            one = world.floor_zones[zone]
            name, look = floor_part(one.name, number), {"material": ground_material(one.name), "group": GeomGroup.FLOOR}
        elif label is FacetLabel.ROOF:
            name, look = f"{ROOF_GEOM}_{number}", {"group": GeomGroup.ROOF}
        else:
            name, look = rock_geom(number), {"group": GeomGroup.COLLISION}
        _add_mesh(spec, name, facets, some)
        mine.add_geom(rock, type=mujoco.mjtGeom.mjGEOM_MESH, name=name, meshname=name, **look, **apart)
    return spec


def without_parts(model: bytes) -> str:
    """Return the text of a volume's model without the meshes and geoms of its collision parts."""
    kept = _Kept()
    walk_xml(MODEL, model, kept)
    return "".join(kept.written)


class _Kept:
    """Writes elements as they come, but those of parts: a large cave has 200,000 of these and 300 others."""

    def __init__(self) -> None:
        self.written, self._open = list[str](), list[bool]()

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Write the begin of an element."""
        name = attributes.get("name", "")
        kept = not (tag in ("mesh", "geom") and (is_floor(name) or is_rock(name)))
        self._open.append(kept)
        if kept:
            pairs = "".join(f' {key}="{escape(text)}"' for key, text in attributes.items())
            self.written.append(f"<{tag}{pairs}>")

    def end(self, tag: str) -> None:
        """Write its end."""
        if self._open.pop():
            self.written.append(f"</{tag}>")

    def text(self, text: str) -> None:
        """Leave out blanks; a model has no other text."""


def _pieces(world: World, facets: VolumeFacets) -> Iterator[tuple[FacetLabel, int, np.ndarray]]:
    """Return the facets of each label, zone and tile of the plan; only floors are parted by zones."""
    middles = facets.vertices[facets.faces].mean(axis=1)
    zones = np.where(facets.label == FacetLabel.FLOOR, world.zones_at(middles[:, 0]), 0)
    area = np.linalg.norm(facets.normals, axis=1) / 2
    for label in FacetLabel:
        own = np.flatnonzero(facets.label == label)
        for (zone, *_), rows in group_by_tile(np.column_stack([zones[own], tiles_at(middles[own, :2], _TILE_M)])):
            if area[own[rows]].sum() > _LEAST_M2:
                yield label, zone, own[rows]


def _add_mesh(spec: mujoco.MjSpec, name: str, facets: VolumeFacets, some: np.ndarray) -> None:
    """Add some facets as they are seen from the free space: each has corners and a normal of its own."""
    corners = facets.vertices[facets.faces[some]][:, ::-1].reshape(-1, 3)
    normals = -facets.normals[some]
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    faces = np.arange(len(corners)).reshape(-1, 3)
    if len(some) == 1:  # MuJoCo wants four corners
        corners, normals = np.concatenate([corners, corners[:1]]), np.concatenate([np.repeat(normals, 3, 0), normals])
    else:
        normals = np.repeat(normals, 3, axis=0)
    mesh = spec.add_mesh(name=name, uservert=corners.ravel().tolist(), usernormal=normals.ravel().tolist())
    mesh.usertexcoord = floor_texture(corners).ravel().tolist()
    mesh.userface, mesh.inertia = faces.ravel().tolist(), mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
