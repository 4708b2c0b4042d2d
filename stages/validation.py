"""Stage 6: measure the world bundle against the plan and the real rock, and hold the figures to their limits."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from minexplore.bundle import MODEL
from pipeline.metrics.limits import breaches, flatten, is_time, require_limits
from pipeline.metrics.size import load_per_m2
from pipeline.mjcf.load_time import LoadCost, measure_load
from pipeline.params.validation import ReplayParams, ValidationParams
from pipeline.proof.certificate import Certificate
from pipeline.proof.groups import applying_limits, is_measured, why_rock_is_not_judged
from pipeline.proof.lidar.replay import replay_sweeps
from pipeline.proof.lidar.replay_report import Replay, ReplayReport
from pipeline.proof.rebuilt.fittings import require_furniture
from pipeline.proof.texture import TextureReport
from pipeline.proof.validator import MEASURES, Validator
from pipeline.report.figures.graph import blocked_table
from pipeline.report.figures.plans import draw_agreement
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle
from pipeline.types import (
    NO_FLOORS,
    NO_LEGS,
    NO_PICTURE,
    NO_SOLID,
    ClosedMesh,
    FloorMesh,
    Image,
    Mask,
    Survey,
    SurveyedLegs,
    Workings,
)


def validate_world(
    params: ValidationParams,
    world: Path,
    cleaned: Mask,
    raw: Mask,
    survey: Survey,
    traced: Workings,
    network: SurveyedLegs = NO_LEGS,
    solid: ClosedMesh = NO_SOLID,
    floors: FloorMesh = NO_FLOORS,
    level_legs: SurveyedLegs = NO_LEGS,
) -> dict[str, Any]:
    """Return the metrics, the load times, the certificate, and reports and pictures as evidence."""
    if len(floors) or len(network) or len(solid):
        return _validate_volume(params, world, survey, traced, network, solid, floors)
    whole, groups = params.extent != "certificate", [group for group in MEASURES if is_measured(group, params)]
    groups = [group for group in groups if group != "survey" or len(level_legs)]
    validator = Validator(params, world, cleaned, raw, survey, traced=traced.polygons.geoms[0], legs=level_legs)
    if not whole:
        metrics = {group: validator.measure(group) for group in groups}
        timings = {"world_sha256": validator.world.record.world_sha256}
        return {"metrics": metrics, "timings": timings, "certificate": validator.certificate, **_NOTHING_ELSE}
    metrics = {group: validator.measure(group) for group in groups}
    evidence = _pictures(params, validator) | _evidence(params, validator)
    return {"metrics": metrics, "timings": _timings(validator, measure_load(world / MODEL)), **evidence}


def _validate_volume(
    params: ValidationParams,
    world: Path,
    survey: Survey,
    traced: Workings,
    network: SurveyedLegs,
    solid: ClosedMesh,
    floors: FloorMesh,
) -> dict[str, Any]:
    """Return the outputs of this stage for a world that is one volume."""
    from pipeline.volume.world.proof.again.seen import require_surveyed_plan
    from pipeline.volume.world.proof.certificate import (  # open3d takes a second to load
        open_volume,
        validate_volume,
    )
    from pipeline.volume.world.proof.levelled import measure_volume_texture
    from pipeline.volume.world.proof.remade import require_remade
    from pipeline.volume.world.surface.furnished import hang_again

    opened = open_volume(world)
    files = opened.record.files
    require_furniture(world, files, params.fittings.furniture, hang_again(world, files))
    require_remade(world, opened, params.volume, *_survey_of(network, solid, floors))
    require_surveyed_plan(world, opened.record, survey.frame, traced.polygons)
    found = validate_volume(params.volume, opened, network, solid, floors)
    rock = measure_volume_texture(opened, params.texture)
    metrics, evidence = found.metrics, dict[str, Any]()
    if rock is not None:
        from pipeline.report.figures.texture import draw_heat, draw_texture

        metrics = metrics | rock.metrics
        pictures = {"texture_picture": draw_texture(rock.texture), "heat": draw_heat(rock.texture, rock.floors)}
        evidence = {"texture": rock.texture, **pictures}
    if opened.rock:
        from pipeline.volume.world.surface.views import draw_volume_views

        evidence["views"] = draw_volume_views(world, opened.record, opened.legs)
    if found.scan is not None:
        from pipeline.report.figures.deviation import draw_deviation

        scan = found.scan
        rays = None if found.rays is None else (found.rays.ends_m, found.rays.off_m, found.rays.figures)
        picture = draw_deviation(scan.points_m, scan.off_m, scan.unseen_m, survey.frame, scan.figures, rays)
        evidence["deviation"] = picture
    timings = {"world_sha256": found.certificate.world_sha256}
    return {"metrics": metrics, "timings": timings, "certificate": found.certificate, **_NOTHING_ELSE, **evidence}


def _survey_of(network: SurveyedLegs, solid: ClosedMesh, floors: FloorMesh) -> tuple[SurveyedLegs | None, float]:
    """Return the legs of a survey, None where a world's legs follow its floors, and the elevation of z = 0."""
    if len(floors):
        return None, floors.datum_m
    return (None, solid.datum_m) if len(solid) else (network, network.datum_m)


def _timings(validator: Validator, cost: LoadCost) -> dict[str, Any]:
    """Return the world's hash, the cost of loading it, and that cost per square metre of rock."""
    per_m2 = load_per_m2(cost.load_s, cost.load_memory_mb, validator.measure("per_m2")["rock_m2"])
    digest = validator.world.record.world_sha256
    return {"world_sha256": digest, "world": dataclasses.asdict(cost), "per_m2": per_m2}


def _pictures(params: ValidationParams, validator: Validator) -> dict[str, Image]:
    """Return what is drawn of the world."""
    pictures = {"agreement": draw_agreement(validator.cleaned, validator.world_free), "views": NO_PICTURE}
    if params.overlay != "none":
        from pipeline.report.figures.views import draw_views

        pictures["views"] = draw_views(
            validator.bundle, validator.world, validator.free_space.polygon, validator.network
        )
    return pictures


def _evidence(params: ValidationParams, validator: Validator) -> dict[str, Any]:
    """Return the certificate, the reports and their pictures."""
    columns = validator.columns
    return {
        "certificate": validator.certificate,
        "deviation": NO_PICTURE,
        "blocked": blocked_table(columns.blocked_places_m, columns.blocked_depths_m, columns.wall_band_m),
        **(_NO_ROCK if params.overlay == "none" else _evidence_of_rock(params, validator)),
    }


def _evidence_of_rock(params: ValidationParams, validator: Validator) -> dict[str, Any]:
    """Return the reports and pictures of the visible rock; Matplotlib, which draws them, takes 0.4 s to load."""
    from pipeline.report.figures.replay import draw_replay
    from pipeline.report.figures.texture import draw_heat, draw_texture

    free, replay = validator.free_space.polygon, _replay(params.replay, validator)
    return {
        "texture": validator.texture,
        "texture_picture": draw_texture(validator.texture),
        "heat": draw_heat(validator.texture, free),
        "replay": replay.report,
        "replay_picture": draw_replay(replay, free),
    }


_NO_ROCK: dict[str, Any] = {
    "texture": None,
    "texture_picture": NO_PICTURE,
    "heat": NO_PICTURE,
    "replay": ReplayReport({}),
    "replay_picture": NO_PICTURE,
}
_NOTHING_ELSE: dict[str, Any] = {
    "agreement": NO_PICTURE,
    "views": NO_PICTURE,
    "deviation": NO_PICTURE,
    "blocked": "",
    **_NO_ROCK,
}


def _replay(params: ReplayParams, validator: Validator) -> Replay:
    if params.poses is None or not params.sweeps:
        return Replay(ReplayReport({}))
    sweeps = {name: Path(file) for name, file in params.sweeps.items()}
    return replay_sweeps(validator.world, validator.free_space.polygon, Path(params.poses), sweeps, params)


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
        "world": Artifact("realism/world", Bundle),
        "cleaned": Artifact("contours/cleaned.png", Mask),
        "raw": Artifact("contours/raw.png", Mask),
        "survey": Artifact("survey/survey.json", Survey),
        "traced": Artifact("contours/traced.geojson", Workings),
        "network": Artifact("survey/network.npz", SurveyedLegs),
        "solid": Artifact("survey/solid.npz", ClosedMesh),
        "floors": Artifact("contours/floors.npz", FloorMesh),
        "level_legs": Artifact("survey/level_legs.npz", SurveyedLegs),
    },
    writes={
        "metrics": Artifact("validation/metrics.json", dict, in_git=True),
        "timings": Artifact("validation/timings.json", dict, volatile=True),
        "certificate": Artifact("validation/certificate.json", Certificate),
        "agreement": Artifact("validation/agreement.png", Image),
        "deviation": Artifact("validation/deviation.png", Image),
        "blocked": Artifact("validation/blocked.csv", str),
        "texture": Artifact("validation/texture.json", TextureReport | None),
        "texture_picture": Artifact("validation/texture.png", Image),
        "heat": Artifact("validation/heat.png", Image),
        "views": Artifact("validation/views.png", Image),
        "replay": Artifact("validation/replay.json", ReplayReport),
        "replay_picture": Artifact("validation/replay.png", Image),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
