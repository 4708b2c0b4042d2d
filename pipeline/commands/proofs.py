"""Proofs of a world that was built: replay, certificate, what was held out, parity."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from minexplore.bundle import FREE_SPACE
from pipeline.commands.arguments import positive


def replay(bundle: Path, sweeps: Path, poses: Path, out: Path | None, overrides: list[str]) -> None:
    """Cast real sweeps in a world and compare ranges; figures as JSON, and with --out a picture beside them."""
    from pipeline.compose import compose
    from pipeline.mjcf.bundle import open_bundle
    from pipeline.proof.replay import find_sweeps, replay_sweeps
    from pipeline.report.replay import draw_replay
    from pipeline.store.codecs import decode, encode
    from pipeline.store.files import write_atomically
    from pipeline.types import FreeSpace

    free = decode(bundle / FREE_SPACE, FreeSpace).polygon
    found = replay_sweeps(open_bundle(bundle), free, poses, find_sweeps(sweeps), compose(overrides).validation.replay)
    figures = encode(Path("replay.json"), found.report)
    print(figures.decode(), end="")
    if out is not None:
        write_atomically(out / "replay.json", figures)
        write_atomically(out / "replay.png", encode(Path("replay.png"), draw_replay(found, free)))


def certify(bundle: Path, contacts: int, out: Path | None, overrides: list[str]) -> None:
    """Prove that a bundle's collision world encloses its plan; the certificate as JSON, exit code 2 if it fails."""
    from functools import partial

    from tqdm import tqdm

    from pipeline.compose import compose
    from pipeline.errors import LimitError
    from pipeline.mjcf.bundle import open_bundle
    from pipeline.proof.certificate import certify as judge
    from pipeline.proof.certificate import measure_containment
    from pipeline.store.codecs import decode, encode
    from pipeline.store.files import write_atomically
    from pipeline.types import FreeSpace

    params = compose(overrides).validation
    asked = params.certificate.model_copy(update={"contacts": contacts})
    world, free_space = open_bundle(bundle), decode(bundle / FREE_SPACE, FreeSpace)
    tracing = params.network_cell_m, params.network_min_leg_m
    progress = partial(tqdm, desc="throws", disable=None)
    measured = measure_containment(bundle, world, free_space, asked, tracing, os.cpu_count() or 1, progress)
    certificate = judge(world.record.world_sha256, measured, asked.limits)
    written = encode(Path("certificate.json"), certificate)
    print(written.decode(), end="")
    if out is not None:
        write_atomically(out, written)
    if not certificate.holds:
        failed = [name for name, clause in certificate.clauses.items() if not clause.holds]
        raise LimitError(f"{bundle}: the certificate does not hold: {', '.join(failed)}")


def validate(holdout: bool, sweeps: Path, out: Path | None) -> None:
    """Score what was built on data that it has not seen: --holdout builds rock from half of the sweeps."""
    from functools import partial

    from tqdm import tqdm

    from pipeline.compose import compose
    from pipeline.errors import InputError
    from pipeline.proof.holdout import score_holdout
    from pipeline.proof.replay import find_sweeps
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_atomically

    if not holdout:
        raise InputError("say what to hold out: --holdout (the stage's own validation is `make validation`)")
    report = score_holdout(find_sweeps(sweeps), compose([]).surface, partial(tqdm, desc="halves", disable=None))
    if out is not None:
        write_atomically(out, encode(out, report))
    for split in report.splits:
        ratios = ", ".join(f"{w:g} m {r:.2f}" for w, r in zip(split.window_m, split.built_vs_held_out, strict=True))
        print(f"from {'+'.join(split.built_from)}, held out {'+'.join(split.held_out)}: built / held out {ratios}")
    print(f"typical factor {report.built_factor}; of the halves themselves {report.source_factor}")


def parity(bundle: Path, rays: int, out: Path | None) -> None:
    """Cast the same rays by every backend and compare ranges; exit code 2 if one differs on over a ray in 1,000."""
    from pipeline.errors import LimitError
    from pipeline.mjcf.bundle import open_bundle
    from pipeline.proof.parity import compare_backends
    from pipeline.store.codecs import decode, encode
    from pipeline.store.files import write_atomically
    from pipeline.types import FreeSpace

    free = decode(bundle / FREE_SPACE, FreeSpace).polygon
    report = compare_backends(bundle, open_bundle(bundle), free, rays, seed=0)
    if out is not None:
        write_atomically(out, encode(out, report))
    for name, found in report.backends.items():
        print(f"{name}: {found.agree} of {found.rays} rays within {found.tolerance_m} m, worst {found.worst_m} m")
    for name, reason in report.left_out.items():
        print(f"{name}: left out, {reason}")
    # A ray along a wall can miss by a centimetre in 32 bits: one in a thousand may.
    wrong = [name for name, found in report.backends.items() if not found.rays or found.agree < 0.999 * found.rays]
    if wrong:
        raise LimitError(f"{bundle}: {', '.join(wrong)} disagree" + (f"; see {out}" if out else ""))


def add_to(commands: Any) -> None:
    """Declare the proofs."""
    again = commands.add_parser("replay", help=replay.__doc__)
    again.add_argument("--bundle", type=Path, required=True)
    again.add_argument("--sweeps", type=Path, required=True, help="folder of sweep_NAME.csv")
    again.add_argument("--poses", type=Path, required=True)
    again.add_argument("--out", type=Path)
    again.add_argument("overrides", nargs="*", help="such as validation.replay.max_range_m=12")
    again.set_defaults(run=lambda a: replay(a.bundle, a.sweeps, a.poses, a.out, a.overrides))
    proof = commands.add_parser("certify", help=certify.__doc__)
    proof.add_argument("--bundle", type=Path, required=True)
    proof.add_argument("--contacts", type=positive, default=20_000, help="robot steps in touch with rock")
    proof.add_argument("--out", type=Path)
    proof.add_argument("overrides", nargs="*")
    proof.set_defaults(run=lambda a: certify(a.bundle, a.contacts, a.out, a.overrides))
    unseen = commands.add_parser("validate", help=validate.__doc__)
    unseen.add_argument("--holdout", action="store_true")
    unseen.add_argument("--sweeps", type=Path, default=Path("data/raw"), help="folder of sweep_NAME.csv")
    unseen.add_argument("--out", type=Path)
    unseen.set_defaults(run=lambda a: validate(a.holdout, a.sweeps, a.out))
    alike = commands.add_parser("parity", help=parity.__doc__)
    alike.add_argument("--bundle", type=Path, required=True)
    alike.add_argument("--rays", type=positive, default=10_000)
    alike.add_argument("--out", type=Path)
    alike.set_defaults(run=lambda a: parity(a.bundle, a.rays, a.out))
