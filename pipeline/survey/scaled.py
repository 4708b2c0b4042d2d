"""Surveys whose scale must be measured: a station survey that is drawn, and the picture of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from minesurveys.errors import InputError
from minesurveys.frames import METRIC, Georeference, Heights
from minesurveys.pictures.georeference import find_placement
from minesurveys.pictures.image import read_image
from pipeline.params.floor_rules import FloorRules
from pipeline.params.survey import PlanSurveyParams, PosesParams, StationSurveyParams
from pipeline.scans.poses import PoseScale, scale_from_poses
from pipeline.scans.sweeps import gate_returns, read_poses, read_returns
from pipeline.survey.draw import WIDEST_M, MineReading, draw_plan, frame_around
from pipeline.survey.drawing.picture import (
    fill_walls,
    keep_workings,
    make_ready,
    read_picture,
    require_few_regions,
    turn_picture,
)
from pipeline.survey.drawing.reduction import in_reduced_px, size_read
from pipeline.survey.drawing.scale import measure_bar
from pipeline.survey.passages.relief import floor_of
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.passages.workings import build_workings, level_legs, require_area
from pipeline.survey.solved.flatness import require_single
from pipeline.survey.solved.station_table import read_stations
from pipeline.types import DrawnPlan, Frame, Image, Scale, SurveyedLegs

Box = tuple[int, int, int, int]
Scaled = StationSurveyParams | PlanSurveyParams


@dataclass(frozen=True)
class Reading:
    """A plan as read from its file, and the readings of its scale. Its frame uses 1 px/m until the scale is chosen."""

    plan: Image
    frame: Frame
    boxes: list[Box]
    bar_px_per_m: float | None
    map_px_per_m: float | None = None
    georeference: Georeference = METRIC
    heights: Heights | None = None
    legs: SurveyedLegs | None = None


def read_scaled(params: Scaled) -> MineReading:
    """Read a survey whose scale must be measured, and choose its scale."""
    reading = plan_of_stations(params) if params.kind == "stations" else read_plan(params)
    params = params if params.kind == "stations" else in_reduced_px(params)
    plan, boxes = reading.plan, reading.boxes
    poses = None if params.poses is None else _scale_of_poses(params.poses, plan, reading.frame)
    read_width, width = plan.shape[1], params.resample_width_px or plan.shape[1]
    ratio = width / read_width
    scale = _choose_scale(params, reading, poses, ratio)
    require_extent(params.stations if params.kind == "stations" else params.image, plan, scale.px_per_m / ratio)
    frame = reading.frame.resampled(width, scale.px_per_m)
    if width != read_width:
        plan = cv2.resize(plan, (frame.width_px, frame.height_px), interpolation=cv2.INTER_AREA)
        boxes = [
            (
                round(col0 * width / read_width),
                round(row0 * width / read_width),
                round(col1 * width / read_width),
                round(row1 * width / read_width),
            )
            for col0, row0, col1, row1 in boxes
        ]
    drawn, shape = partial(np.asarray, plan), DrawnPlan(reading.legs)
    return MineReading(None, reading.georeference, frame, drawn, reading.heights, shape, scale=scale, boxes=boxes)


def require_extent(path: str, plan: Image, px_per_m: float) -> None:
    """Refuse a plan that shows more than 20 km, as of vector surveys: its scale is wrong.

    Raises
    ------
    InputError
        The message names the file, the extent and the limit.
    """
    widest = max(plan.shape[:2]) / px_per_m
    if widest > WIDEST_M:
        raise InputError(
            f"{path}: the plan extends over {widest:.4g} m at {px_per_m:g} px/m, the limit is {WIDEST_M:,.0f} m; "
            "is its scale right? --px-per-m or --bar-length states it"
        )


def plan_of_stations(params: StationSurveyParams) -> Reading:
    """Draw a station survey as a plan and measure the scale from the drawn bar. Grades of its legs give it heights."""
    path = Path(params.stations)
    legs = read_stations(path, params.grade if isinstance(params.grade, dict) else None, params)
    workings, heights = build_workings(legs), _heights_of_grades(path, legs, params)
    require_area(path, workings, legs)
    west, south, east, north = workings.bounds
    m = params.margin_m
    extent = params.frame_m or (west - m, south - m, east + m, north + m)
    if not (extent[0] <= west and extent[1] <= south and east <= extent[2] and north <= extent[3]):
        raise InputError(
            f"{params.stations}: the workings reach from ({west:.1f}, {south:.1f}) to ({east:.1f}, {north:.1f}) m, "
            f"beyond survey.frame_m = {list(extent)}; survey.frame_m=null fits the frame to the workings"
        )
    frame = frame_around(extent, params.px_per_m)
    plan, box = draw_plan(workings, frame, params.labels_m, params.scale.bar_length_m, params.drawing_grey)
    bar = measure_bar(plan[box[1] : box[3], box[0] : box[2]], params.scale.bar_length_m, "the drawn plan's scale bar")
    return Reading(plan, frame, [box], bar, heights=heights, legs=level_legs(legs, (0.0, 0.0)))


def _heights_of_grades(path: Path, legs: list[SurveyLeg], rules: FloorRules) -> Heights | None:
    """Return the floor of legs with grades; None if they have none.

    Raises
    ------
    InputError
        If workings lie over each other: a drawn plan shows one floor.
    """
    if legs[0].grades is None:
        return None
    require_single(path, legs, rules)
    places = [np.column_stack([leg.positions_m, floor_of(leg)]) for leg in legs]
    datum = float(np.floor(min(line[:, 2].min() for line in places)))
    lines = [[(float(x), float(y), float(z)) for x, y, z in line - (0, 0, datum)] for line in places]
    return Heights(lines=lines, datum_m=datum)


def read_plan(params: PlanSurveyParams) -> Reading:
    """Read a plan image, prepared for tracing."""
    path, length = Path(params.image), params.scale.bar_length_m
    plan, _ = make_ready(path, read_picture(path, params), params)
    require_few_regions(path, plan)
    by, stated_box = params.reduction, list(params.scale.bar_box_px or ())
    params = in_reduced_px(params)
    boxes, bar, per_m, georeference = [], None, None, Georeference("m", 1.0, turned_deg=params.turn_deg)
    if params.scale.bar_image is not None:
        alone = read_image(Path(params.scale.bar_image), params.max_megapixels)
        bar = measure_bar(alone, length, params.scale.bar_image) / by
    elif params.scale.bar_box_px is not None:
        col0, row0, col1, row1 = box = params.scale.bar_box_px
        if not (0 <= col0 < col1 <= plan.shape[1] and 0 <= row0 < row1 <= plan.shape[0]):
            raise InputError(
                f"survey.scale.bar_box_px = {stated_box}: not inside the picture of "
                f"{by * plan.shape[1]} x {by * plan.shape[0]} px"
            )
        bar = measure_bar(plan[row0:row1, col0:col1], length, f"{params.image} within {stated_box}{size_read(by)}")
        boxes.append(box)
    if params.scale.source == "georeference":
        plan, per_m, georeference = _place_in_map(path, plan, params)
    origin = params.origin_px or (-0.5, plan.shape[0] - 0.5)
    if params.workings_only:
        plan, boxes = keep_workings(path, plan, params), []
    elif params.line_drawing:
        plan = fill_walls(path, plan, params)
    frame = Frame(1.0, origin[0] + 0.5, origin[1] + 0.5, plan.shape[1], plan.shape[0])
    return Reading(plan, frame, boxes, bar, per_m, georeference)


def _place_in_map(path: Path, plan: Image, params: PlanSurveyParams) -> tuple[Image, float, Georeference]:
    """Rotate a plan north up by its georeference. Return the plan, its scale in px/m, and its new georeference."""
    place = find_placement(path)
    if place is None:
        raise InputError(f"{path}: has no world file and is not a GeoTIFF; survey.scale.source=georeference needs one")
    size = place.size * params.reduction
    if params.crop_px is not None or params.turn_deg:
        raise InputError(f"{path}: survey.crop_px and survey.turn_deg cannot be used with scale.source=georeference")
    corner = np.zeros(2)  # the picture's corner in the rotated picture
    if abs(place.turned_deg) > 0.01:
        plan, turn = turn_picture(plan, place.turned_deg)
        corner = turn[:, 2]
    col, row = params.origin_px or (-0.5, plan.shape[0] - 0.5)
    origin = place.east + (col + 0.5 - corner[0]) * size, place.north - (row + 0.5 - corner[1]) * size
    georeference = Georeference(place.unit, place.metres_per_unit, origin, place.crs, None, place.turned_deg)
    return plan, 1.0 / (size * place.metres_per_unit), georeference


def _scale_of_poses(poses: PosesParams, plan: Image, frame: Frame) -> PoseScale:
    gates = poses.max_range_m, poses.max_range_var_m2
    sweeps = {name: gate_returns(Path(file), read_returns(Path(file)), *gates) for name, file in poses.sweeps.items()}
    origin = (frame.origin_col, frame.origin_row)
    return scale_from_poses(plan, read_poses(Path(poses.file)), sweeps, origin, poses.scale_range_px_per_m)


def _choose_scale(params: Scaled, reading: Reading, poses: PoseScale | None, ratio: float) -> Scale:
    """Return the scale from the requested source, compared with the other sources, in px/m of the resampled picture."""
    readings = {
        "bar": None if reading.bar_px_per_m is None else reading.bar_px_per_m * ratio,
        "poses": None if poses is None else poses.px_per_m * ratio,
        "stated": params.scale.px_per_m,
        "georeference": None if reading.map_px_per_m is None else reading.map_px_per_m * ratio,
    }
    used = readings[params.scale.source]
    if used is None:
        raise InputError(
            "survey.scale.source = bar: no bar to measure; give survey.scale.bar_image or survey.scale.bar_box_px, "
            "or state survey.scale.px_per_m with survey.scale.source=stated"
        )
    difference = {k: round(100 * (v / used - 1), 3) for k, v in readings.items() if v is not None}
    interval = None if poses is None else (poses.low_px_per_m * ratio, poses.high_px_per_m * ratio)
    return Scale(
        used, params.scale.source, readings["bar"], readings["poses"], interval, readings["stated"], difference
    )
