"""Change a small world at random, many times, and check that each change is refused or harmless."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.faults.random_faults import random_mutant
from benchmarks.faults.random_model_faults import Files
from benchmarks.worlds.small_world import build_small_world
from minexplore.bundle import MODEL, SMOOTH_MESHES, BundleError, GeomGroup
from minexplore.physics.local_models import LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.sealed.files import read_folder
from minexplore.task import TaskParams
from minexplore.world import load_world
from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.geometry.raycast import RayCaster
from pipeline.mjcf.bundle import OpenedBundle, geom_triangles, open_bundle
from pipeline.mjcf.loading import load_model
from pipeline.params.validation import ValidationParams
from pipeline.proof.certificate import certify, measure_containment
from pipeline.proof.rebuilt.same_model import model_difference
from pipeline.proof.rebuilt.whole_bundle import require_built

CAUGHT, HARMLESS, OTHER_ROCK, MISSED, CRASHED = "caught", "harmless", "other rock", "MISSED", "CRASHED"
_HEIGHTS_M, _BEARINGS, _SAME_M = (0.3, 0.5, 1.0, 1.5), 64, 1e-3
_SAME = 1e-5  # of numbers of the compiled model: a mesh of the smooth surface may differ by that


@dataclass(frozen=True)
class Verdict:
    """What became of one mutant: its seed, what was changed, the outcome, and the message or the reason."""

    seed: int
    change: str
    outcome: str
    reason: str


def judge_many(seeds: list[int], jobs: int = 1) -> Iterator[Verdict]:
    """Build the small world, change it by every seed, and yield a verdict each.

    Outcomes: refused by an expected error; harmless, with an equal compiled model and equal rays; other rock, where
    only meshes of the rough rock differ and stay closed and within bounds; missed; or crashed by another error.
    """
    with tempfile.TemporaryDirectory() as name:
        good = Path(name) / "good"
        build_small_world(good)
        params = compose([]).validation
        if jobs == 1:
            yield from map(partial(judge, good, params), seeds)
            return
        with ProcessPoolExecutor(jobs) as pool:
            yield from pool.map(partial(judge, good, params), seeds, chunksize=8)


def judge(good: Path, params: ValidationParams, seed: int) -> Verdict:
    """Change the good world by one seed and return what becomes of it."""
    files = read_folder(good)
    change, changed = random_mutant(files, seed)
    if changed == files:
        return Verdict(seed, change, HARMLESS, "no byte differs")
    folder = Path(tempfile.mkdtemp(prefix="mutant-"))
    try:
        for name, data in changed.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        return Verdict(seed, change, *_outcome(good, folder, files, changed, params))
    finally:
        shutil.rmtree(folder)


def _outcome(good: Path, folder: Path, files: Files, changed: Files, params: ValidationParams) -> tuple[str, str]:
    try:
        world = prove(folder, params)
        _drive(folder)
    except MineError as error:
        return CAUGHT, str(error).replace(str(folder), "w")
    except Exception as error:  # the fault that this benchmark looks for
        return CRASHED, f"{type(error).__name__}: {error}"
    before, after = load_model(good / MODEL), load_model(folder / MODEL)
    differs = model_difference(before, after, _SAME) or rays_differ(before, after, world.record.spawn.anchor_m)
    if differs is None:
        return HARMLESS, "equal model, equal rays"
    names = {name for name in {*files, *changed} if files.get(name) != changed.get(name)} - {"world.json"}
    smooth = {f"meshes/{name}.msh" for name in SMOOTH_MESHES}
    if names and all(name.startswith("meshes/") and name not in smooth for name in names):
        return OTHER_ROCK, differs
    return MISSED, differs


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
