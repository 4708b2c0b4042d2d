"""Stage 2: the plan's free space as a polygon with islands, and its drift network (metres, mine frame)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from minesurveys.remarks import warn_user
from pipeline.errors import GeometryError, ParamsError
from pipeline.geometry.floor.network_heights import plan_floors
from pipeline.geometry.floor.simplified_outline import (
    NetworkGrid,
    SimplifiedOutline,
    simplify_by_tolerance,
    simplify_by_wall_error,
)
from pipeline.geometry.network.plan_network import plan_network, seen_network
from pipeline.geometry.outline.binarize import binarize, clean_mask, fill_islands, require_workings
from pipeline.geometry.outline.components import choose_component, choose_mask_component, mend
from pipeline.geometry.outline.half_level import cover_of, trace_half_level
from pipeline.geometry.outline.left_out import drawn_islands, islands_of, unconnected_m2, warn_of_islands
from pipeline.geometry.outline.outer_walls import count_islands, filled
from pipeline.geometry.outline.trace import trace_outline
from pipeline.geometry.rasterize import fill_polygon
from pipeline.params.contours import ContoursParams
from pipeline.progress import progress
from pipeline.report.figures.graph import width_table
from pipeline.report.figures.plans import draw_contours
from pipeline.scans.correct import Correction, correct_by_sweeps, read_sweeps
from pipeline.stage import Artifact, Stage, by_model, main
from pipeline.store.codecs import Bundle
from pipeline.store.mine_survey import FLOORS, WORKINGS, MineSurvey
from pipeline.types import (
    Areas,
    DrawnPlan,
    DriftNetwork,
    Frame,
    FreeSpace,
    Image,
    Mask,
    Survey,
    SurveyedLegs,
    Workings,
)

_APART_PX = 2.0  # pixels so far apart do not touch, not even at a corner


@dataclass(frozen=True)
class _Traced:
    """The workings (m, mine frame), and the pixels that show them, as they are drawn and cleaned."""

    workings: Polygon | MultiPolygon
    raw: Mask
    cleaned: Mask


def _trace_volume(params: ContoursParams, mine: MineSurvey) -> dict[str, Any]:
    """Trace a plan with heights and find its floors; what is built as it was surveyed is seen from above."""
    if not isinstance(mine.shape, DrawnPlan):
        return _view_from_above(params, mine)
    traced, heights = _trace_plan(params, mine), mine.survey.heights
    assert heights is not None
    floors = plan_floors(traced["free_space"].polygon, heights, traced["topology"], mine.survey.entrance_m)
    return {**traced, "traced": {**traced["traced"], FLOORS: floors}}


def _trace_plan(params: ContoursParams, mine: MineSurvey) -> dict[str, Any]:
    frame = mine.survey.frame
    with progress("contours", 4, "steps") as done:
        with _named(mine):
            drawn = _trace(params, mine)
            done.update()
            correction = _correct(params, drawn.workings)
        corrected = drawn if correction is None else _drawn_again(correction.polygon, frame)
        done.update()
        simplified = _simplify(params, corrected.workings)
        done.update()
        drifts, outline = simplified.network, simplified.outline
        evidence = _evidence(corrected.raw, outline, drifts, frame)
        done.update()
    return {
        "raw": corrected.raw,
        "cleaned": corrected.cleaned,
        "traced": {WORKINGS: Workings(MultiPolygon(shapely.get_parts(corrected.workings).tolist()))},
        "free_space": FreeSpace(outline, _measure_areas(outline, corrected, frame), simplified.moved_m, frame),
        "topology": drifts,
        "evidence": {
            **evidence,
            **({} if correction is None else _evidence_of(drawn.workings, correction, frame)),
        },
    }


# Returns the binarised plan, the cleaned plan, the free space, its drift network, floors, a picture and tables.
trace_free_space = by_model(level=_trace_plan, volume=_trace_volume)


def find_workings(params: ContoursParams, mine: MineSurvey) -> Mask | None:
    """Find or refuse a plan's workings as `trace_free_space` does, and remark on what is left out; trace no walls.

    Returns them as a mask of the plan's pixels; None of a survey that is no plan.
    """
    if not isinstance(mine.shape, DrawnPlan):
        return None
    with _named(mine):
        _, raw, cleaned = _find(params, mine)
    unconnected_m2(raw, cleaned, mine.survey.frame)
    return cleaned


@contextmanager
def _named(mine: MineSurvey) -> Iterator[None]:
    """Name the survey's file in a refusal."""
    try:
        yield
    except GeometryError as error:
        raise GeometryError(f"{mine.source}: {error}") from error


def _view_from_above(params: ContoursParams, mine: MineSurvey) -> dict[str, Any]:
    """Return the plan view of a volume, which pictures and the report have; nothing is traced."""
    workings, frame = mine.workings, mine.survey.frame
    assert workings is not None
    seen: BaseGeometry = shapely.union_all(shapely.get_parts(workings.polygons))
    outline = seen if isinstance(seen, Polygon | MultiPolygon) else workings.polygons
    drawn = _drawn_again(outline, frame)
    if isinstance(mine.shape, SurveyedLegs):
        network = plan_network(mine.shape, params.network.cell_m)
    else:
        network = seen_network(outline, **dict(params.network))
    return {
        "raw": drawn.raw,
        "cleaned": drawn.cleaned,
        "traced": {WORKINGS: workings},
        "free_space": FreeSpace(outline, _measure_areas(outline, drawn, frame), 0.0, frame),
        "topology": network,
        "evidence": _evidence(drawn.raw, outline, network, frame),
    }


def _evidence(raw: Mask, outline: Polygon | MultiPolygon, drifts: DriftNetwork, frame: Frame) -> dict[str, Any]:
    """Return what no other stage reads."""
    return {
        "widths.csv": width_table(drifts),
        "contours.png": draw_contours(raw, outline, drifts, frame),
    }


def _evidence_of(drawn: Polygon | MultiPolygon, correction: Correction, frame: Frame) -> dict[str, Any]:
    """Return the figures and the picture of corrected walls; Matplotlib takes 0.4 s to load, and few have sweeps."""
    from pipeline.report.figures.corrected import draw_corrected

    return {"correction.json": correction.report, "corrected.png": draw_corrected(drawn, correction, frame)}


def _find(params: ContoursParams, mine: MineSurvey) -> tuple[Polygon | None, Mask, Mask]:
    """Return a vector survey's workings, None of a picture, and the pixels that show them, as drawn and cleaned."""
    survey, frame = mine.survey, mine.survey.frame
    places = chosen_places(params, survey)
    if mine.workings is None:
        raw, cleaned = _read_mask(params, mine.plan, survey, places)
        require_workings(raw, cleaned, frame.px_per_m, params.min_tunnel_m2, params.max_workings_share)
        return None, raw, cleaned
    workings = mine.workings.polygons
    components = mend(workings, params.bridge_m, params.min_island_m2)
    chosen = choose_component(components, places)
    warn_of_islands(islands_of(workings, chosen, params.min_island_m2), params.min_island_m2)
    raw = fill_polygon(workings, frame) & ~_touching(components, chosen, frame)
    return chosen, raw, fill_polygon(chosen, frame)


def _trace(params: ContoursParams, mine: MineSurvey) -> _Traced:
    """Return the workings, traced where they are drawn."""
    (found, raw, cleaned), frame = _find(params, mine), mine.survey.frame
    if found is not None:
        return _Traced(found, raw, cleaned)
    cover = None if params.trace == "pixels" else cover_of(mine.plan, raw, cleaned)
    traced = trace_outline(cleaned, frame) if cover is None else trace_half_level(cover, frame)
    return _Traced(traced, raw, cleaned)


def _touching(components: MultiPolygon, chosen: Polygon, frame: Frame) -> Mask:
    """Return the pixels of other components that would connect them to the chosen one in a picture."""
    others = [component for component in components.geoms if component is not chosen]
    near = chosen.buffer(_APART_PX / frame.px_per_m)
    return fill_polygon(shapely.union_all(others).intersection(near).difference(chosen), frame)


def _drawn_again(workings: Polygon | MultiPolygon, frame: Frame) -> _Traced:
    """Return workings whose drawing is made of them."""
    mask = fill_polygon(workings, frame)
    return _Traced(workings, mask, mask)


def _simplify(params: ContoursParams, traced: Polygon | MultiPolygon) -> SimplifiedOutline:
    """Return the simplified outline and its drift network."""
    grid = NetworkGrid(params.network.cell_m, params.network.min_leg_m, params.network.station_spacing_m)
    assert isinstance(traced, Polygon)
    if params.tolerance_m is not None:
        return simplify_by_tolerance(traced, params.tolerance_m, grid)
    return simplify_by_wall_error(traced, params.wall_error_m, grid)


def _measure_areas(outline: Polygon | MultiPolygon, traced: _Traced, frame: Frame) -> Areas:
    outer = filled(outline)
    return Areas(
        tunnel_m2=round(outline.area, 3),
        islands_m2=round(outer.area - outline.area, 3),
        outside_m2=round(shapely.box(*frame.extent_m).difference(outer).area, 3),
        islands=count_islands(outline),
        traced_tunnel_m2=round(traced.workings.area, 3),
        unconnected_m2=round(unconnected_m2(traced.raw, traced.cleaned, frame), 3),
    )


def _correct(params: ContoursParams, traced: Polygon | MultiPolygon) -> Correction | None:
    """Correct the traced walls by the survey's sweeps, if the parameters say so, and print by how much."""
    if params.correct is None or params.poses is None:
        return None
    poses = params.poses
    files = {name: Path(file) for name, file in poses.sweeps.items()}
    sweeps = read_sweeps(Path(poses.file), files, poses.max_range_m, poses.max_range_var_m2)
    correction = correct_by_sweeps(traced, sweeps)
    warn_user(correction.report.summary(), of="contours", option="survey.correct=null")
    return correction


def sweep_files(params: ContoursParams) -> list[str]:
    """List the registered files that stage 2 reads: poses and sweeps, if they correct the walls."""
    return [params.poses.file, *params.poses.sweeps.values()] if params.correct and params.poses else []


def chosen_places(params: ContoursParams, survey: Survey) -> list[tuple[float, float]]:
    """Return the places (m, mine frame) that the workings must contain; none if the largest component is kept."""
    if params.components == "largest":
        return []
    if params.components != "spawn":
        return list(params.components)
    if survey.entrance_m is None:
        raise ParamsError("contours.components = spawn: needs survey.entrance_m")
    return [survey.entrance_m]


def _read_mask(
    params: ContoursParams, plan: Image, survey: Survey, places: list[tuple[float, float]]
) -> tuple[Mask, Mask]:
    """Return the workings in the plan's picture, and the same cleaned."""
    frame, scale = survey.frame, survey.frame.px_per_m
    threshold = None if params.threshold == "otsu" else params.threshold
    margin = params.annotation_margin_m * scale
    raw = binarize(plan, threshold, params.annotation_chroma, margin, survey.ignore_boxes_px)
    drawn = clean_mask(raw, params.bridge_m * scale, params.despeck_m * scale)
    chosen = choose_mask_component(drawn, frame, places)
    cleaned = fill_islands(chosen, params.min_island_m2 * scale**2)
    warn_of_islands(drawn_islands(cleaned & ~chosen, frame), params.min_island_m2)
    return raw, cleaned


STAGE = Stage(
    name="contours",
    run=trace_free_space,
    sources=sweep_files,
    reads={"mine": Artifact("survey/mine", MineSurvey)},
    writes={
        "raw": Artifact("contours/raw.png", Mask),
        "cleaned": Artifact("contours/cleaned.png", Mask),
        "traced": Artifact("contours/traced", Bundle),
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "evidence": Artifact("contours/evidence", Bundle),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
