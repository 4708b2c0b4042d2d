"""Vector surveys: they are in metres and stay polygons; a plan is drawn from them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from pipeline.errors import InputError
from pipeline.geometry.generated.generate import generate_workings
from pipeline.geometry.generated.perturb import perturb_workings
from pipeline.geometry.generated.rough_walls import roughen_walls
from pipeline.geometry.outline.enclosure import as_polygons
from pipeline.guard.reading_process import one_line, warn_user
from pipeline.params.survey import (
    CentrelineSurveyParams,
    PassageSurveyParams,
    ProceduralSurveyParams,
    VariantSurveyParams,
    VectorSurveyParams,
)
from pipeline.survey.draw import draw_picture, draw_workings, frame_of
from pipeline.survey.formats import is_solved, leg_reader
from pipeline.survey.levels.drawn import read_levels
from pipeline.survey.passages.flat_pieces import choose_flat_piece
from pipeline.survey.passages.legs import SurveyLeg, build_workings, require_connected, require_no_crossing
from pipeline.survey.passages.sheets import has_relief, lay_out_sheets
from pipeline.survey.solved.plan_view import plan_legs
from pipeline.survey.solved_surveys import survey_files
from pipeline.survey.stations.table import read_station_legs
from pipeline.survey.surfaces import wall_heights
from pipeline.survey.vector.centrelines import read_centrelines
from pipeline.survey.vector.geodata import companions
from pipeline.survey.vector.geojson import read_geojson
from pipeline.survey.vector.level_fields import warn_of_overlaps
from pipeline.survey.vector.shapes import REACH_M, Shapes, locate, require_simple, workings_of
from pipeline.survey.vector_shapes import elevations_of, read_shapes
from pipeline.survey.whole_survey import WholeSurvey, footprint, read_whole, whole_in_frame
from pipeline.types import (
    METRIC,
    NO_FLOORS,
    NO_LEGS,
    FloorMesh,
    Frame,
    Georeference,
    Heights,
    Image,
    Seam,
    SurveyedLegs,
)

VectorSurvey = (
    VectorSurveyParams | PassageSurveyParams | CentrelineSurveyParams | ProceduralSurveyParams | VariantSurveyParams
)
_MOST_LAYERS = 8  # that a message names


@dataclass(frozen=True)
class VectorReading:
    """A survey's workings (m, mine frame), their georeference and heights, and the plan drawn of them with its frame.

    `legs` are those of a survey that is built as one volume, `floors` those of drawn areas with heights, whose shafts
    are the legs; the workings are their view from above.
    A procedural mine with `as_picture` has no workings: stage 2 traces them from the plan.
    """

    workings: MultiPolygon
    georeference: Georeference
    heights: Heights | None
    plan: Image
    frame: Frame
    legs: SurveyedLegs = NO_LEGS
    floors: FloorMesh = NO_FLOORS

    @property
    def width_m(self) -> float:
        """Return the typical width of the drifts: that of one long drift of the same area and length of walls."""
        return self.floors.width_m if len(self.floors) else 2 * self.workings.area / self.workings.length

    @property
    def walls_m(self) -> float:
        """Return the length of all walls seen from above, those over each other among them."""
        return self.floors.walls_m if len(self.floors) else float(self.workings.length)


@dataclass(frozen=True)
class _Workings:
    """Workings (m, mine frame) with their georeference, and heights if they have any."""

    polygons: MultiPolygon
    georeference: Georeference
    heights: Heights | None = None
    legs: SurveyedLegs = NO_LEGS
    floors: FloorMesh = NO_FLOORS


def read_vector_survey(params: VectorSurvey, content: Shapes | None = None) -> VectorReading:
    """Read a survey that is in metres, and draw its plan.

    `content` is what `read_shapes` returned for a vector file; None reads the file.

    Raises
    ------
    InputError
        If the file cannot be read or holds no workings.
    """
    read = _read(params, content)
    workings = read.polygons
    if workings.is_empty:
        raise InputError(f"{_name(params)}: the workings have no area")
    frame = frame_of(_name(params), workings, params)
    if params.kind != "procedural" or not params.as_picture:
        plan = draw_workings(workings, frame, params.labels_m, params.drawing_grey)
        return VectorReading(workings, read.georeference, read.heights, plan, frame, read.legs, read.floors)
    plan = draw_picture(workings, frame, params.drawing_grey, params.anti_aliased, params.jpeg_quality)
    return VectorReading(MultiPolygon(), read.georeference, None, plan, frame)


def _read(params: VectorSurvey, content: Shapes | None) -> _Workings:
    match params.kind:
        case "procedural":
            rng = np.random.default_rng(params.seed)
            workings = generate_workings(rib_noise_m=params.rib_noise_m, rng=rng, **params.mine.model_dump())
            rough = params.rough_walls
            return _Workings(roughen_walls(workings, rng=rng, **rough.model_dump()) if rough else workings, METRIC)
        case "variant":
            path = Path(params.workings)
            shapes, georeference = locate(path, require_simple(path, read_geojson(path, None)), None, None)
            workings, rng = workings_of(path, shapes, 0.0, []), np.random.default_rng(params.seed)
            perturbed = perturb_workings(workings, params.station_sd_m, params.width_sd_m, params.reach_m, rng)
            return _Workings(perturbed, georeference)
        case "passages":
            return _read_passages(params)
        case "centrelines":
            return _read_centrelines(params, content)
    path = Path(params.file)
    content = content or read_shapes(path, params.layers, params.level_by, params.no_elevation)
    shapes, georeference = locate(path, content, params.unit, params.origin)
    found = read_levels(path, content, shapes, georeference, params, elevations_of(path, content, params))
    if found.levels is not None:
        levels = found.levels
        return _Workings(levels.polygons, georeference, levels.heights, levels.legs, levels.floors)
    if params.piece is not None:
        raise InputError(f"{path}: survey.piece is read with levels over each other; this drawing is read as one plan")
    content, shapes = content.only(found.is_wall), list(compress(shapes, found.is_wall))
    layers = list(dict.fromkeys(content.layer_of))
    if params.layers is None and len(layers) > 1 and path.suffix.lower() == ".gpkg":
        names = ", ".join(one_line(name, 40) for name in layers[:_MOST_LAYERS])
        warn_user(f"{path.name}: {len(layers)} layers are read as one plan ({names}); --layer chooses")
    heights = wall_heights(path, content, shapes, georeference, params.no_elevation is None)
    workings = workings_of(path, shapes, params.snap_m, list(params.seeds_m))
    warn_of_overlaps(path, content, shapes, workings)
    return _Workings(workings, georeference, heights)


def _read_passages(params: PassageSurveyParams) -> _Workings:
    path = Path(params.file)
    if params.volume:
        whole = read_whole(path, params)
        _require_short(path, whole.legs)
        _, georeference = locate(path, Shapes([footprint(path, whole.legs)], "m"), "m", params.origin)
        place = Georeference("m", 1.0, georeference.origin, whole.crs)
        surveyed, seen = whole_in_frame(path, whole, params, georeference.origin)
        return _Workings(seen, place, legs=surveyed)
    reader = leg_reader(path)
    if isinstance(params.grade, dict):  # of the legs of a station table
        legs, crs = read_station_legs(path, params.grade), None
    else:
        legs, crs = reader(path, params.half_width_m)
    built, heights = _build(path, legs, params)
    shapes, georeference = locate(path, Shapes([built], "m"), "m", params.origin)
    place = Georeference("m", 1.0, georeference.origin, crs)
    if heights is None:
        return _Workings(as_polygons(shapely.union_all(shapes)), place)
    return _Workings(shapes[0], place, _moved(heights, georeference.origin))


def _read_centrelines(params: CentrelineSurveyParams, content: Shapes | None) -> _Workings:
    path = Path(params.file)
    content = content or read_shapes(path, params.layers, params.level_by, params.no_elevation)
    elevations = elevations_of(path, content, params)
    survey, georeference = read_centrelines(
        path, content, params.unit, params.origin, params.snap_m, elevations, params.no_elevation is None
    )
    if params.volume:
        whole = WholeSurvey(plan_legs(path, survey, params.half_width_m), [], None)
        _require_short(path, whole.legs)
        surveyed, seen = whole_in_frame(path, whole, params, (0.0, 0.0))
        return _Workings(seen, georeference, legs=surveyed)
    built, heights = _build(path, plan_legs(path, survey, params.half_width_m), params)
    return _Workings(as_polygons(built) if heights is None else built, georeference, heights)


def _build(
    path: Path, legs: list[SurveyLeg], params: PassageSurveyParams | CentrelineSurveyParams
) -> tuple[BaseGeometry, Heights | None]:
    """Return the workings of legs, sheet by sheet if they have heights, and these."""
    _require_short(path, legs)
    if has_relief(legs):
        return lay_out_sheets(path, legs, params.apart_m, params.piece, named=params.kind == "passages")
    is_drawn = params.kind == "centrelines"
    if params.piece is not None and not is_drawn:
        raise InputError(f"{path}: survey.piece is read with heights; the floors of this survey are level")
    driven = [leg for leg in legs if not leg.is_plumb]
    if not is_drawn:
        require_connected(path, driven)
    require_no_crossing(path, driven)
    built = build_workings(driven)
    if built.is_empty:
        raise InputError(f"{path}: the stations' walls enclose no area")
    return choose_flat_piece(path, built, params.piece) if is_drawn else built, None


def _require_short(path: Path, legs: list[SurveyLeg]) -> None:
    """Refuse a shot that is longer than a mine may be, before it is cut into pieces of a metre."""
    for leg in legs:
        steps = np.linalg.norm(np.diff(leg.positions_m, axis=0), axis=1)
        if steps.max() > REACH_M:
            k = int(steps.argmax())
            raise InputError(
                f"{path}: {leg.stations[k]} to {leg.stations[k + 1]} are {steps[k]:.0f} m apart, at most {REACH_M:g} m"
            )


def _moved(heights: Heights, origin: tuple[float, float]) -> Heights:
    """Return heights about another origin of the mine frame."""
    east, north = origin
    lines = [[(x - east, y - north, z) for x, y, z in line] for line in heights.lines]
    seams = [
        Seam(seam.sheets, tuple((x - east, y - north) for x, y in seam.ends_m))  # type: ignore[arg-type]
        for seam in heights.seams
    ]
    shafts = [replace(shaft, place_m=(shaft.place_m[0] - east, shaft.place_m[1] - north)) for shaft in heights.shafts]
    return replace(heights, lines=lines, seams=seams, shafts=shafts)


def _name(params: VectorSurvey) -> str:
    return vector_files(params)[0] if vector_files(params) else f"survey {params.name}"


def vector_files(params: VectorSurvey) -> list[str]:
    """List the input files of a vector survey."""
    match params.kind:
        case "procedural":
            return []
        case "variant":
            return [params.workings]
    path = Path(params.file)
    files = survey_files(path) if is_solved(path) else [path, *companions(path)]
    return [file.as_posix() for file in files]
