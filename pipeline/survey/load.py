"""Stage 1: read the survey that the parameters name into a plan, its frame and its scale."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from minesurveys.errors import InputError
from minesurveys.formats import files_of, format_of, solver_limits
from minesurveys.frames import Heights
from minesurveys.guard.reading_process import Payload, run_limited
from minesurveys.pictures.georeference import placement_files
from minesurveys.remarks import collect_remarks
from pipeline.params.survey import (
    CloudSurveyParams,
    SolidSurveyParams,
    SurveyParams,
)
from pipeline.store.mine_survey import MineSurvey, survey_arrays, survey_of_arrays
from pipeline.store.registry import read_registry
from pipeline.survey.draw import MineReading, draw_workings, frame_of
from pipeline.survey.grid.plan import read_grid
from pipeline.survey.scaled import read_scaled
from pipeline.survey.start import start_in_plan
from pipeline.survey.surfaces import height_files, read_heights
from pipeline.survey.vector_survey import read_vector_survey, subject_of, vector_files
from pipeline.types import DrawnPlan, Image, Scale, Survey, VolumeShape, Workings


def read_survey(params: SurveyParams) -> MineSurvey:
    """Read a survey, in a process with the limits of `minesurveys/limits.yaml` if it comes from a file.

    Raises
    ------
    InputError
        If an input cannot be used or has no scale. The message names the file, the value and the limit.
    """
    if params.kind in ("procedural", "cloud"):  # the points of a cloud are read in a process of their own
        return read_unlimited(params)
    # A fit to poses casts rays by a library whose threads do not survive a fork.
    arguments = {"params": params.model_dump(mode="json")}
    subject = _subject(params)
    fresh = params.poses is not None
    payload = run_limited(read_here, arguments, subject, fresh=fresh, **solver_limits(Path(subject)))
    return survey_of_arrays(payload.values, payload.arrays)


def read_here(params: dict[str, Any]) -> Payload:
    """Read a survey in this process; `read_survey` has limits."""
    return Payload(*survey_arrays(read_unlimited(_section(params))))


def _section(params: dict[str, Any]) -> SurveyParams:
    return TypeAdapter(SurveyParams).validate_python(params)


def _subject(params: SurveyParams) -> str:
    """Return the file that a survey section names."""
    match params.kind:
        case "stations":
            return params.stations
        case "plan":
            return params.image
        case "grid":
            return params.map
        case "solid" | "cloud":
            return params.file
    return subject_of(params)


def read_unlimited(params: SurveyParams) -> MineSurvey:
    """Read a survey in this process."""
    match params.kind:
        case "stations" | "plan":
            read = read_scaled(params)
        case "solid" | "cloud":
            read = _read_solid(params)
        case "grid":
            read = read_grid(params)
        case _:
            read = read_vector_survey(params)
    plan = read.draw_plan()
    stated = _stated_heights(params, read, plan)
    if stated is not None and not isinstance(read.shape, DrawnPlan):
        raise InputError(f"{_subject(params)}: survey.heights and survey.grade are not read: it has elevations")
    heights = stated or read.heights
    registry, files = read_registry(), _sources(params, read.files)
    licences = {
        name: registry[name.removeprefix("data/")].licence for name in files if name.removeprefix("data/") in registry
    }
    entrance_m, entrance_z_m = _entrance(params, read.shape, heights)
    survey = Survey(
        params.name,
        params.kind,
        read.frame,
        read.scale or Scale(read.frame.px_per_m, "map" if params.kind == "grid" else "drawn"),
        read.boxes,
        entrance_m,
        dict(params.labels_m),
        files,
        read.georeference,
        licences,
        heights,
        entrance_z_m,
    )
    return MineSurvey(survey, plan, read.shape, None if read.workings is None else Workings(read.workings))


def _read_solid(params: SolidSurveyParams | CloudSurveyParams) -> MineReading:
    # trimesh, ezdxf and open3d take a second each to load, and few surveys are solids or clouds
    from pipeline.survey.clouds.draw import mark_left_out
    from pipeline.survey.clouds.read import ScanReading, read_scan
    from pipeline.survey.solids.read import read_solid

    found = read_scan(params) if params.kind == "cloud" else read_solid(params)
    frame = frame_of(params.file, found.workings, params)
    drawn = draw_workings(found.workings, frame, params.labels_m, params.drawing_grey)
    plan = mark_left_out(drawn, frame, found.volume) if isinstance(found, ScanReading) else drawn
    return MineReading(found.workings, found.georeference, frame, partial(np.asarray, plan), shape=found.solid)


def _entrance(
    params: SurveyParams, shape: DrawnPlan | VolumeShape, heights: Heights | None
) -> tuple[tuple[float, float] | None, float | None]:
    """Return where robots start in plan, and of a volume at which height, if these are stated."""
    if params.entrance_m is None:
        return None, None
    if isinstance(shape, DrawnPlan):
        return start_in_plan(params.entrance_m, heights), None
    east, north, *elevation = params.entrance_m
    return (east, north), elevation[0] - shape.datum_m if elevation else None


def _stated_heights(params: SurveyParams, read: MineReading, plan: Image) -> Heights | None:
    """Return the heights that the survey section states, None if it states none."""
    if params.heights is not None:
        return read_heights(Path(params.heights), read.georeference, plan, read.frame)
    return Heights(grade=params.grade) if isinstance(params.grade, float) else None


def sources(params: SurveyParams) -> list[str]:
    """List the input files of a survey section, with their companion files."""
    is_generated = params.kind in ("procedural", "variant")
    if is_generated or not format_of(Path(_subject(params))).files:
        return _sources(params)
    return run_limited(sources_here, {"params": params.model_dump(mode="json")}, _subject(params)).values


def sources_here(params: dict[str, Any]) -> Payload:
    """List the input files of a survey section in this process, without the remarks of its reading."""
    with collect_remarks():
        return Payload(_sources(_section(params)))


def _sources(params: SurveyParams, read: list[str] | None = None) -> list[str]:
    """List the input files of a survey section; `read` are those that its reader has met."""
    match params.kind:
        case "stations":
            files = [params.stations]
        case "plan":
            files = [params.image]
            georeference = placement_files(Path(params.image)) if params.scale.source == "georeference" else []
            files += [file.as_posix() for file in georeference]
        case "grid":
            files = read or [file.as_posix() for file in files_of(Path(params.map))]
        case "solid":
            files = [file.as_posix() for file in files_of(Path(params.file))]
        case "cloud":
            files = [params.file, *([params.trajectory] if params.trajectory else [])]
        case _:
            files = read or vector_files(params)
    bar = [params.scale.bar_image] if params.kind in ("stations", "plan") and params.scale.bar_image else []
    return (
        files
        + bar
        + (height_files(Path(params.heights)) if params.heights else [])
        + ([params.poses.file, *params.poses.sweeps.values()] if params.poses else [])
    )
