"""The label of each geom of a world: what it is, for cameras that segment and for programs that sort files."""

from __future__ import annotations

from dataclasses import dataclass

from minexplore.bundle import (
    FLOOR_CHAMFER,
    ROOF,
    WALLS,
    WATER_MATERIAL,
    GeomGroup,
    floor_geom,
    is_cover,
    is_fitting,
    smooth_mesh,
)
from pipeline.errors import ArtifactError

ROCK_LABEL, FLOOR_LABEL, ROOF_LABEL = "rock", "floor", "roof"
FLOOR_SURFACE = f"{FLOOR_LABEL}_"  # what the names of floors as they are touched begin with, of a volume
_CHAMFER_LABEL = "chamfer"  # labels have no underscore: in an OBJ they follow the last one of a name
_OF_GROUP = {GeomGroup.COLLISION: ROCK_LABEL, GeomGroup.FLOOR: FLOOR_LABEL, GeomGroup.ROOF: ROOF_LABEL}
_OF_SMOOTH = {smooth_mesh(WALLS): WALLS, smooth_mesh(ROOF): ROOF, smooth_mesh(FLOOR_CHAMFER): _CHAMFER_LABEL}


@dataclass(frozen=True)
class PieceLabel:
    """What a geom is, and for floors the zone; else `zone` is empty."""

    what: str
    zone: str = ""


def group_of(label: str) -> GeomGroup:
    """Return the geom group of a collision part's label.

    Raises
    ------
    ArtifactError
        If no collision part has this label.
    """
    for group, name in _OF_GROUP.items():
        if name == label:
            return group
    raise ArtifactError(f"label {label!r}: a collision part has {', '.join(_OF_GROUP.values())}")


def part_label(geom: str, group: int, zones: list[str]) -> PieceLabel:
    """Return the label of a collision part by its name and group; `zones` are the names of the floor zones."""
    label = _OF_GROUP[GeomGroup(group)]
    if label != FLOOR_LABEL:
        return PieceLabel(label)
    of_geom = {floor_geom(zone): zone for zone in zones}
    zone = of_geom.get(geom)
    if zone is None:
        raise ArtifactError(f"geom {geom}: the floor of no zone")
    return PieceLabel(label, zone)


def seen_label(label: str) -> str:
    """Return the label of what is seen of collision parts of a label, in a world without visible rock."""
    return WALLS if label == ROCK_LABEL else label


def surface_label(mesh: str, zones: list[str]) -> PieceLabel:
    """Return the label of a visible mesh by its name; `zones` are the names of the floor zones."""
    if is_cover(mesh):
        return PieceLabel(FLOOR_LABEL, zones[int(mesh.split("_")[1])])
    kind = mesh.partition("_")[0]
    if mesh in _OF_SMOOTH:
        return PieceLabel(_OF_SMOOTH[mesh])
    if is_fitting(mesh) or kind in (WALLS, ROOF):
        return PieceLabel(kind)
    raise ArtifactError(f"mesh {mesh}: has no label")


def water_label(zone: str) -> PieceLabel:
    """Return the label of the water in a zone's hollows."""
    return PieceLabel(WATER_MATERIAL, zone)
