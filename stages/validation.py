"""Stage 6: measure the world bundle against the plan: agreement, open columns, topology, collision walls."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from pipeline.evidence import TextureReport, report_texture, report_walls, texture_metrics
from pipeline.geometry.collision import footprint_errors
from pipeline.metrics.iou import intersection_over_union
from pipeline.metrics.limits import require_limits
from pipeline.metrics.navigability import Navigability, cast_columns
from pipeline.metrics.topology import compare_topology
from pipeline.mjcf.bundle import World, open_bundle, part_vertices
from pipeline.mjcf.render import render_free_space
from pipeline.params.validation import ValidationParams
from pipeline.report.graph import blocked_table
from pipeline.report.plans import draw_agreement
from pipeline.report.texture import draw_heat, draw_texture
from pipeline.report.views import draw_views
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle, decode
from pipeline.types import DriftNetwork, FreeSpace, Image, Mask, Survey


def validate_world(params: ValidationParams, world: Path, cleaned: Mask, raw: Mask, survey: Survey) -> dict[str, Any]:
    """Return the metrics, the agreement picture and the places of blocked columns."""
    opened = open_bundle(world)
    record, frame = opened.record, survey.frame
    T_world_mine, groups = np.array(record.T_world_mine), record.geom_groups
    free_space = decode(world / "free_space.geojson", FreeSpace)
    network = decode(world / "topology.json", DriftNetwork)
    seen = render_free_space(opened.model, T_world_mine, frame, record.height_m)
    columns = cast_columns(
        opened.model, T_world_mine, cleaned, frame, record.height_m, free_space.tolerance_m,
        groups["floor"], groups["rock"],
    )  # fmt: skip
    box = shapely.box(*record.world_m)
    parts = part_vertices(opened.model, groups["rock"])
    intrusion, missing = footprint_errors(parts, free_space.polygon, box)
    texture = report_texture(opened.model, free_space.polygon, network, params.texture)
    walls = report_walls(opened.model, free_space.polygon, network, params.robot_height_m, params.texture.seed)
    metrics = {
        "iou": {
            "free_space_vs_cleaned": round(intersection_over_union(seen, cleaned), 6),
            "free_space_vs_raw": round(intersection_over_union(seen, raw), 6),
            "rock": round(intersection_over_union(~seen, ~cleaned), 6),
        },
        "navigability": _counts(columns),
        "topology": vars(compare_topology(cleaned, seen, frame, params.network_cell_m, params.network_min_leg_m)),
        "areas": {**vars(record.areas), "tunnel_pixels_m2": round(float(cleaned.sum()) / frame.px_per_m**2, 3)},
        "collision": {"parts": len(parts), "intrusion_m2": round(intrusion, 6), "missing_m2": round(missing, 6)},
        "texture": texture_metrics(texture),
        "walls": vars(walls),
        "scale": {k: v for k, v in vars(survey.scale).items() if isinstance(v, float)},
        "world": _facts(opened),
    }
    return {
        "metrics": metrics,
        "agreement": draw_agreement(cleaned, seen),
        "blocked": blocked_table(columns.blocked_places_m, columns.blocked_depths_m, columns.wall_band_m),
        "texture": texture,
        "texture_picture": draw_texture(texture),
        "heat": draw_heat(texture, free_space.polygon),
        "views": draw_views(opened, network),
    }


def _counts(columns: Navigability) -> dict[str, Any]:
    return {k: v for k, v in dataclasses.asdict(columns).items() if not isinstance(v, np.ndarray)}


def _facts(world: World) -> dict[str, Any]:
    model, record = world.model, world.record
    w, _, y, _ = model.body("mine").quat
    tilt_deg = math.degrees(2 * math.atan2(y, w))
    return {
        "bytes": world.bytes,
        "load_s": round(world.load_s, 4),
        "warnings": world.warnings,
        "geoms": int(model.ngeom),
        "lights": int(model.nlight),
        "floor_zones": len(record.zones),
        "tilt_deg": round(tilt_deg, 4),
        "tilt_error_deg": round(abs(tilt_deg - record.tilt_deg), 6),
        "gain_entrance_region_m": record.gain_m["entrance_region"],
        "gain_whole_frame_m": record.gain_m["whole_frame"],
    }


def check_limits(params: ValidationParams, outputs: Mapping[str, Any]) -> None:
    """Fail the stage when a metric breaches its limit in conf."""
    require_limits(outputs["metrics"], params.limits)


STAGE = Stage(
    name="validation",
    run=validate_world,
    check=check_limits,
    reads={
        "world": Artifact("realism/world", Bundle),
        "cleaned": Artifact("contours/cleaned.png", Mask),
        "raw": Artifact("contours/raw.png", Mask),
        "survey": Artifact("survey/survey.json", Survey),
    },
    writes={
        "metrics": Artifact("validation/metrics.json", dict, volatile=("world.load_s",)),
        "agreement": Artifact("validation/agreement.png", Image),
        "blocked": Artifact("validation/blocked.csv", str),
        "texture": Artifact("validation/texture.json", TextureReport),
        "texture_picture": Artifact("validation/texture.png", Image),
        "heat": Artifact("validation/heat.png", Image),
        "views": Artifact("validation/views.png", Image),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
