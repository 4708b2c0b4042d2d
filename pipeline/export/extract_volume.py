"""Read a world that is one volume into a scene: its parts as its arrays have them, and its rock or its facets."""

from __future__ import annotations

import mujoco
import numpy as np
from pydantic import TypeAdapter

from minexplore.bundle import (
    MODEL,
    ROCK_TEXTURE,
    ROOF,
    WALLS,
    BundleError,
    TriangleMesh,
    ground_material,
    has_visible_rock,
    line_of,
)
from minexplore.floors.volume_arrays import FacetLabel, VolumeArrays
from minexplore.pictures.shown import without_parts
from minexplore.world import World
from pipeline.export.extract import ROCK, facts_of, flat_mesh, light_of, material_of, surfaces_of
from pipeline.export.labels import FLOOR_LABEL, FLOOR_SURFACE, ROCK_LABEL, ROOF_LABEL
from pipeline.export.scene import ConvexPart, ExportScene, Surface, placed_part
from pipeline.volume.world.model import part_names, zone_numbers
from pipeline.volume.world.record import VolumeRecord

_LABELS = {FacetLabel.FLOOR: FLOOR_LABEL, FacetLabel.WALL: ROCK_LABEL, FacetLabel.ROOF: ROOF_LABEL}


def arrays_of(world: World) -> VolumeArrays:
    """Return the arrays of a world that is one volume."""
    assert world.volume is not None
    return world.volume


def read_volume_scene(world: World, licence: str) -> ExportScene:
    """Return the scene of a loaded world: floors as they are touched, walls and roofs as rock or else as facets.

    Raises
    ------
    BundleError
        If a file has changed since the world was loaded, or MuJoCo refuses the model.
    """
    record: VolumeRecord = TypeAdapter(VolumeRecord).validate_python(world.record)
    rock = has_visible_rock(world.record)
    try:
        spec = mujoco.MjSpec.from_string(without_parts(world.read(MODEL)))
    except ValueError as error:
        raise BundleError(f"{world.folder / MODEL}: MuJoCo does not read it: {line_of(error)}") from error
    return ExportScene(
        facts_of(record, round(record.volume.high_m - record.volume.low_m, 6), licence),
        _parts(record, arrays_of(world)),
        _floors(record, arrays_of(world)) + (surfaces_of(spec, world) if rock else _bare(arrays_of(world))),
        {material.name: material_of(material) for material in spec.materials},
        [light_of(light) for light in spec.lights],
        world.read(ROCK_TEXTURE) if rock else None,
    )


def _parts(record: VolumeRecord, arrays: VolumeArrays) -> list[ConvexPart]:
    parts = arrays.parts
    found = []
    for k, (name, zone) in enumerate(
        zip(part_names(parts, record.zones), zone_numbers(parts, record.zones).tolist(), strict=True)
    ):
        label = FacetLabel(int(parts.label[k]))
        of_zone = record.zones[zone] if label is FacetLabel.FLOOR else None
        friction = record.rock_friction if of_zone is None else of_zone.friction
        found.append(placed_part(name, _LABELS[label], "" if of_zone is None else of_zone.name, friction, parts[k]))
    return found


def _floors(record: VolumeRecord, arrays: VolumeArrays) -> list[Surface]:
    """Return the floor's facets of each zone; a facet belongs to the zone of its middle."""
    facets = arrays.facets
    floor = np.flatnonzero(facets.label == FacetLabel.FLOOR)
    east = facets.vertices[facets.faces[floor], 0].mean(axis=1)
    zones = np.searchsorted([zone.east_m for zone in record.zones[:-1]], east)
    return [
        Surface(
            f"{FLOOR_SURFACE}{k}", FLOOR_LABEL, zone.name, ground_material(zone.name), _mesh(arrays, floor[zones == k])
        )
        for k, zone in enumerate(record.zones)
        if (zones == k).any()
    ]


def _bare(arrays: VolumeArrays) -> list[Surface]:
    """Return walls and roofs of a world without visible rock."""
    found = []
    for name, label in ((WALLS, FacetLabel.WALL), (ROOF, FacetLabel.ROOF)):
        facets = np.flatnonzero(arrays.facets.label == label)
        if len(facets):
            found.append(Surface(f"{name}_0", name, "", ROCK, _mesh(arrays, facets)))
    return found


def _mesh(arrays: VolumeArrays, facets: np.ndarray) -> TriangleMesh:
    """Return facets as they are seen from the free space."""
    return flat_mesh(arrays.facets.vertices[arrays.facets.faces[facets]][:, ::-1])
