"""Change a bundle, one thing at a time, and judge what becomes of each change.

`python -m benchmarks.faults.judge BUNDLE` changes every field of a level world or a volume; `--every N` tries one of N.
Each change must be refused, or be a claim that the page on security lists.
"""

from __future__ import annotations

import argparse
import atexit
import hashlib
import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from tqdm import tqdm

from benchmarks.faults.changes import Files, every_change, random_change
from benchmarks.worlds.small_world import build_small_world
from minexplore.bundle import (
    MESHES,
    MODEL,
    RECORD,
    SMOOTH_MESHES,
    UNSEALED,
    VOLUME,
    BundleError,
    GeomGroup,
    decode_msh,
    world_sha256,
)
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.sealed.files import read_folder
from minexplore.task import TaskParams
from minexplore.world import load_world
from pieces.run import map_pieces
from pieces.work import HERE, Where, Work, code_sha256
from pipeline.commands.proofs import limits_of_kind
from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.bundle import OpenedBundle, geom_triangles, open_bundle, read_made_by
from pipeline.mjcf.loading import load_model
from pipeline.params.validation import ValidationParams
from pipeline.proof.certificate import certify, measure_containment
from pipeline.proof.claims import claim_of
from pipeline.proof.rebuilt.fittings import require_furniture
from pipeline.proof.rebuilt.same_model import model_difference
from pipeline.proof.rebuilt.whole_bundle import require_built
from pipeline.volume.world.proof.alone import certify_alone, survey_alone
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.derived_content import require_remade
from pipeline.volume.world.surface.furnished import hang_again

CAUGHT, HARMLESS, OTHER_ROCK, MISSED, CRASHED = "caught", "harmless", "other rock", "MISSED", "CRASHED"
CLAIM = "claim"
_HEIGHTS_M, _BEARINGS, _SAME_M = (0.3, 0.5, 1.0, 1.5), 64, 1e-3
_ROUNDING_M = 1e-4  # of corners in 32 bits, up to a kilometre from the origin
_SAME = 1e-5  # of numbers of the compiled model: a mesh of the smooth surface may differ by that


@dataclass(frozen=True)
class Verdict:
    """What became of one mutant: its seed, what was changed, the outcome, and the message or the reason."""

    seed: int
    change: str
    outcome: str
    reason: str


def judge_many(seeds: list[int], where: Where = HERE) -> list[Verdict]:
    """Build the small world, change it by every seed, and return a verdict each.

    Outcomes: refused by an expected error; harmless, with an equal compiled model and equal rays; other rock, where
    only meshes of the rough rock differ and stay closed and within bounds; missed; or crashed by another error.
    """
    code = code_sha256("minesurveys", "minexplore", "pipeline", "stages", "benchmarks")
    return map_pieces(Work("mutants", judge_seed, Verdict, code), seeds, where)


def judge_seed(seed: int) -> Verdict:
    """Change the small world by one seed and return what becomes of it."""
    return judge(_small_world(), compose([]).validation, seed)


@cache
def _small_world() -> Path:
    """Build the small world of this process, which is removed when the process ends."""
    folder = Path(tempfile.mkdtemp(prefix="good-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    build_small_world(folder / "good")
    return folder / "good"


def judge(good: Path, params: ValidationParams, seed: int) -> Verdict:
    """Change the good world by one seed and return what becomes of it."""
    files = read_folder(good)
    change, changed = random_change(files, seed)
    if changed == files:
        return Verdict(seed, change, HARMLESS, "no byte differs")
    with _written(reseal(changed)) as folder:
        return Verdict(seed, change, *_outcome(good, folder, files, changed, params))


def reseal(files: Files) -> Files:
    """Return the files with the hashes that belong to them, where the record is still one."""
    try:
        record = json.loads(files[RECORD])
        record["files"] = {n: hashlib.sha256(d).hexdigest() for n, d in sorted(files.items()) if n not in UNSEALED}
        record["world_sha256"] = world_sha256(record)
        return {**files, RECORD: (json.dumps(record, indent=2) + "\n").encode()}
    except (KeyError, ValueError, TypeError):
        return files


@contextmanager
def _written(files: Files) -> Iterator[Path]:
    """Write a bundle's files into a folder that lives as long as the context."""
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        folder = Path(name) / "world"
        for file, data in files.items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_bytes(data)
        yield folder


def judge_fields(good: Path, every: int = 1, first: int = 0) -> Iterator[tuple[str, str, str]]:
    """Yield what is changed, the outcome, and the message or the claim; of the meshes the first and the last are."""
    files, params = read_folder(good), limits_of_kind(read_made_by(good).kind, [])
    meshes = sorted(name for name in files if name.startswith(MESHES))
    left_out = {*meshes[1:-1]}
    chosen = (one for one in every_change(files) if one[0].partition(":")[0] not in left_out)
    for what, changed in islice(chosen, first, None, every):
        with _written(reseal(changed)) as folder:
            refused = _refusal(folder, prove_volume if (folder / VOLUME).is_file() else prove, params)
        claim = claim_of(what)
        yield (what, *(refused or ((CLAIM, claim) if claim else (MISSED, ""))))


def _refusal(folder: Path, judge_of: Callable[[Path, ValidationParams], object], params: ValidationParams) -> Any:
    """Return the outcome and the message of a bundle that is not accepted, else None."""
    try:
        judge_of(folder, params)
    except MineError as error:
        return CAUGHT, str(error).replace(str(folder), "w")
    except Exception as error:  # the fault that this looks for
        return CRASHED, f"{type(error).__name__}: {error}"
    return None


def _outcome(good: Path, folder: Path, files: Files, changed: Files, params: ValidationParams) -> tuple[str, str]:
    refused = _refusal(folder, prove_and_drive, params)
    if refused:
        return refused
    before, after = load_model(good / MODEL), load_model(folder / MODEL)
    anchor_m = open_bundle(good).record.spawn.anchor_m
    differs = model_difference(before, after, _SAME) or rays_differ(before, after, anchor_m)
    if differs is None:
        return HARMLESS, "equal model, equal rays"
    names = {name for name in {*files, *changed} if files.get(name) != changed.get(name)} - {"world.json"}
    smooth = {f"meshes/{name}.msh" for name in SMOOTH_MESHES}
    if names and all(name.startswith("meshes/") and name not in smooth for name in names):
        return OTHER_ROCK, differs
    if names <= smooth and all(_has_same_corners(files[name], changed[name]) for name in names):
        return HARMLESS, "corners of the smooth surface within rounding"
    return MISSED, differs


def _has_same_corners(one: bytes, other: bytes) -> bool:
    """Return whether two meshes have the same faces, and corners that only rounding to 32 bits parts."""
    before, after = decode_msh(one), decode_msh(other)
    same = before.vertices.shape == after.vertices.shape and np.array_equal(before.faces, after.faces)
    return same and bool(np.abs(before.vertices - after.vertices).max() <= _ROUNDING_M)


def prove(folder: Path, params: ValidationParams) -> OpenedBundle:
    """Judge a bundle as `certify` does, without the stress test, and return it.

    Raises
    ------
    MineError
        With the file, the value and the limit.
    """
    world = open_bundle(folder)
    free_space = require_built(folder, world.record, params)
    if world.warnings:
        raise MineError(f"{folder / MODEL}: {world.warnings} warnings of MuJoCo, want 0")
    limits = {k: v for k, v in params.certificate.limits.items() if k not in ("contacts", "escapes", "deepest_m")}
    settings = params.certificate.model_copy(update={"contacts": 0})
    tracing = params.network_cell_m, params.network_min_leg_m
    certificate = certify("", measure_containment(folder, world, free_space, settings, tracing), limits)
    for name, clause in certificate.clauses.items():
        if not clause.holds:
            raise MineError(f"{folder / MODEL}: {name} = {clause.value}: limit {clause.limit}")
    return world


def prove_volume(folder: Path, params: ValidationParams) -> None:
    """Judge the bundle of a volume as `certify` does, without bodies that are thrown.

    Raises
    ------
    MineError
        With the file, the value and the limit, or the clause.
    """
    world = open_volume(folder)
    require_furniture(folder, world.record.files, params.fittings.furniture, hang_again(folder, world.record.files))
    surveyed = survey_alone(world, params.volume)
    require_remade(folder, world, params.volume, surveyed, floor=params.fittings.floor)
    quiet = params.volume.model_copy(update={"robot_contacts": 0, "ball_contacts": 0})
    for name, clause in certify_alone(world, quiet).clauses.items():
        if not clause.holds:
            raise MineError(f"{folder}: {name} = {clause.value}: limit {clause.limit}")


def prove_and_drive(folder: Path, params: ValidationParams) -> None:
    """Judge a bundle, and load it as the environment does.

    Raises
    ------
    MineError
        With the file, the value and the limit.
    """
    prove(folder, params)
    _drive(folder)


def _drive(folder: Path) -> None:
    """Load a bundle that was judged as the environment does; it must compile without a warning."""
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)
    try:
        world = load_world(folder)
        model = LocalModels(world, TaskParams(), RobotParams()).spec(None).compile()
        mujoco.mj_forward(model, mujoco.MjData(model))
    except BundleError as error:
        raise MineError(str(error)) from error
    finally:
        mujoco.set_mju_user_warning(None)
    if warnings:
        raise RuntimeError(f"a warning of MuJoCo: {warnings[0]}")


def rays_differ(before: mujoco.MjModel, after: mujoco.MjModel, anchor_m: tuple[float, float]) -> str | None:
    """Return how level rays from inside differ between two worlds, at four heights, or None."""
    free = np.array(anchor_m) + np.array([[0.0, 0.0], [0.3, -0.2], [-0.4, 0.3]])
    bearings = np.tile(np.linspace(0, 2 * np.pi, _BEARINGS, endpoint=False), (len(free), 1))
    for group in (GeomGroup.COLLISION, GeomGroup.ROUGH_SURFACE, GeomGroup.SMOOTH_SURFACE):
        casters = [RayCaster(geom_triangles(model, group)) for model in (before, after)]
        for height in _HEIGHTS_M:
            one, two = (caster.fan(free, bearings, height) for caster in casters)
            apart = np.abs(np.where(np.isfinite(one), one, 0.0) - np.where(np.isfinite(two), two, 0.0))
            if apart.max() > _SAME_M:
                return f"group {group.value}: a ray at {height} m differs by {apart.max():.3f} m"
    return None


def summarise(verdicts: list[Verdict]) -> str:
    """Return the counts and the rate of those caught among all that are not harmless."""
    counts = Counter(verdict.outcome for verdict in verdicts)
    judged = sum(counts[outcome] for outcome in (CAUGHT, MISSED, CRASHED))
    shown = ", ".join(f"{counts[outcome]} {outcome}" for outcome in (CAUGHT, HARMLESS, OTHER_ROCK, MISSED, CRASHED))
    return f"{len(verdicts)} random mutants: {shown}; {100 * counts[CAUGHT] / max(1, judged):.2f} % caught"


def main() -> int:
    """Print what is missed, and the counts; exit code 1 if a change is neither refused nor a claim."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("--every", type=int, default=1, help="try one change of so many")
    arguments = parser.parse_args()
    counts = dict.fromkeys((CAUGHT, CLAIM, MISSED, CRASHED), 0)
    for what, outcome, reason in tqdm(judge_fields(arguments.bundle, arguments.every), desc="fields", disable=None):
        counts[outcome] += 1
        if outcome != CAUGHT:
            tqdm.write(f"{outcome}  {what}: {reason}", file=sys.stdout)
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    return 1 if counts[MISSED] or counts[CRASHED] else 0


if __name__ == "__main__":
    sys.exit(main())
