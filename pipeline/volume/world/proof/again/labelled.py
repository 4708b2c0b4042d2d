"""Labels and legs of a volume's facets, made again, and parts against both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from minexplore.bundle import PARTS, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.errors import ArtifactError
from pipeline.params.validation import VolumeProofParams
from pipeline.volume.world.content import labels_by_place
from pipeline.volume.world.parts import TWINS_M, twin_corners
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.solid import labels_of

_ON_BORDER_M = 1e-3  # of zones: parts are cut to 0.1 mm
_BESIDE_M = 2.0  # that a facet is beyond its leg's sections: floors that legs share reach as far
_ASTRAY = 0.01  # share of the surface likewise: facets of several legs that lie in one plane become one of them
_SLIVERS = 2e-4  # share of the surface in slivers that have another label: in a cave of 35 km 0.9e-5
_BORDER = 1e-6  # of a slope: on the border of two labels rounding decides
_EQUALLY_M = 1e-3  # by which a leg's middle may be farther from a facet than the nearest one


def require_labelled(folder: Path, world: VolumeBundle, is_solid: bool, params: VolumeProofParams) -> None:
    """Compare labels and legs of facets with what the builder gives them, and the parts' zones with their places.

    Of a solid, whose legs follow its floors, both follow from slope and place. Of surveyed legs labels must be those
    of `labels_by_place` but for slivers, and nearly all facets must be about their legs.

    Raises
    ------
    ArtifactError
        With the file, the facet or the part, and what is wrong.
    """
    mine = world.mine
    size = np.linalg.norm(mine.normals, axis=1)
    none = np.zeros(len(size), bool)
    if is_solid:
        of_slope = _off_slope(mine, size, params.volume.steepest)
        found = (("label", of_slope, none, 0.0), ("leg", _off_leg(world), none, 0.0))
    else:
        label, is_sliver = labels_by_place(mine, world.legs)
        astray = _beyond_legs_m(world) > _BESIDE_M
        found = (("label", mine.label != label, is_sliver, _SLIVERS), ("leg", astray, astray, _ASTRAY))
    for name, wrong, excused, most in found:  # what is excused may be wrong up to a share of the surface
        some = wrong & ~excused
        if not some.any():
            some = wrong if size[wrong].sum() > most * size.sum() else some
        if some.any():
            k = int(np.where(some, size, 0).argmax())
            raise ArtifactError(
                f"{folder / VOLUME}: {name}[{k}] = {getattr(mine, name)[k]}: no facet of this slope and place has it; "
                f"{int(some.sum())} of {len(some)} are wrong"
            )
    _require_parts(folder, world)


def _off_slope(mine: VolumeFacets, size: np.ndarray, steepest: float) -> np.ndarray:
    """Return which facets (f,) have not the label of their slope, as those of solids have."""
    x, y, z = mine.normals.T / np.maximum(size, 1e-30)
    on_border = (np.abs(np.hypot(x, y) + z * steepest) < _BORDER) | (np.abs(z - np.sqrt(0.5)) < _BORDER)
    found: np.ndarray = (mine.label != labels_of(mine.vertices, mine.faces, steepest)) & ~on_border
    return found


def _off_leg(world: VolumeBundle) -> np.ndarray:
    """Return which facets (f,) are nearer to the middle of another leg than to that of their own."""
    mine = world.mine
    middles, places = _ends_m(world).mean(axis=0), mine.vertices[mine.faces].mean(axis=1)
    if int(mine.leg.max()) >= len(middles):
        return mine.leg >= len(middles)
    own = np.linalg.norm(places - middles[mine.leg], axis=1)
    found: np.ndarray = own > cKDTree(middles).query(places)[0] + _EQUALLY_M
    return found


def _ends_m(world: VolumeBundle) -> np.ndarray:
    """Return the stations (2, n, 3) m at the start and the end of each leg, as the bundle numbers legs."""
    stations = world.legs.stations_m
    return np.array([[stations[getattr(leg, end)] for leg in world.legs.legs] for end in ("start", "end")])


def _beyond_legs_m(world: VolumeBundle) -> np.ndarray:
    """Return how much farther (f,) m the nearest corner of each facet is from its leg than the leg's sections reach."""
    mine = world.mine
    ends = _ends_m(world)[:, mine.leg]
    reach = np.array([np.abs(leg.lrud_m).max() for leg in world.legs.legs])[mine.leg]
    way, apart = (ends[1] - ends[0])[:, None], mine.vertices[mine.faces] - ends[0][:, None]
    share = np.clip((apart * way).sum(axis=2) / np.maximum((way * way).sum(axis=2), _EQUALLY_M**2), 0, 1)
    found: np.ndarray = np.linalg.norm(apart - share[:, :, None] * way, axis=2).min(axis=1) - reach
    return found


def _require_parts(folder: Path, world: VolumeBundle) -> None:
    """Refuse a part with twin corners, of which MuJoCo may miss contacts, and one of the floor in two zones."""
    twins = twin_corners(world.parts)
    if len(twins):
        number = int(np.searchsorted(world.parts.first, twins[0], side="right")) - 1
        raise ArtifactError(
            f"{folder / PARTS}: part {number} has two corners within {TWINS_M:g} m, at which MuJoCo may miss contacts"
        )
    (low, high), floor = world.parts.boxes_m, world.parts.label == FacetLabel.FLOOR
    for zone in world.record.zones[:-1]:
        across = floor & (low[:, 0] < zone.east_m - _ON_BORDER_M) & (high[:, 0] > zone.east_m + _ON_BORDER_M)
        if across.any():
            raise ArtifactError(
                f"{folder / PARTS}: part {int(across.argmax())} is in two zones of the floor, which meet at x = "
                f"{zone.east_m:g} m"
            )
