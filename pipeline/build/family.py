"""Families of worlds: procedural mines, or variants of one mine. Training, validation and test share no seed."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.build.world import make_world
from pipeline.compose import compose
from pipeline.errors import InputError, LimitError
from pipeline.metrics.limits import flatten
from pipeline.stage import ARTIFACTS
from pipeline.store.files import write_atomically
from pipeline.store.verify import verify_world

FAMILIES = ARTIFACTS / "families"
STYLES = ("room_and_pillar", "drift_and_crosscut", "ramp", "cave")
SPLITS = {"train": 0, "validation": 1_000_000, "test": 2_000_000}  # the first seed of each


@dataclass(frozen=True)
class Member:
    """One world of a family, and the overrides that make it."""

    folder: str
    split: str
    seed: int
    style: str
    overrides: list[str]


@dataclass(frozen=True)
class Outcome:
    """The result of building a member; `problem` is None if every limit holds."""

    member: Member
    world_sha256: str | None
    iou: float | None
    certificate: bool
    problem: str | None


Progress = Callable[[Iterable[Outcome], int], Iterable[Outcome]]


def generated(split: str, count: int, overrides: list[str]) -> list[Member]:
    """Return the members of a split of procedural mines; the four styles alternate."""
    members = []
    for i in range(count):
        seed, style = SPLITS[split] + i, STYLES[i % len(STYLES)]
        own = [
            "survey=procedural",
            f"survey.seed={seed}",
            f"survey.mine.style={style}",
            f"survey.name={split}-{i:04d}",
        ]
        members.append(Member(f"{split}/{i:04d}", split, seed, style, [*own, *overrides]))
    return members


def variants(
    name: str,
    workings: Path,
    split: str,
    count: int,
    height_sd_m: float,
    world_params: dict[str, Any],
    overrides: list[str],
) -> list[Member]:
    """Return variants of one mine; stations, widths and height vary within the errors of the survey.

    `world_params` are the mine's parameters (`pipeline.worlds.world_params`); variants use its height and entrance.
    """
    members, entrance_m = [], world_params.get("survey.entrance_m")
    entrance = "null" if entrance_m is None else f"[{entrance_m[0]},{entrance_m[1]}]"
    for i in range(count):
        seed = SPLITS[split] + i
        height = world_params["compile3d.height_m"] + np.random.default_rng(seed).normal(0.0, height_sd_m)
        own = [
            "survey=variant",
            f"survey.seed={seed}",
            f"survey.workings={workings.as_posix()}",
            f"survey.name={name}-{split}-{i:04d}",
            f"survey.entrance_m={entrance}",
            f"compile3d.height_m={height:.2f}",
        ]
        members.append(Member(f"{name}/{split}/{i:04d}", split, seed, f"variant of {name}", [*own, *overrides]))
    return members


def make_family(members: list[Member], jobs: int, progress: Progress) -> Path:
    """Build all members, in parallel over the cores or, with `RAY_ADDRESS`, over a cluster that shares this folder.

    Members that are up to date are skipped, so an interrupted run continues where it stopped.

    Returns
    -------
    Path
        `artifacts/families/manifest.json`: split, seed and hash of every world of this and earlier calls.

    Raises
    ------
    LimitError
        If worlds breach a limit or cannot be built; the manifest lists them with their problems.
    """
    built = _over_cluster(members) if os.environ.get("RAY_ADDRESS") else _over_cores(members, jobs)
    outcomes = list(progress(built, len(members)))
    file = FAMILIES / "manifest.json"
    manifest = json.loads(file.read_text()) if file.is_file() else {}
    manifest |= {o.member.folder: asdict(o) for o in outcomes}
    write_atomically(file, (json.dumps(dict(sorted(manifest.items())), indent=1) + "\n").encode())
    failed = [o for o in outcomes if o.problem is not None]
    if failed:
        first = failed[0]
        raise LimitError(f"{len(failed)} of {len(outcomes)} worlds failed, {first.member.folder}: {first.problem}")
    return file


def make_member(member: Member) -> Outcome:
    """Build one member and return the result; it has figures if all six stages have run."""
    folder, problem = FAMILIES / member.folder, None
    try:
        config = compose(member.overrides)
        if config.survey.kind == "procedural":  # an override may have changed seed or style
            member = replace(member, seed=config.survey.seed, style=config.survey.mine.style)
        try:
            make_world(config, folder)
        except LimitError as error:
            problem = f"LimitError: {error}"
        figures = flatten(json.loads((folder / "validation" / "metrics.json").read_text()))
        digest = verify_world(folder / "realism" / "world")
        iou, certificate = float(figures["iou.free_space_vs_cleaned"]), bool(figures["certificate.holds"])
        return Outcome(member, digest, iou, certificate, problem)
    except Exception as error:  # this world fails; the others continue
        return Outcome(member, None, None, False, f"{type(error).__name__}: {error}")


def _over_cores(members: list[Member], jobs: int) -> Iterator[Outcome]:
    with ProcessPoolExecutor(min(jobs, len(members))) as pool:
        yield from (future.result() for future in as_completed([pool.submit(make_member, m) for m in members]))


def _over_cluster(members: list[Member]) -> Iterator[Outcome]:
    try:
        import ray
    except ImportError:
        raise InputError("RAY_ADDRESS is set, but Ray is not installed; `make setup-baselines` installs it") from None
    project = Path.cwd()
    environment = {"env_vars": {"PYTHONPATH": str(project)}}
    address = os.environ["RAY_ADDRESS"]
    ray.init(address=address, ignore_reinit_error=True, logging_level="ERROR", runtime_env=environment)

    @ray.remote  # type: ignore[untyped-decorator]
    def build(member: Member) -> Outcome:
        os.chdir(project)
        return make_member(member)

    waiting = [build.remote(member) for member in members]
    while waiting:
        (ready,), waiting = ray.wait(waiting, num_returns=1)
        yield ray.get(ready)
