"""Labels and legs of a volume's facets, made again, and parts against both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from minexplore.bundle import PARTS, VOLUME
from minexplore.floors.volume_arrays import FacetLabel, VolumeFacets
from pipeline.errors import ArtifactError
from pipeline.params.validation import VolumeProofParams
from pipeline.volume.union import STEEPEST
from pipeline.volume.world.parts import TWINS_M, twin_corners
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.solid import labels_of

_ON_BORDER_M = 1e-3  # of zones: parts are cut to 0.1 mm
_BESIDE_M = 2.0  # that a facet is beyond its leg's sections: floors that legs share reach as far
_ASTRAY = 0.01  # share of the surface likewise: facets of several legs that lie in one plane become one of them
_SLIVERS = 2e-4  # share of the surface in slivers that may have any label: in a cave of 7.5 km 0.6e-4
_THIN_M = 0.1  # of a sliver beside a floor: its height over its longest side; in that cave 0.05 at most
_THIN_ROOF_M = 0.02  # between wall and roof; in that cave 0.008
_ROOF_NZ, _NEAR_NZ = 0.7, 0.05  # upward part of a roof's normal; facets so near to it move when the mesh is simplified
_FLOOR_NZ = -0.3  # of a facet of a leg to drive on that must be floor; slabs have floors that are steeper
_LEDGE_M = 0.1  # over a leg's floor, where walls may face up: what was seen from stations begins 0.15 m over it
_BEYOND_M = 0.25  # beside a leg's floor and its ends, likewise; what was seen begins 0.3 m beside it, on no other floor
_BORDER = 1e-6  # of a slope: on the border of two labels rounding decides
_EQUALLY_M = 1e-3  # by which a leg's middle may be farther from a facet than the nearest one


def require_labelled(folder: Path, world: VolumeBundle, is_solid: bool, params: VolumeProofParams) -> None:
    """Compare labels and legs of facets with what the builder gives them, and the parts' zones with their places.

    Of a solid, whose legs follow its floors, both follow from slope and place. Of surveyed legs a floor is on a leg to
    drive on and faces down, what faces up on no floor is roof and the rest is wall, also ledges over and beside floors,
    but for slivers; nearly all facets must be about their legs.

    Raises
    ------
    ArtifactError
        With the file, the facet or the part, and what is wrong.
    """
    mine = world.mine
    size = np.linalg.norm(mine.normals, axis=1)
    if not is_solid:
        wrong, thin = _of_legs(world, size)
        astray = _beyond_legs_m(world) > _BESIDE_M
        found = (("label", wrong, thin, _SLIVERS), ("leg", astray, astray, _ASTRAY))
    else:
        none = np.zeros(len(size), bool)
        of_slope = _off_slope(mine, size, params.volume.steepest)
        found = (("label", of_slope, none, 0.0), ("leg", _off_leg(world), none, 0.0))
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


def _of_legs(world: VolumeBundle, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which facets (f,) have not the label that facets of surveyed legs have, and which of those are slivers."""
    mine = world.mine
    up = mine.normals[:, 2] / np.maximum(size, 1e-30)
    corners = mine.vertices[mine.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    height_m = size / np.maximum(longest, 1e-30)
    flat = np.array([leg.grade <= STEEPEST for leg in world.legs.legs])[mine.leg]
    floor, roof = mine.label == FacetLabel.FLOOR, mine.label == FacetLabel.ROOF
    facing = ~floor & flat & (up < _FLOOR_NZ)
    of_floor = (floor & ((up >= 0) | ~flat)) | (facing & ~_off_floor(world, facing))
    of_roof = ~floor & ((up > _ROOF_NZ) != roof)
    thin = np.where(of_floor, height_m < _THIN_M, (height_m < _THIN_ROOF_M) | (np.abs(up - _ROOF_NZ) < _NEAR_NZ))
    return of_floor | of_roof, thin


def _off_floor(world: VolumeBundle, some: np.ndarray) -> np.ndarray:
    """Return which of some facets (f,) are well over the floor of their leg, or beyond it and on that of no other.

    Splays widen walls there.
    """
    mine, legs = world.mine, world.legs.legs
    ends = np.array([[world.legs.stations_m[name] for name in (leg.start, leg.end)] for leg in legs])
    lrud = np.array([leg.lrud_m for leg in legs])
    numbers = np.flatnonzero(some)
    places, own = mine.vertices[mine.faces[numbers]].mean(axis=1), mine.leg[numbers]
    over, beyond = _from_floor_m(ends[own], lrud[own], places)
    off = (over > _LEDGE_M) | (beyond > _BEYOND_M)
    for k in np.flatnonzero([leg.grade <= STEEPEST for leg in legs]).tolist() if off.any() else ():
        over, beyond = _from_floor_m(ends[k], lrud[k], places)
        off &= (np.abs(over) > _LEDGE_M) | (beyond > 0)
    found = np.zeros(len(some), bool)
    found[numbers] = off
    return found


def _from_floor_m(ends: np.ndarray, lrud: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (n,) m places (n, 3) m are over floors of legs, and beyond their walls and ends in plan.

    Legs have ends (n, 2, 3) m and distances to walls, roof and floor (n, 2, 4) m, or one leg (2, 3) and (2, 4).
    """
    start, end = np.moveaxis(ends - lrud[..., 3:] * [0, 0, 1.0], -2, 0)
    way, apart = end - start, places - start
    run = np.maximum(np.linalg.norm(way[..., :2], axis=-1), _EQUALLY_M)
    along = (apart * way)[..., :2].sum(axis=-1) / run
    left = (way[..., 0] * apart[..., 1] - way[..., 1] * apart[..., 0]) / run
    share = np.clip(along / run, 0, 1)
    first, last = np.moveaxis(lrud[..., :2], -2, 0)
    walls = first + share[..., None] * (last - first)
    aside = np.abs(left) - np.where(left < 0, walls[..., 1], walls[..., 0])
    return apart[..., 2] - share * way[..., 2], np.maximum(aside, np.abs(along - run / 2) - run / 2)


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
