"""Stage 6: measure the world bundle against the plan and the real rock, and hold the figures to their limits."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import MODEL, RECORD
from pipeline.metrics.iou import joined_to, plan_iou
from pipeline.metrics.limits import breaches, flatten, is_time, require_limits
from pipeline.metrics.size import load_per_m2
from pipeline.mjcf.load_time import LoadCost, measure_load
from pipeline.mjcf.loading import read_spec
from pipeline.mjcf.render import render_free_space
from pipeline.mjcf.visible import compile_with
from pipeline.params.validation import ReplayParams, ValidationParams
from pipeline.progress import counted, progress
from pipeline.proof.certificate import Certificate
from pipeline.proof.drawn_areas import require_drawn_areas
from pipeline.proof.groups import applying_limits, is_measured, why_rock_is_not_judged
from pipeline.proof.lidar.replay import replay_sweeps
from pipeline.proof.lidar.swept import SweptWorld, swept_level
from pipeline.proof.rebuilt.fittings import require_furniture
from pipeline.proof.validator import MEASURES, Validator
from pipeline.report.figures.graph import blocked_table
from pipeline.report.figures.plans import draw_agreement
from pipeline.stage import Artifact, Stage, by_model, main
from pipeline.store.codecs import Bundle, decode
from pipeline.store.mine_survey import WORKINGS, MineSurvey, volume_of
from pipeline.types import DrawnFloors, DrawnPlan, Mask, SurveyedLegs, VolumeShape, Workings


def _validate_level(
    params: ValidationParams,
    mine: MineSurvey,
    world: Path,
    cleaned: Mask,
    raw: Mask,
    traced: Path,
) -> dict[str, Any]:
    """Return the metrics, the load times, the certificate, and reports and pictures as evidence."""
    legs = mine.shape.legs if isinstance(mine.shape, DrawnPlan) else None
    workings: Workings = decode(traced / WORKINGS, Workings)
    groups = [g for g in MEASURES if is_measured(g, params) and (g != "survey" or legs is not None)]
    validator = Validator(params, world, cleaned, raw, mine.survey, traced=workings.polygons.geoms[0], legs=legs)
    metrics = {group: validator.measure(group) for group in counted(groups, "validation", "measures")}
    if params.extent == "certificate":
        timings, evidence = {"world_sha256": validator.world.record.world_sha256}, dict[str, Any]()
    else:
        evidence = _evidence(params, validator)
        timings = _timings(validator, measure_load(world / MODEL))
    return {"metrics": metrics, "timings": timings, "certificate": validator.certificate, "evidence": evidence}


def _seen_plan(mine: MineSurvey, shape: VolumeShape, traced: Path) -> BaseGeometry:
    """Return a volume seen from above, m, mine frame: the survey's workings, or of a traced plan its floors."""
    if shape is mine.shape:
        return shapely.union_all(shapely.get_parts(decode(traced / WORKINGS, Workings).polygons))
    assert isinstance(shape, DrawnFloors)
    return shapely.union_all(shapely.polygons(shape.mesh.vertices[shape.mesh.faces][:, :, :2]))


def _validate_volume(
    params: ValidationParams,
    mine: MineSurvey,
    world: Path,
    cleaned: Mask,
    raw: Mask,
    traced: Path,
) -> dict[str, Any]:
    from pipeline.volume.world.proof.again.seen import require_surveyed_plan
    from pipeline.volume.world.proof.certificate import (  # open3d takes a second to load
        open_volume,
        seen_volume,
        validate_volume,
    )
    from pipeline.volume.world.proof.derived_content import require_remade
    from pipeline.volume.world.proof.levelled import measure_volume_texture
    from pipeline.volume.world.proof.swept import swept_volume
    from pipeline.volume.world.surface.furnished import hang_again

    done = progress("validation", 5, "steps")
    opened, frame, shape = open_volume(world), mine.survey.frame, volume_of(mine, traced)
    done.update()
    files = opened.record.files
    require_furniture(world, files, params.fittings.furniture, hang_again(world, files))
    done.update()
    legs = shape if isinstance(shape, SurveyedLegs) else None  # those of other shapes follow their floors
    require_remade(world, opened, params.volume, legs, shape, params.fittings.floor)
    plan = _seen_plan(mine, shape, traced)
    require_surveyed_plan(world, opened.record, frame, plan)
    require_drawn_areas(world / RECORD, opened.record.areas, plan.length, frame, cleaned, raw)
    done.update()
    found = validate_volume(params.volume, opened, shape)
    done.update()
    seen_from = dataclasses.replace(opened, mine=seen_volume(params.volume, opened))
    rock = measure_volume_texture(seen_from, params.texture)
    done.update()
    done.close()
    metrics, evidence = found.metrics, dict[str, Any]()
    if shape is not mine.shape and params.extent == "full":  # a traced plan
        model, record = compile_with(read_spec(world / MODEL), world / MODEL), opened.record
        seen = render_free_space(model, np.array(record.T_world_mine), frame, record.volume.high_m)
        seen = joined_to(seen, frame, record.spawn.anchor_m[:2])  # parts of floors reach under the rock
        metrics = metrics | {"iou": plan_iou(seen, cleaned, raw)}
        evidence["agreement.png"] = draw_agreement(cleaned, seen)
    if rock is not None:
        from pipeline.report.figures.texture import draw_heat, draw_texture

        metrics = metrics | rock.metrics
        evidence |= {
            "texture.json": rock.texture,
            "texture.png": draw_texture(rock.texture),
            "heat.png": draw_heat(rock.texture, rock.floors),
        }
    if opened.rock:
        from pipeline.volume.world.surface.views import draw_volume_views

        evidence["views.png"] = draw_volume_views(world, opened.record, opened.legs, plan)
        if params.extent == "full":
            evidence |= replayed_evidence(params.replay, lambda: swept_volume(world, opened))
    if found.scan is not None:
        from pipeline.report.figures.deviation import draw_deviation

        scan = found.scan
        rays = None if found.rays is None else (found.rays.ends_m, found.rays.off_m, found.rays.figures)
        picture = draw_deviation(scan.points_m, scan.off_m, scan.unseen_m, frame, scan.figures, rays)
        evidence["deviation.png"] = picture
    timings = {"world_sha256": found.certificate.world_sha256}
    return {"metrics": metrics, "timings": timings, "certificate": found.certificate, "evidence": evidence}


validate_world = by_model(level=_validate_level, volume=_validate_volume)


def _timings(validator: Validator, cost: LoadCost) -> dict[str, Any]:
    """Return the world's hash, the cost of loading it, and that cost per square metre of rock."""
    per_m2 = load_per_m2(cost.load_s, cost.load_memory_mb, validator.measure("per_m2")["rock_m2"])
    digest = validator.world.record.world_sha256
    return {"world_sha256": digest, "world": dataclasses.asdict(cost), "per_m2": per_m2}


def _evidence(params: ValidationParams, validator: Validator) -> dict[str, Any]:
    """Return the reports and pictures of a level world."""
    columns = validator.columns
    evidence = {
        "agreement.png": draw_agreement(validator.cleaned, validator.world_free),
        "blocked.csv": blocked_table(columns.blocked_places_m, columns.blocked_depths_m, columns.wall_band_m),
    }
    return evidence if params.overlay == "none" else evidence | _evidence_of_rock(params, validator)


def _evidence_of_rock(params: ValidationParams, validator: Validator) -> dict[str, Any]:
    """Return the reports and pictures of the visible rock; Matplotlib, which draws them, takes 0.4 s to load."""
    from pipeline.report.figures.texture import draw_heat, draw_texture
    from pipeline.report.figures.views import draw_views

    free = validator.free_space.polygon
    return {
        "views.png": draw_views(validator.bundle, validator.world, free, validator.network),
        "texture.json": validator.texture,
        "texture.png": draw_texture(validator.texture),
        "heat.png": draw_heat(validator.texture, free),
        **replayed_evidence(params.replay, lambda: swept_level(validator.world, free)),
    }


def replayed_evidence(params: ReplayParams, opened: Callable[[], SweptWorld]) -> dict[str, Any]:
    """Return the report and the picture of the survey's sweeps in a world, which is opened if there are any."""
    if params.poses is None or not params.sweeps:
        return {}
    from pipeline.report.figures.replay import draw_replay

    world, sweeps = opened(), {name: Path(file) for name, file in params.sweeps.items()}
    replay = replay_sweeps(world, Path(params.poses), sweeps, params)
    return {"replay.json": replay.report, "replay.png": draw_replay(replay, world.plan)}


def replayed_files(params: ValidationParams) -> list[str]:
    """List the registered files that stage 6 reads."""
    return [params.replay.poses, *params.replay.sweeps.values()] if params.replay.poses else []


def check_limits(params: ValidationParams, outputs: Mapping[str, Any]) -> None:
    """Fail the stage when a metric breaches its limit in conf; a load time depends on the machine and only warns."""
    timings, figures = flatten(outputs["timings"]), flatten(outputs["metrics"])
    limits, reason = applying_limits(params, figures), why_rock_is_not_judged(params, figures)
    if reason and "texture.draws" in figures:
        print(f"validation: {reason}")
    timed = {name: limit for name, limit in limits.items() if name in timings and is_time(name)}
    for line in breaches(timings, timed):
        print(
            f"validation: {line}, on this machine at its present load (`python -m benchmarks bench-pipeline` "
            f"judges it)",
            file=sys.stderr,
        )
    untimed = {name: limit for name, limit in limits.items() if name not in timed}
    require_limits(figures | timings, untimed)


STAGE = Stage(
    name="validation",
    run=validate_world,
    check=check_limits,
    sources=replayed_files,
    reads={
        "mine": Artifact("survey/mine", MineSurvey),
        "world": Artifact("realism/world", Bundle),
        "cleaned": Artifact("contours/cleaned.png", Mask),
        "raw": Artifact("contours/raw.png", Mask),
        "traced": Artifact("contours/traced", Bundle),
    },
    writes={
        "metrics": Artifact("validation/metrics.json", dict, in_git=True),
        "timings": Artifact("validation/timings.json", dict, volatile=True),
        "certificate": Artifact("validation/certificate.json", Certificate),
        "evidence": Artifact("validation/evidence", Bundle),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
