"""What a volume's record says of its plan: the areas and the frame of its view from above, made again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import RECORD, TOPOLOGY, line_of
from pipeline.errors import ArtifactError
from pipeline.geometry.outline.outer_walls import count_islands, filled
from pipeline.proof.rebuilt.differences import first_difference
from pipeline.survey.whole_survey import seen_from_above
from pipeline.types import Areas, Frame, SurveyedLegs
from pipeline.volume.world.proof.certificate import VolumeBundle
from pipeline.volume.world.record import VolumeRecord

_SHARE = 1e-4  # of an area, by which it differs as stations have four decimals; 1.4e-5 in Wheal Pell
_M2 = 0.01  # and of small areas; islands that are smaller may close
_OF_FLOORS = 0.1  # share by which the plan of a solid may differ from the columns of its floors
_RIM_M = 1.0  # beyond which the plan's frame may not end before the mesh does
_PIXEL_AT = 0.25  # where the origin lies in its pixel, of views that are drawn of the legs
_ROUND = 1e-3  # of a margin, m: places have four decimals


def require_plan(folder: Path, world: VolumeBundle, legs: SurveyedLegs | None) -> None:
    """Compare the areas of a record, and its frame, with the view of the legs from above.

    The plan of a solid, and of drawn areas, is that of their file, which a bundle has not: its area must be about that
    of the floors, and its frame hold the mesh.

    Raises
    ------
    ArtifactError
        With the field, its value and what it should be.
    """
    path, record = folder / RECORD, world.record
    stated = record.areas
    if legs is None:
        _require_about(path, world)
    else:
        try:
            view = shapely.union_all(shapely.get_parts(seen_from_above(path, legs)))
        except shapely.GEOSException as error:
            raise ArtifactError(f"{folder / TOPOLOGY}: its legs cannot be seen from above: {line_of(error)}") from error
        _require_margin(path, record.plan_frame, view)
        _require_areas(path, record, view)
        _require_untraced(path, stated)


def require_surveyed_plan(folder: Path, record: VolumeRecord, survey: Frame, drawn: BaseGeometry) -> None:
    """Compare frame and areas of a record with those of its survey, drawn as seen from above, m, mine frame.

    Raises
    ------
    ArtifactError
        With the field, its value and what it should be.
    """
    if record.plan_frame != survey:
        raise ArtifactError(f"{folder / RECORD}: plan_frame = {record.plan_frame}, the survey has {survey}")
    _require_areas(folder / RECORD, record, drawn)


def _require_untraced(path: Path, stated: Areas) -> None:
    if stated.traced_tunnel_m2 != stated.tunnel_m2 or stated.unconnected_m2 != 0:
        raise ArtifactError(
            f"{path}: areas: traced_tunnel_m2 = {stated.traced_tunnel_m2}, unconnected_m2 = {stated.unconnected_m2}; "
            f"want tunnel_m2 = {stated.tunnel_m2} and 0, as nothing is traced"
        )


def _require_areas(path: Path, record: VolumeRecord, view: BaseGeometry) -> None:
    stated, outer = record.areas, filled(view)
    islands = count_islands(view)
    small = sum(
        shapely.Polygon(ring).area < _M2 for part in shapely.get_parts(view) for ring in getattr(part, "interiors", ())
    )
    made = Areas(
        tunnel_m2=view.area,
        islands_m2=outer.area - view.area,
        outside_m2=float(shapely.box(*record.plan_frame.extent_m).difference(outer).area),
        islands=stated.islands if abs(stated.islands - islands) <= small else islands,
        traced_tunnel_m2=stated.traced_tunnel_m2,
        unconnected_m2=stated.unconnected_m2,
    )
    margin = max(_M2, _SHARE * view.area)
    differs = first_difference(dataclasses.asdict(stated), dataclasses.asdict(made), margin, "areas")
    if differs:
        raise ArtifactError(f"{path}: {differs}, as the legs have from above")


def _require_margin(path: Path, frame: Frame, view: BaseGeometry) -> None:
    """Compare the frame with one margin on all sides of a view, in whole pixels."""
    west, south, east, north = view.bounds
    left, below, right, above = frame.extent_m
    sides = [west - left, south - below, right - east, above - north]
    at = [origin % 1 for origin in (frame.origin_col, frame.origin_row)]
    uneven = max(sides) - min(sides) > 1 / frame.px_per_m + _ROUND
    if uneven or min(sides) < -_ROUND or not np.allclose(at, _PIXEL_AT, atol=1e-9):
        raise ArtifactError(
            f"{path}: plan_frame reaches {[round(side, 3) for side in sides]} m beyond the legs seen from above, its "
            f"origin is at {at} of a pixel; want one margin, to {1 / frame.px_per_m:g} m, and an origin at {_PIXEL_AT}"
        )


def _require_about(path: Path, world: VolumeBundle) -> None:
    record, cells = world.record, world.cells
    stated, vertices = record.areas, world.mine.vertices[:, :2]
    columns = np.unique(np.column_stack([cells.column, cells.row]), axis=0)
    floors_m2 = len(columns) * cells.cell_m**2
    ring_m2 = _edge_cells(columns) * cells.cell_m**2  # a wall passes anywhere through its cell
    off = stated.tunnel_m2 - floors_m2
    if abs(off) > _OF_FLOORS * floors_m2 + ring_m2:
        raise ArtifactError(
            f"{path}: areas.tunnel_m2 = {stated.tunnel_m2}: the floors have {floors_m2:.3f}, want at most "
            f"{_OF_FLOORS * floors_m2 + ring_m2:.3f} more or less"
        )
    left, below, right, above = record.plan_frame.extent_m
    whole_m2 = (right - left) * (above - below)
    most_m2 = stated.tunnel_m2 + stated.islands_m2 + stated.outside_m2
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    if min(low - (left, below)) < -_RIM_M or min((right, above) - high) < -_RIM_M:
        raise ArtifactError(
            f"{path}: plan_frame = {[left, below, right, above]} m: want a frame of the mesh, which reaches from "
            f"{low.round(2).tolist()} to {high.round(2).tolist()} m"
        )
    if not abs(whole_m2 - most_m2) <= max(_M2, _SHARE * whole_m2):
        raise ArtifactError(
            f"{path}: areas: tunnel, islands and outside are {most_m2:.3f} m2, plan_frame has {whole_m2:.3f} m2"
        )


def _edge_cells(columns: np.ndarray) -> int:
    """Return how many of some columns (n, 2) have a side without a neighbour."""
    key = columns[:, 0].astype(np.int64) * (1 << 32) + columns[:, 1]
    inside = np.ones(len(key), bool)
    for step in (1, -1, 1 << 32, -(1 << 32)):
        inside &= np.isin(key + step, key)
    return int((~inside).sum())
