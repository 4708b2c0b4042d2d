"""The work of stage 6: all measures of a world bundle against its plan, by group."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon

from minexplore.bundle import FREE_SPACE, MINE_BODY, RECORD, TOPOLOGY, GeomGroup
from pipeline.errors import ArtifactError
from pipeline.geometry.outline.half_level import trace_half_level
from pipeline.metrics.iou import differing_areas, plan_iou
from pipeline.metrics.leg_widths import LegFigures, measure_legs, sections_along
from pipeline.metrics.navigability import Navigability, cast_columns
from pipeline.metrics.rock.relief import Relief
from pipeline.metrics.size import measure_size, parts_per_wall_m
from pipeline.metrics.topology import compare_topology
from pipeline.metrics.wall_error import WallError, measure_wall_error
from pipeline.mjcf.bundle import (
    OpenedBundle,
    open_bundle,
    part_vertices,
    read_made_by,
)
from pipeline.mjcf.render import render_free_space
from pipeline.params.validation import ValidationParams
from pipeline.proof.certificate import Certificate, certify, measure_containment
from pipeline.proof.claims import require_own_claims
from pipeline.proof.drawn_areas import require_drawn_areas
from pipeline.proof.rebuilt.whole_bundle import require_rock, require_solid, tolerance_of
from pipeline.proof.surface import SeenRock, WallBands, level_rock, report_relief, report_walls, walls_metrics
from pipeline.proof.texture import TextureReport, report_texture, texture_metrics
from pipeline.store.codecs import decode
from pipeline.types import DriftNetwork, FreeSpace, Mask, Survey, SurveyedLegs, lines_of


class Validator:
    """An opened world bundle and the plan for comparison; each measure is computed once, at first use."""

    def __init__(
        self,
        params: ValidationParams,
        bundle: Path,
        cleaned: Mask,
        raw: Mask,
        survey: Survey,
        checked: bool = True,
        traced: Polygon | None = None,
        legs: SurveyedLegs | None = None,
    ) -> None:
        """Open a bundle; without `checked` only the measures judge it, see `open_bundle`.

        With `extent=certificate` the tables of `pipeline.schema` are applied, but nothing is made again. `traced` is
        the outline that stage 2 traced, m, mine frame; without it, the cleaned mask is traced. `legs` are those of a
        survey that is built as a plan.

        Raises
        ------
        ArtifactError
            If the bundle holds what no world may, is not what the builder writes, belongs to another survey, or has
            visible rock where the parameters say that there is none.
        """
        self.params, self.bundle, self.cleaned, self.raw, self.survey = params, bundle, cleaned, raw, survey
        self._traced, self._legs = traced, legs
        self.world: OpenedBundle = open_bundle(bundle, checked)
        _require_overlay(bundle, self.world, params)
        self._tracing = params.network_cell_m, params.network_min_leg_m
        self.free_space: FreeSpace = decode(bundle / FREE_SPACE, FreeSpace)
        self.network: DriftNetwork = decode(bundle / TOPOLOGY, DriftNetwork)
        if checked and params.extent == "full":
            self._require_built()

    def _require_built(self) -> None:
        require_own_claims(self.bundle, read_made_by(self.bundle), self.params)
        self.free_space, grid = require_solid(self.bundle, self.world.record, self.params)
        _require_survey(self.bundle, self.world, self.survey)
        plan, masks = self.free_space, (self.cleaned, self.raw)
        require_drawn_areas(self.bundle / FREE_SPACE, plan.areas, plan.polygon.length, plan.frame, *masks)
        require_rock(self.bundle, self.world.record, self.free_space.polygon, grid, self.params)

    @functools.cached_property
    def world_free(self) -> Mask:
        """Return the pixels that show the floor in a view from above, with the roof hidden."""
        record = self.world.record
        T_world_mine = np.array(record.T_world_mine)
        return render_free_space(self.world.model, T_world_mine, self.survey.frame, record.height_m)

    @functools.cached_property
    def wall_error(self) -> WallError:
        """Return how far the walls stand from those that were traced."""
        frame = self.survey.frame
        traced = self._traced or trace_half_level(self.cleaned.astype(np.float32), frame)
        return measure_wall_error(traced, self.free_space.polygon, self.raw, frame)

    @functools.cached_property
    def columns(self) -> Navigability:
        """Return which free columns of the plan are open in the world."""
        record = self.world.record
        return cast_columns(
            self.world.model,
            np.array(record.T_world_mine),
            self.cleaned,
            self.survey.frame,
            record.height_m,
            tolerance_of(self.params),
            GeomGroup.FLOOR,
            GeomGroup.COLLISION,
        )

    @functools.cached_property
    def legs(self) -> LegFigures:
        """Return how the survey's legs are built."""
        assert self._legs is not None  # the group is measured of surveys that have legs
        first, names = self._legs.first, lines_of(self._legs.names)
        shots = np.array([(k, k + 1) for begin, end in pairwise(first.tolist()) for k in range(begin, end - 1)], int)
        ends = [(names[a], names[b]) for a, b in shots.tolist()]
        sections = sections_along(self._legs.positions_m[shots, :2], self._legs.lrud_m[shots, :2], ends)
        start, radius = self.world.record.spawn.anchor_m, self.params.certificate.robot_radius_m
        return measure_legs(self.free_space.polygon, sections, start, radius, tolerance_of(self.params))

    @property
    def _rock(self) -> SeenRock:
        return level_rock(self.world.visible, self.free_space.polygon, self.network)

    @functools.cached_property
    def texture(self) -> TextureReport:
        """Return the texture report."""
        return report_texture(self._rock, self.params.texture)

    @functools.cached_property
    def relief(self) -> Relief:
        """Return the shape of the visible walls."""
        return report_relief(self._rock, self.params.texture.stretches)

    @functools.cached_property
    def containment(self) -> dict[str, Any]:
        """Return the figures of the containment certificate."""
        return measure_containment(self.bundle, self.world, self.free_space, self.params.certificate, self._tracing)

    @functools.cached_property
    def walls(self) -> WallBands:
        """Return the distances between visible walls and collision walls."""
        height, seed = self.params.robot_height_m, self.params.texture.seed
        return report_walls(self.world.visible, self.free_space.polygon, self.network, height, seed)

    @property
    def certificate(self) -> Certificate:
        """Return the containment certificate."""
        return certify(self.world.record.world_sha256, self.containment, self.params.certificate.limits)

    def measure(self, group: str) -> dict[str, Any]:
        """Return the metrics of one group of `MEASURES`."""
        return MEASURES[group](self)


def _require_overlay(bundle: Path, world: OpenedBundle, params: ValidationParams) -> None:
    """Refuse a world that has visible rock or none against the parameters; the limits on rock depend on them."""
    if world.record.has_visible_rock != (params.overlay != "none"):
        stated = "no visible rock" if not world.record.has_visible_rock else "visible rock"
        raise ArtifactError(f"{bundle / RECORD}: a world with {stated}, but validation.overlay = {params.overlay}")


def _require_survey(bundle: Path, world: OpenedBundle, survey: Survey) -> None:
    """Refuse a world whose plan has another frame than the survey, or whose robots start elsewhere."""
    record = world.record
    if record.plan_frame != survey.frame:
        raise ArtifactError(f"{bundle / RECORD}: plan_frame = {record.plan_frame}, the survey has {survey.frame}")
    if survey.entrance_m is not None and not np.allclose(record.spawn.centre_m, survey.entrance_m, atol=1e-6):
        raise ArtifactError(
            f"{bundle / RECORD}: spawn.centre_m = {record.spawn.centre_m}, the survey's entrance is {survey.entrance_m}"
        )


def _iou(validator: Validator) -> dict[str, float]:
    return plan_iou(validator.world_free, validator.cleaned, validator.raw)


def _navigability(validator: Validator) -> dict[str, Any]:
    return {k: v for k, v in dataclasses.asdict(validator.columns).items() if not isinstance(v, np.ndarray)}


def _topology(validator: Validator) -> dict[str, Any]:
    masks = validator.cleaned, validator.world_free
    return {
        "drift_m": validator.network.total_length_m,
        **vars(compare_topology(*masks, validator.survey.frame, *validator._tracing)),
    }


def _areas(validator: Validator) -> dict[str, float]:
    pixels = float(validator.cleaned.sum()) / validator.survey.frame.px_per_m**2
    return {**vars(validator.world.record.areas), "tunnel_pixels_m2": round(pixels, 3)}


def _collision(validator: Validator) -> dict[str, float]:
    parts = len(part_vertices(validator.world.model, GeomGroup.COLLISION))
    return {"parts": parts, "parts_per_wall_m": parts_per_wall_m(parts, validator.free_space.polygon)}


def _scale(validator: Validator) -> dict[str, float]:
    return {k: v for k, v in vars(validator.survey.scale).items() if isinstance(v, float)}


def _world(validator: Validator) -> dict[str, Any]:
    world, record = validator.world, validator.world.record
    w, _, y, _ = world.model.body(MINE_BODY).quat
    return {
        "bytes": world.bytes,
        "warnings": world.warnings,
        "geoms": int(world.model.ngeom),
        "lights": int(world.model.nlight),
        "floor_zones": len(record.zones),
        "gain_entrance_region_m": record.gain_m["entrance_region"],
        "gain_whole_frame_m": record.gain_m["whole_frame"],
        "tilt_deg": round(math.degrees(2 * math.atan2(y, w)), 4),
    }


def _survey(validator: Validator) -> dict[str, Any]:
    figures = dataclasses.asdict(validator.legs)
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in figures.items()}


MEASURES: dict[str, Callable[[Validator], dict[str, Any]]] = {  # group of metrics.json -> its metrics
    "iou": _iou,
    "against_plan": lambda v: vars(differing_areas(v.world_free, v.cleaned, v.survey.frame.px_per_m)),
    "wall_error": lambda v: vars(v.wall_error),
    "navigability": _navigability,
    "topology": _topology,
    "areas": _areas,
    "collision": _collision,
    "per_m2": lambda v: vars(measure_size(v.free_space.polygon, v.world.record.height_m, v.world.bytes)),
    "survey": _survey,  # of a station survey, or of lines
    "certificate": lambda v: {"holds": v.certificate.holds, **v.containment},
    "texture": lambda v: texture_metrics(v.texture),
    "relief": lambda v: dataclasses.asdict(v.relief),
    "walls": lambda v: walls_metrics(v.walls),
    "scale": _scale,
    "world": _world,
}
