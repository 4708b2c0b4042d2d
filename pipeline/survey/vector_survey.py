"""Vector surveys: they are in metres and stay polygons; a plan is drawn from them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
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
from pipeline.survey.levels.areas import areas_of
from pipeline.survey.levels.sheets import lay_out_levels
from pipeline.survey.levels.walls import lie_over, split_steep, walls_in_space
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
from pipeline.types import METRIC, NO_LEGS, Frame, Georeference, Heights, Image, Seam, SurveyedLegs

VectorSurvey = (
    VectorSurveyParams | PassageSurveyParams | CentrelineSurveyParams | ProceduralSurveyParams | VariantSurveyParams
)
_MOST_LAYERS = 8  # that a message names


@dataclass(frozen=True)
class VectorReading:
    """A survey's workings (m, mine frame), their georeference and heights, and what draws their plan, with its frame.

    `legs` are those of a survey built as one volume; its workings are their view from above. A procedural mine with
    `as_picture` has none: stage 2 traces them from the plan.
    """

    workings: MultiPolygon
    georeference: Georeference
    heights: Heights | None
    frame: Frame
    draw_plan: partial[Image]  # one of 6,000 px takes 2 s, and detection needs none
    legs: SurveyedLegs = NO_LEGS

    @property
    def width_m(self) -> float:
        """Return the typical width of the drifts: that of one long drift of the same area and length of walls."""
        return 2 * self.workings.area / self.workings.length


@dataclass(frozen=True)
class _Workings:
    """Workings (m, mine frame) with their georeference, and heights if they have any."""

    polygons: MultiPolygon
    georeference: Georeference
    heights: Heights | None = None
    legs: SurveyedLegs = NO_LEGS


def read_vector_survey(params: VectorSurvey, content: Shapes | None = None) -> VectorReading:
    """Read a survey that is in metres.

    `content` is what `read_shapes` returned for a vector file; None reads the file.

    Raises
    ------
    InputError
        If the file cannot be read or holds no workings.
    """
    read, name = _read(params, content), _name(params)
    if (workings := read.polygons).is_empty:
        raise InputError(f"{name}: the workings have no area")
    frame = frame_of(name, workings, params)
    if params.kind != "procedural" or not params.as_picture:
        draw = partial(draw_workings, workings, frame, params.labels_m, params.drawing_grey)
        return VectorReading(workings, read.georeference, read.heights, frame, draw, read.legs)
    draw = partial(draw_picture, workings, frame, params.drawing_grey, params.anti_aliased, params.jpeg_quality)
    return VectorReading(MultiPolygon(), read.georeference, None, frame, draw)


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
    found = _read_levels(path, content, shapes, georeference, params)
    if found.levels is not None:
        return found.levels
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


@dataclass(frozen=True)
class _LevelReading:
    """Levels over each other, a sheet a level; None if the walls are those of one plan.

    Then `is_wall` is for each shape whether it is read in that plan: the axes of shafts are not.
    """

    levels: _Workings | None
    is_wall: list[bool]


def _read_levels(
    path: Path,
    content: Shapes,
    moved: list[BaseGeometry],
    georeference: Georeference,
    params: VectorSurveyParams,
) -> _LevelReading:
    """Return the levels that walls with elevations enclose, if they lie over each other."""
    elevations = elevations_of(path, content, params)
    is_checked = params.no_elevation is None
    found, left_out = walls_in_space(path, content, moved, georeference, elevations, is_checked)
    walls, axes = split_steep(found)
    if not walls:
        return _LevelReading(None, [True] * len(moved))
    try:
        areas = areas_of(path, walls, params.snap_m)
        drawn = lay_out_levels(path, areas, [] if params.seeds_m else axes, params.snap_m, params.piece)
    except InputError:
        if elevations or lie_over(walls):
            raise
        drawn = None
    else:
        if drawn is None and lie_over(walls):
            raise InputError(
                f"{path}: walls lie over each other, and enclose no levels of their own; close the walls of each "
                "level, or put each level and each ramp on a layer of its own"
            )
        if drawn is not None and params.seeds_m:
            raise InputError(f"{path}: survey.seeds_m is not read with levels over each other; --layer chooses walls")
        if left_out:
            names = ", ".join(one_line(layer, 40) or "no name" for layer in left_out[:_MOST_LAYERS])
            done = "are read in plan with the others" if drawn is None else "are left out"
            warn_user(
                f"{path.name}: {len(left_out)} layers without an elevation {done}: {names}; "
                "--elevation LAYER=M states one"
            )
    if drawn is not None or not axes:
        levels = None if drawn is None else _Workings(drawn[0], georeference, drawn[1])
        return _LevelReading(levels, [True] * len(moved))
    x, y, z = axes[0][0]
    warn_user(
        f"{path.name}: {len(axes)} lines too steep to drive are left out, as the walls are read as one plan; the first "
        f"at ({x:.1f}, {y:.1f}) from {z:.1f} to {axes[0][-1, 2]:.1f} m"
    )
    steep = {wall[:, :2].tobytes() for wall, _ in found} - {wall[:, :2].tobytes() for wall, _ in walls}
    return _LevelReading(None, [shapely.get_coordinates(shape).tobytes() not in steep for shape in moved])


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
    shafts = [
        dataclasses.replace(shaft, place_m=(shaft.place_m[0] - east, shaft.place_m[1] - north))
        for shaft in heights.shafts
    ]
    return dataclasses.replace(heights, lines=lines, seams=seams, shafts=shafts)


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
