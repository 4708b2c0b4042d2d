"""Vector surveys: they are in metres and stay polygons; a plan is drawn from them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import compress
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import InputError, one_line
from minesurveys.formats import files_of
from minesurveys.frames import METRIC, Georeference
from minesurveys.reading import read_shapes
from minesurveys.solved.model import SolvedSurvey
from minesurveys.vector.geojson import read_geojson
from minesurveys.vector.level_fields import level_elevations, warn_of_overlaps
from minesurveys.vector.shapes import REACH_M, Shapes, locate, require_simple, with_heights
from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.generated.perturb import perturb_workings
from pipeline.geometry.generated.rough_walls import roughen_walls
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.params.survey import (
    CentrelineSurveyParams,
    PassageSurveyParams,
    ProceduralSurveyParams,
    VariantSurveyParams,
    VectorSurveyParams,
)
from pipeline.survey.draw import MineReading, draw_picture, reading_of
from pipeline.survey.levels.drawn import read_levels
from pipeline.survey.passages.flat_pieces import choose_flat_piece
from pipeline.survey.passages.legs import legs_of, require_no_crossing
from pipeline.survey.passages.relief import floor_of, has_relief, warn_of_level, warn_of_level_roofs, warn_of_shafts
from pipeline.survey.passages.survey_leg import SurveyLeg
from pipeline.survey.passages.workings import build_workings, level_legs, require_area
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.surfaces import wall_heights
from pipeline.survey.vector.centrelines import read_centrelines
from pipeline.survey.vector.enclosed import workings_of
from pipeline.survey.vector.plan_doubts import refusal_of_layers, warn_of_layers
from pipeline.survey.whole_survey import (
    built_piece,
    footprint,
    from_origin,
    legs_of_piece,
    read_whole,
    seen_from_above,
)
from pipeline.types import DrawnPlan

VectorSurvey = (
    VectorSurveyParams | PassageSurveyParams | CentrelineSurveyParams | ProceduralSurveyParams | VariantSurveyParams
)


def read_vector_survey(params: VectorSurvey, content: Shapes | None = None) -> MineReading:
    """Read a survey that is in metres.

    `content` is what `read_shapes` returned for a vector file; None reads the file.

    Raises
    ------
    InputError
        If the file cannot be read or holds no workings.
    """
    match params.kind:
        case "procedural":
            return _read_procedural(params)
        case "variant":
            read = _read_variant(params)
        case "passages":
            return _read_passages(params)
        case "centrelines":
            read = _read_centrelines(params, content)
        case "vector":
            read = _read_walls(params, content)
    return replace(read, files=vector_files(params))


def _read_procedural(params: ProceduralSurveyParams) -> MineReading:
    rng, rough = np.random.default_rng(params.seed), params.rough_walls
    workings = generate_workings(rib_noise_m=params.rib_noise_m, rng=rng, **params.mine.model_dump())
    workings = roughen_walls(workings, rng=rng, **rough.model_dump()) if rough else workings
    read = reading_of(subject_of(params), workings, params, METRIC)
    if not params.as_picture:
        return read
    drawn = workings, read.frame, params.drawing_grey, params.anti_aliased, params.jpeg_quality
    return replace(read, workings=None, draw_plan=partial(draw_picture, *drawn))


def _read_variant(params: VariantSurveyParams) -> MineReading:
    path, rng = Path(params.workings), np.random.default_rng(params.seed)
    shapes, georeference = locate(path, require_simple(path, read_geojson(path, None)), None, None)
    workings = workings_of(path, shapes, 0.0, [])
    perturbed = perturb_workings(workings, params.station_sd_m, params.width_sd_m, params.reach_m, rng)
    return reading_of(params.workings, perturbed, params, georeference)


def _read_walls(params: VectorSurveyParams, content: Shapes | None) -> MineReading:
    path = Path(params.file)
    content = content or read_shapes(path, params.layers, params.level_by, params.no_elevation)
    content = with_heights(path, content, params.unit)
    shapes, georeference = locate(path, content, params.unit, params.origin)
    found = read_levels(path, content, shapes, georeference, params, _elevations_of(path, content, params))
    if found.levels is not None:
        return reading_of(params.file, found.levels.polygons, params, georeference, shape=found.levels.shape)
    if params.piece is not None:
        raise InputError(f"{path}: survey.piece is read with levels over each other; this drawing is read as one plan")
    content, shapes = content.only(found.is_wall), list(compress(shapes, found.is_wall))
    if params.layers is None and path.suffix.lower() == ".gpkg":
        warn_of_layers(path, content)
    heights = wall_heights(path, content, shapes, georeference, params.no_elevation is None, params)
    try:
        workings = workings_of(path, shapes, params.snap_m, list(params.seeds_m))
    except InputError as error:
        raise refusal_of_layers(path, content, shapes, params.snap_m, error) from error
    warn_of_overlaps(path, content, shapes, workings)
    return reading_of(params.file, workings, params, georeference, heights=heights)


def _read_passages(params: PassageSurveyParams) -> MineReading:
    path = Path(params.file)
    survey, legs = read_whole(path, params)
    _require_short(path, legs)
    crs = None if survey.crs is None else one_line(survey.crs, 200)
    files = [file.as_posix() for file in survey.files]
    if not has_relief(legs, params):
        built, driven = _level_workings(path, survey, legs, params)
        shapes, georeference = locate(path, Shapes([built], "m"), "m", params.origin)
        place = Georeference("m", 1.0, georeference.origin, crs)
        workings, drawn = as_polygons(shapely.union_all(shapes)), level_legs(driven, georeference.origin)
        return reading_of(params.file, workings, params, place, shape=DrawnPlan(drawn), files=files)
    piece = built_piece(path, survey, legs, params.piece)
    _, georeference = locate(path, Shapes([footprint(path, legs_of(piece))], "m"), "m", params.origin)
    surveyed = from_origin(piece, georeference.origin)
    place = Georeference("m", 1.0, georeference.origin, crs)
    return reading_of(params.file, seen_from_above(path, surveyed), params, place, shape=surveyed, files=files)


def _read_centrelines(params: CentrelineSurveyParams, content: Shapes | None) -> MineReading:
    path = Path(params.file)
    content = content or read_shapes(path, params.layers, params.level_by, params.no_elevation)
    content = with_heights(path, content, params.unit)
    elevations = _elevations_of(path, content, params)
    if params.layers is None and not elevations:
        warn_of_layers(path, content)
    survey, georeference = read_centrelines(
        path, content, params.unit, params.origin, params.snap_m, elevations, params.no_elevation is None, params
    )
    legs = plan_legs(path, survey, params.half_width_m)
    _require_short(path, legs)
    if not has_relief(legs, params):
        built, driven = _level_workings(path, survey, legs, params)
        shape = DrawnPlan(level_legs(driven, (0.0, 0.0)))
        return reading_of(params.file, as_polygons(built), params, georeference, shape=shape)
    surveyed = built_piece(path, survey, legs, params.piece)
    return reading_of(params.file, seen_from_above(path, surveyed), params, georeference, shape=surveyed)


def _elevations_of(
    path: Path, content: Shapes, params: VectorSurveyParams | CentrelineSurveyParams
) -> dict[str, float] | None:
    """Return the elevation of each layer that is a level, m: as stated, or as a property of the shapes states it."""
    if params.level_by is None:
        return params.elevations_m
    return level_elevations(path, content, params.level_by, params.elevations_m)


def _level_workings(
    path: Path, survey: SolvedSurvey, legs: list[SurveyLeg], params: PassageSurveyParams | CentrelineSurveyParams
) -> tuple[BaseGeometry, list[SurveyLeg]]:
    """Return the workings of a piece of a survey whose floors are level, seen from above, and its legs but shafts."""
    driven = [leg for leg in legs if not leg.is_plumb]
    warn_of_shafts(path, [leg for leg in legs if leg.is_plumb])
    if not driven:
        raise InputError(f"{path}: every leg is plumb; nothing to drive on")
    require_no_crossing(path, driven, survey.doubt, params)
    is_drawn = params.kind == "centrelines"  # pieces of lines are parted by their walls, not by names of stations
    if not is_drawn:
        driven, _ = legs_of_piece(path, survey, driven, params.piece)
    if all(leg.heights_m is not None for leg in driven):
        warn_of_level(path, np.concatenate([floor_of(leg) for leg in driven]), params)
        warn_of_level_roofs(path, driven)
    built = build_workings(driven)
    require_area(path, built, driven)
    return choose_flat_piece(path, built, params.piece) if is_drawn else built, driven


def _require_short(path: Path, legs: list[SurveyLeg]) -> None:
    """Refuse a shot that is longer than a mine may be, before it is cut into pieces of a metre."""
    for leg in legs:
        steps = np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1)
        if steps.max() > REACH_M:
            k = int(steps.argmax())
            raise InputError(
                f"{path}: {leg.stations[k]} to {leg.stations[k + 1]} are {steps[k]:.0f} m apart, at most {REACH_M:g} m"
            )


def subject_of(params: VectorSurvey) -> str:
    """Return what messages name: a vector survey's file, or a generated mine's name."""
    match params.kind:
        case "procedural":
            return f"survey {params.name}"
        case "variant":
            return params.workings
    return params.file


def vector_files(params: VectorSurvey) -> list[str]:
    """List the input files of a vector survey without reading it whole."""
    match params.kind:
        case "procedural":
            return []
        case "variant":
            return [params.workings]
    return [file.as_posix() for file in files_of(Path(params.file))]
