"""Families of worlds: procedural mines, or variants of one mine. Training, validation and test share no seed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.guard.process_limits import has_limits
from minexplore.sealed.json_text import describe_json_error
from minexplore.splits import SEEDS, STYLES, mine_name
from pieces.results import PiecesError
from pieces.run import map_pieces
from pieces.work import Where, Work
from pipeline.build.splits import LIST, Listed
from pipeline.build.world import make_world
from pipeline.compose import compose
from pipeline.errors import ArtifactError, InputError, LimitError
from pipeline.metrics.limits import flatten
from pipeline.places import CONF
from pipeline.stage import ARTIFACTS
from pipeline.store.files import write_atomically
from pipeline.store.hashing import read_text_file, sha256_file, sha256_named
from pipeline.store.locks import hold_lock
from pipeline.store.manifest import code_sha256
from pipeline.store.registry import REGISTRY
from pipeline.store.verify import verify_world
from stages.__main__ import STAGES

FAMILIES = ARTIFACTS / "families"
_WORLD = "realism/world"  # below a world's folder
_LIGHT = "preset=light"
_MEMORY_GB = 1.5  # of a world with rock, the largest
# What preset=light leaves out; conf/validation/default.yaml has the same values.
_STRESS_TEST = (
    "validation.certificate.contacts=1000",
    "validation.certificate.limits.contacts={min: 1}",
    "validation.certificate.limits.escapes={max: 0}",
    "validation.certificate.limits.deepest_m={max: 0.10}",
)


@dataclass(frozen=True)
class Member:
    """One world of a family, and the overrides that make it."""

    folder: str
    split: str
    seed: int
    style: str
    overrides: list[str]


@dataclass(frozen=True)
class MemberOutcome:
    """The result of building a member; `problem` is None if every limit holds."""

    member: Member
    world_sha256: str | None
    iou: float | None
    certificate: bool
    problem: str | None


def generated(split: str, count: int, overrides: list[str]) -> list[Member]:
    """Return the members of a split of procedural mines; the four styles alternate."""
    members = []
    for i in range(count):
        seed, style = SEEDS[split] + i, STYLES[i % len(STYLES)]
        own = [
            "survey=procedural",
            f"survey.seed={seed}",
            f"survey.mine.style={style}",
            f"survey.name={mine_name(split, i)}",
        ]
        members.append(Member(f"{split}/{i:04d}", split, seed, style, [*own, *overrides]))
    return members


def without_rock(members: list[Member], stress_tests: int) -> list[Member]:
    """Return the members as light worlds; so many of them, evenly spread, pass the collision stress test as well."""
    tested = set(np.linspace(0, len(members) - 1, min(stress_tests, len(members))).round().astype(int).tolist())
    return [
        replace(
            member,
            folder=f"light/{member.folder}",
            overrides=[_LIGHT, *(_STRESS_TEST if number in tested else ()), *member.overrides],
        )
        for number, member in enumerate(members)
    ]


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

    `world_params` are the mine's parameters (`pipeline.worlds.world_params`); variants use its height, its entrance
    and its smallest islands.
    """
    members, entrance_m = [], world_params.get("survey.entrance_m")
    entrance = "null" if entrance_m is None else f"[{entrance_m[0]},{entrance_m[1]}]"
    for i in range(count):
        seed = SEEDS[split] + i
        height = world_params["compile3d.height_m"] + np.random.default_rng(seed).normal(0.0, height_sd_m)
        own = [
            "survey=variant",
            f"survey.seed={seed}",
            f"survey.workings={workings.as_posix()}",
            f"survey.name={name}-{split}-{i:04d}",
            f"survey.entrance_m={entrance}",
            f"contours.min_island_m2={world_params['contours.min_island_m2']:g}",
            f"compile3d.height_m={height:.2f}",
        ]
        members.append(Member(f"{name}/{split}/{i:04d}", split, seed, f"variant of {name}", [*own, *overrides]))
    return members


def make_family(
    members: list[Member], where: Where, listed: Mapping[tuple[str, int], Listed] | None = None, again: str = ""
) -> list[MemberOutcome]:
    """Build all members; nodes of a cluster share this folder, unless the worlds are kept at an address (`where.to`).

    Members that are up to date are skipped, so an interrupted run continues where it stopped. Each outcome enters
    `artifacts/families/manifest.json`: split, seed and hash of every world of this and earlier calls.

    Parameters
    ----------
    members : list of Member
    where : Where
    listed : mapping, optional
        Worlds of the committed list by split and seed; a world with another hash fails.
    again : str, optional
        The command that continues, for those who find a world unfinished.

    Returns
    -------
    list of MemberOutcome
        In the order of the members.

    Raises
    ------
    LimitError
        If worlds breach a limit, cannot be built, or differ from the list; the manifest has their problems.
    InputError
        If this system cannot build worlds.
    ArtifactError
        If another command is building worlds of the same folder, or the manifest is broken.
    PiecesError
        If processes that build worlds were ended, or there is no cluster.
    """
    _read_record(FAMILIES / "manifest.json")  # refuse a broken one before worlds are built
    if where.on == "local" and not has_limits():
        raise InputError("this system forks no processes, as Windows does not: build worlds on Linux, or with --on ray")
    work = Work(
        "worlds",
        partial(make_member, FAMILIES, again),
        MemberOutcome,
        _code_sha256() if where.to else "",
        kept=None,  # the worlds' own manifests state what is up to date
        memory_gb=_MEMORY_GB,
        label=lambda member: member.folder,
        problem=problem_of,
        folder=partial(_folder_of, FAMILIES),
        holds=lambda member, made: verify_world(FAMILIES / member.folder / _WORLD) == made.world_sha256,
    )
    outcomes, place, failure = list[MemberOutcome](), FAMILIES / Path(members[0].folder).parent, None
    with hold_lock(place / ".lock", f"{place}: another command is building these worlds"):
        try:
            map_pieces(work, members, where, lambda member, made: outcomes.append(_compared(made, listed or {})))
        except PiecesError as error:
            failure = error
    order = {member.folder: number for number, member in enumerate(members)}
    outcomes.sort(key=lambda outcome: order[outcome.member.folder])
    record_outcomes(outcomes)
    failed = [o for o in outcomes if o.problem is not None]
    if failed:
        first = failed[0]
        raise LimitError(f"{len(failed)} of {len(members)} worlds failed, {first.member.folder}: {first.problem}")
    if failure is not None:
        raise failure
    return outcomes


def problem_of(outcome: MemberOutcome) -> str | None:
    """Return why a world does not count."""
    return outcome.problem


def _folder_of(families: Path, member: Member) -> Path:
    return families / member.folder


def _code_sha256() -> str:
    """Return the hash of all that decides a world beside its overrides: code, configuration, and registered data."""
    files = [*sorted(CONF.rglob("*.yaml")), REGISTRY]
    return sha256_named({s: code_sha256(s, Path.cwd()) for s in STAGES} | {str(f): sha256_file(f) for f in files})


def record_outcomes(outcomes: list[MemberOutcome]) -> None:
    """Add outcomes to the manifest. Another command may be adding those of another split."""
    file = FAMILIES / "manifest.json"
    with hold_lock(file.with_name(".manifest.lock"), None):
        manifest = _read_record(file) | {o.member.folder: asdict(o) for o in outcomes}
        write_atomically(file, (json.dumps(dict(sorted(manifest.items())), indent=1) + "\n").encode())


def _read_record(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_text_file(file)) if file.exists() else {}
    except (ValueError, RecursionError) as error:
        raise ArtifactError(f"{file}: {describe_json_error(error)}; remove it") from error
    if not isinstance(found, dict):
        raise ArtifactError(f"{file}: want an object with one entry a world; remove it")
    return found


def _compared(outcome: MemberOutcome, listed: Mapping[tuple[str, int], Listed]) -> MemberOutcome:
    """Return an outcome whose problem is a hash that differs from the list, if it has no other."""
    wanted = listed.get((outcome.member.split, outcome.member.seed))
    if wanted is None or outcome.problem is not None or outcome.world_sha256 == wanted.world_sha256:
        return outcome
    return replace(
        outcome,
        problem=f"world hash {outcome.world_sha256} differs from {wanted.world_sha256} in {LIST.as_posix()}: other "
        "package versions, another pipeline, or a changed world",
    )


def to_list(outcomes: Iterable[MemberOutcome]) -> list[Listed]:
    """Return the lines of the committed list for worlds that were built."""
    return [Listed(o.member.split, o.member.seed, o.member.style, str(o.world_sha256)) for o in outcomes]


def make_member(families: Path, again: str, member: Member) -> MemberOutcome:
    """Build one member below `families` and return the result; it has figures if all six stages have run."""
    folder, problem = families / member.folder, None
    try:
        config = compose(member.overrides)
        if config.survey.kind == "procedural":  # an override may have changed seed or style
            member = replace(member, seed=config.survey.seed, style=config.survey.mine.style)
        try:
            make_world(config, folder, again=again)
        except LimitError as error:
            problem = f"LimitError: {error}"
        figures = flatten(json.loads((folder / "validation" / "metrics.json").read_text()))
        digest = verify_world(folder / _WORLD)
        iou, certificate = figures.get("iou.free_space_vs_cleaned"), bool(figures["certificate.holds"])
        return MemberOutcome(member, digest, iou, certificate, problem)
    except Exception as error:  # this world fails; the others continue
        return MemberOutcome(member, None, None, False, f"{type(error).__name__}: {error}")
