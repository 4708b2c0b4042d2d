"""Stage 1's work: one plan picture, its frame and its scale, from whatever survey the parameters name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2

from pipeline.errors import InputError
from pipeline.params.survey import PlanSurveyParams, PosesParams, StationSurveyParams
from pipeline.survey.draw import draw_plan, frame_around
from pipeline.survey.image import read_image
from pipeline.survey.poses import PoseScale, gate_returns, read_poses, read_returns, scale_from_poses
from pipeline.survey.scale import measure_bar
from pipeline.survey.stations import build_workings, read_stations
from pipeline.types import Frame, Image, Scale, Survey

Box = tuple[int, int, int, int]
Params = StationSurveyParams | PlanSurveyParams


def read_survey(params: Params) -> dict[str, Any]:
    """Return `plan`, the picture (rows, cols, 3) uint8 BGR, and `survey`, what is known of it.

    Raises
    ------
    InputError
        If an input is unusable or gives no scale; the message names file, value and limit.
    """
    plan, frame, boxes, bar = draw_stations(params) if params.kind == "stations" else read_plan(params)
    poses = None if params.poses is None else _scale_of_poses(params.poses, plan, frame)
    wide, width = plan.shape[1], params.resample_width_px or plan.shape[1]
    scale = _settle_scale(params, bar, poses, width / wide)
    frame = frame.resampled(width, scale.px_per_m)
    if width != wide:
        plan = cv2.resize(plan, (frame.width_px, frame.height_px), interpolation=cv2.INTER_AREA)
        boxes = [(round(a * width / wide), round(b * width / wide), round(c * width / wide), round(d * width / wide))
                 for a, b, c, d in boxes]  # fmt: skip
    survey = Survey(
        params.name, params.kind, frame, scale, boxes, params.entrance_m, dict(params.labels_m), sources(params)
    )
    return {"plan": plan, "survey": survey}


def draw_stations(params: StationSurveyParams) -> tuple[Image, Frame, list[Box], float]:
    """Draw a station survey; return plan, frame, the bar's box and the scale read off the drawn bar."""
    legs = read_stations(Path(params.stations))
    workings = build_workings(legs)
    if workings.is_empty:
        raise InputError(f"{params.stations}: the stations' walls enclose no area")
    west, south, east, north = workings.bounds
    m = params.margin_m
    extent = params.frame_m or (west - m, south - m, east + m, north + m)
    if not (extent[0] <= west and extent[1] <= south and east <= extent[2] and north <= extent[3]):
        raise InputError(
            f"{params.stations}: the workings reach from ({west:.1f}, {south:.1f}) to ({east:.1f}, {north:.1f}) m, "
            f"beyond survey.frame_m = {list(extent)}; survey.frame_m=null fits the frame to them"
        )
    frame = frame_around(extent, params.px_per_m)
    plan, box = draw_plan(workings, frame, params.labels_m, params.scale.bar_length_m, params.ink_grey)
    bar = measure_bar(plan[box[1] : box[3], box[0] : box[2]], params.scale.bar_length_m, "the drawn plan's scale bar")
    return plan, frame, [box], bar


def read_plan(params: PlanSurveyParams) -> tuple[Image, Frame, list[Box], float | None]:
    """Read a plan image; return plan, frame, boxes to leave out, and the scale read off its bar."""
    plan = read_image(Path(params.image), params.max_megapixels)
    boxes, bar, length = [], None, params.scale.bar_length_m
    if params.scale.bar_image is not None:
        bar = measure_bar(
            read_image(Path(params.scale.bar_image), params.max_megapixels), length, params.scale.bar_image
        )
    elif params.scale.bar_box_px is not None:
        col0, row0, col1, row1 = box = params.scale.bar_box_px
        if not (0 <= col0 < col1 <= plan.shape[1] and 0 <= row0 < row1 <= plan.shape[0]):
            raise InputError(f"survey.scale.bar_box_px = {list(box)}: not inside {plan.shape[1]} x {plan.shape[0]} px")
        bar = measure_bar(plan[row0:row1, col0:col1], length, f"{params.image} within {list(box)}")
        boxes.append(box)
    col, row = params.origin_px or (-0.5, plan.shape[0] - 0.5)
    return plan, Frame(1.0, col + 0.5, row + 0.5, plan.shape[1], plan.shape[0]), boxes, bar


def _scale_of_poses(poses: PosesParams, plan: Image, frame: Frame) -> PoseScale:
    gates = poses.max_range_m, poses.max_range_var_m2
    sweeps = {name: gate_returns(Path(file), read_returns(Path(file)), *gates) for name, file in poses.sweeps.items()}
    origin = (frame.origin_col, frame.origin_row)
    return scale_from_poses(plan, read_poses(Path(poses.file)), sweeps, origin, poses.scale_range_px_per_m)


def _settle_scale(params: Params, bar: float | None, poses: PoseScale | None, shrink: float) -> Scale:
    """Choose the scale that is asked for and compare the other readings with it, in px/m of the final picture."""
    readings = {
        "bar": None if bar is None else bar * shrink,
        "poses": None if poses is None else poses.px_per_m * shrink,
        "stated": params.scale.px_per_m,
    }
    used = readings[params.scale.source]
    if used is None:
        raise InputError(
            "survey.scale.source = bar: no bar to measure; give survey.scale.bar_image or survey.scale.bar_box_px, "
            "or state survey.scale.px_per_m with survey.scale.source=stated"
        )
    difference = {k: round(100 * (v / used - 1), 3) for k, v in readings.items() if v is not None}
    interval = None if poses is None else (poses.low_px_per_m * shrink, poses.high_px_per_m * shrink)
    return Scale(
        used, params.scale.source, readings["bar"], readings["poses"], interval, readings["stated"], difference
    )


def sources(params: Params) -> list[str]:
    """List the input files that a survey section names."""
    main_file = [params.stations] if params.kind == "stations" else [params.image]
    bar = [params.scale.bar_image] if params.scale.bar_image else []
    return main_file + bar + ([params.poses.file, *params.poses.sweeps.values()] if params.poses else [])
