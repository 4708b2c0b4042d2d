"""The visible rock of a volume over a level floor, where the measures of a level mine's rock apply.

Storeys stand side by side in the plan, and heights are those over the floor. Such a shear keeps plumb walls plumb and
planes planes. Rock of shafts, and of legs that are too steep to drive on, has no such floor and is left out.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely import MultiPolygon, Polygon

from minexplore.bundle import ROOF, WALLS
from minexplore.floors.volume_arrays import FacetLabel, FloorSpans, VolumeFacets
from pipeline.geometry.nearest_facets import NearestFacets
from pipeline.metrics.rock.relief import Relief
from pipeline.metrics.rock.sampling import unit_normals
from pipeline.params.validation import TextureReportParams
from pipeline.proof.groups import JUDGED_HEIGHT_M
from pipeline.proof.surface import Drifts, SeenRock, report_relief, split_long
from pipeline.proof.texture import TextureReport, part_of, report_texture, texture_metrics
from pipeline.volume.union import STEEPEST
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.topology import LegNetwork

_SPACING_M = 1.0  # of stations
_ASIDE_M = 2.0  # from a station's walls in the plan: rock farther away is of other workings
_ON_FLOOR_M = 1.0  # from a station to the span of its storey
_APART_M = 20.0  # of storeys: farther than a stretch of rock reaches
_JOINED_M = 1e-4  # floors so near are one
_ROOF_M = 3.5  # over the floor: of the default mine, for which validation.texture.roof_z_m is
_SHARE = 2  # of a level mine's stretches half are in each draw, and of its draws half: all would take 1.2 s more a draw
_HEIGHTS_M = {WALLS: (0.0, _ROOF_M), ROOF: (2.5, 4.5)}  # more would thin the points out
_LONGEST_M = 3.0  # of a facet's sides: the nearest station moves it
_LEANS = 0.1  # height of a plumb wall's normal
_LABELS = {WALLS: FacetLabel.WALL, ROOF: FacetLabel.ROOF}
_LEFT, _RIGHT, _UP, _DOWN = range(4)


@dataclass(frozen=True)
class VolumeTexture:
    """The texture and the relief of a volume's rock, what its storeys' floors cover side by side, and drifts judged.

    `drift_m` is the length of the drifts that are high enough to be judged.
    """

    texture: TextureReport
    relief: Relief
    floors: Polygon | MultiPolygon
    drift_m: float

    @property
    def metrics(self) -> dict[str, Any]:
        """Return the figures for `metrics.json`, by group as those of a level mine."""
        groups = {"texture": texture_metrics(self.texture), "relief": dataclasses.asdict(self.relief)}
        return {**groups, "topology": {"drift_m": self.drift_m}}


@dataclass(frozen=True)
class _Stations:
    """Stations along the legs that robots can drive on, each on the floor of a storey.

    Attributes
    ----------
    floor_m : (n, 3) float64, m, mine frame
    rise : (n, 2) float64
        What floor and roof of the leg rise a metre east and north.
    half_width_m, height_m : (n,) float64
    length_m : (n,) float64
        Of the leg that is a station's.
    storey : (n,) int
    """

    floor_m: np.ndarray
    rise: np.ndarray
    half_width_m: np.ndarray
    height_m: np.ndarray
    length_m: np.ndarray
    storey: np.ndarray

    @property
    def shift_m(self) -> np.ndarray:
        """Return how far east (n,) m the storey of each station moves, so that storeys stand side by side."""
        found, end = np.zeros(len(self.storey)), -np.inf
        for storey in np.unique(self.storey):
            own = self.storey == storey
            aside = float(self.half_width_m[own].max()) + _ASIDE_M
            west, east = self.floor_m[own, 0].min() - aside, self.floor_m[own, 0].max() + aside
            shift = max(0.0, end + _APART_M - west)
            found[own], end = shift, east + shift
        return found


class _Level:
    """What moves the rock about some stations over a level floor."""

    def __init__(self, stations: _Stations) -> None:
        self.stations, self._shift_m = stations, stations.shift_m
        self._tree = cKDTree(stations.floor_m + _up(stations.height_m / 2))

    @property
    def stations_m(self) -> np.ndarray:
        """Return the stations (n, 2) m in the plan."""
        return self.stations.floor_m[:, :2] + np.column_stack([self._shift_m, np.zeros(len(self._shift_m))])

    def move(self, corners: np.ndarray, faces: np.ndarray, piece: str | None = None) -> np.ndarray:
        """Return the triangles (k, 3, 3) m of faces (f, 3) between corners (n, 3) m that are about the stations.

        Heights are over the floor; those of the roof are moved so that the passage is 3.5 m high. Of a `piece`
        of the rock, walls or roof, only what a level mine has as high is returned.
        """
        own = self.stations
        _, at = self._tree.query(corners)
        apart = corners[:, :2] - own.floor_m[at, :2]
        from_m = own.floor_m[at, 2] + (own.rise[at] * apart).sum(axis=1)
        if piece == ROOF:
            from_m += own.height_m[at] - _ROOF_M
        storey = np.where(np.linalg.norm(apart, axis=1) <= own.half_width_m[at] + _ASIDE_M, own.storey[at], -1)
        moved = np.column_stack([corners[:, 0] + self._shift_m[at], corners[:, 1], corners[:, 2] - from_m])
        faces = faces[(storey[faces[:, 0]] >= 0) & (storey[faces] == storey[faces[:, :1]]).all(axis=1)]
        if piece is not None:
            low, high = _HEIGHTS_M[piece]
            z = moved[faces, 2]
            faces = faces[(z.max(axis=1) > low) & (z.min(axis=1) < high)]
        found: np.ndarray = moved[faces]
        return found


def measure_volume_texture(world: VolumeBundle, params: TextureReportParams) -> VolumeTexture | None:
    """Measure the visible rock of a volume as that of a level mine; None without rock, or without drifts."""
    rock = level_rock_of(world) if world.rock else None
    if rock is None:
        return None
    draws = int(min(params.draws, max(1.0, rock.drifts.length_m // (_SHARE * params.draw_m))))
    few = part_of(params, _SHARE).model_copy(update={"draws": draws})
    texture, relief = report_texture(rock, few), report_relief(rock, few.stretches)
    return VolumeTexture(texture, relief, rock.drifts.free, rock.drifts.length_m)


def level_rock_of(world: VolumeBundle) -> SeenRock | None:
    """Return the visible rock of a volume over a level floor; None if robots have no drift with walls and a roof."""
    stations = _stations_of(world.legs, world.cells)
    if not len(stations.storey):
        return None
    level = _Level(stations)

    @cache  # the texture and the relief take the same
    def rough(piece: str) -> np.ndarray:
        some = [mesh for name, mesh in world.rock.items() if name.startswith(piece)]
        moved = [level.move(mesh.vertices, mesh.faces, piece) for mesh in some]
        return np.concatenate([np.zeros((0, 3, 3)), *moved])

    @cache
    def smooth(piece: str) -> np.ndarray:
        return _facets(level, world.mine, world.mine.label == _LABELS[piece], piece)

    def plumb() -> tuple[np.ndarray, np.ndarray]:
        facets = _facets(level, world.mine, world.mine.label != FacetLabel.FLOOR, WALLS)
        normals, walls = unit_normals(facets), rough(WALLS)
        nearest = NearestFacets.of(facets).query(walls.mean(axis=1)).facet
        upright = np.abs(normals[nearest, 2]) < _LEANS
        return walls[upright], normals[nearest[upright]]

    floors = _facets(level, world.mine, world.mine.label == FacetLabel.FLOOR)
    if not all(map(len, (floors, rough(WALLS), rough(ROOF), smooth(WALLS), smooth(ROOF)))):
        return None
    high_m = round(float(stations.length_m[stations.height_m >= JUDGED_HEIGHT_M].sum()), 1)
    drifts = Drifts(_covered(floors), level.stations_m, stations.half_width_m, high_m)
    return SeenRock(rough, smooth, drifts, plumb)


def _facets(level: _Level, volume: VolumeFacets, some: np.ndarray, piece: str | None = None) -> np.ndarray:
    """Return some facets (f,) over a level floor, in pieces of `_LONGEST_M`; they face the workings."""
    corners = split_long(volume.vertices[volume.faces[some]][:, ::-1], _LONGEST_M).reshape(-1, 3)
    return level.move(corners, np.arange(len(corners)).reshape(-1, 3), piece)


def _stations_of(legs: LegNetwork, cells: FloorSpans) -> _Stations:
    """Return stations a metre apart along the legs that robots can drive on, as far as these have a storey."""
    rows = [np.zeros((0, 8))]
    for leg in legs.legs:
        lrud = np.array(leg.lrud_m)
        start, end = np.array([legs.stations_m[leg.start], legs.stations_m[leg.end]]) - _up(lrud[:, _DOWN])
        way = end - start
        if leg.grade > STEEPEST or not way[:2].any():
            continue
        size = np.column_stack([lrud[:, :_UP].mean(axis=1), lrud[:, _UP:].sum(axis=1)])
        count = max(1, round(leg.length_m / _SPACING_M))
        share = (np.arange(count)[:, None] + 0.5) / count
        rise = np.broadcast_to(way[:2] * way[2] / (way[:2] @ way[:2]), (count, 2))
        length_m = np.full((count, 1), leg.length_m / count)
        rows.append(np.hstack([start + share * way, rise, size[0] + share * (size[1] - size[0]), length_m]))
    found, used = np.concatenate(rows), np.flatnonzero(cells.storey >= 0)
    storey = np.zeros(0, int)
    if len(found) and len(used):
        away, nearest = cKDTree(cells.places_m[used]).query(found[:, :3])
        found, storey = found[away <= _ON_FLOOR_M], cells.storey[used[nearest]][away <= _ON_FLOOR_M]
    half_width_m, height_m, length_m = found[: len(storey), 5:].T
    return _Stations(found[: len(storey), :3], found[: len(storey), 3:5], half_width_m, height_m, length_m, storey)


def _covered(floors: np.ndarray) -> Polygon | MultiPolygon:
    """Return what floors (n, 3, 3) m cover in the plan."""
    found = shapely.union_all(shapely.polygons(floors[:, :, :2]))
    return found.buffer(_JOINED_M, join_style="mitre").buffer(-_JOINED_M, join_style="mitre")


def _up(heights_m: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros((len(heights_m), 2)), heights_m])
