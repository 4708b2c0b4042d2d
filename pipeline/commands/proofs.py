"""Commands that check a built world: LiDAR replay, certificate, held-out sweeps, parity of ray casters."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from minexplore.bundle import FREE_SPACE, VOLUME
from pipeline.commands.arguments import positive

if TYPE_CHECKING:
    from shapely import Polygon

    from pipeline.mjcf.bundle import OpenedBundle
    from pipeline.proof.certificate import Certificate
    from pipeline.proof.lidar.swept import SweptWorld

_CERTIFY_WITHIN = 4_000_000_000, 4 * 3600  # bytes of memory, and s of processor time, of each process
_CONF = Path(__file__).resolve().parents[2] / "conf"  # the validator's own: no project that made a world decides


def replay(bundle: Path, sweeps: Path, poses: Path, out: Path | None, overrides: list[str]) -> None:
    """Replay real sweeps in a world and compare ranges. Print JSON; --out also writes it and a picture."""
    from pipeline.compose import compose
    from pipeline.proof.lidar.replay import find_sweeps, replay_sweeps
    from pipeline.report.figures.replay import draw_replay
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_atomically, write_report

    world = _open_swept(bundle)
    result = replay_sweeps(world, poses, find_sweeps(sweeps), compose(overrides).validation.replay)
    figures = encode(Path("replay.json"), result.report)
    print(figures.decode(), end="")
    if out is not None:
        _require_replay(out)
        write_report(out / "replay.json", figures)
        write_atomically(out / "replay.png", encode(Path("replay.png"), draw_replay(result, world.plan)))


def _is_of_volume(bundle: Path) -> bool:
    return (bundle / VOLUME).is_file()


def _open_swept(bundle: Path) -> SweptWorld:
    """Return what sweeps are replayed in, of a world by either model."""
    if _is_of_volume(bundle):
        from pipeline.volume.world.proof.certificate import open_volume
        from pipeline.volume.world.proof.swept import swept_volume

        return swept_volume(bundle, open_volume(bundle))
    from pipeline.proof.lidar.swept import swept_level

    return swept_level(*_open_level(bundle))


def _require_replay(out: Path) -> None:
    """Refuse to replace a picture that lies there without the figures of a replay."""
    from pipeline.errors import ArtifactError

    picture = out / "replay.png"
    if os.path.lexists(picture) and not (out / "replay.json").is_file():
        raise ArtifactError(f"{picture}: there is another file; move it away, or give another --out")


def _open_level(bundle: Path) -> tuple[OpenedBundle, Polygon]:
    """Return a level world and its free space (m, mine frame); a volume is refused."""
    from pipeline.mjcf.bundle import open_bundle
    from pipeline.store.codecs import decode
    from pipeline.types import FreeSpace

    return open_bundle(bundle), decode(bundle / FREE_SPACE, FreeSpace).polygon


def limits_of_kind(kind: str, overrides: list[str]) -> Any:
    """Return what the validator allows a mine of a kind (`ValidationParams`), with overrides."""
    from pipeline.compose import compose

    mine = [] if kind == "embedded" else [f"+mine={kind}"]
    return compose([*mine, *overrides], _CONF).validation


def certify(bundle: Path, contacts: int, out: Path | None, overrides: list[str]) -> None:
    """Check that a world is what the builder writes and that its rock encloses the workings. Print the certificate."""
    from pipeline.commands.within_limits import within_limits
    from pipeline.errors import LimitError
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_report

    of_kind = _of_volume if _is_of_volume(bundle) else _of_plan
    certificate = within_limits(lambda: of_kind(bundle, contacts, overrides), str(bundle), *_CERTIFY_WITHIN)
    text = encode(Path("certificate.json"), certificate)
    print(text.decode(), end="")
    if out is not None:
        write_report(out, text)
    if not certificate.holds:
        failed = [name for name, clause in certificate.clauses.items() if not clause.holds]
        raise LimitError(f"{bundle}: the certificate does not hold: {', '.join(failed)}")


def _of_volume(bundle: Path, contacts: int, overrides: list[str]) -> Certificate:
    from pipeline.mjcf.bundle import read_made_by
    from pipeline.proof.rebuilt.fittings import require_furniture
    from pipeline.volume.world.proof.alone import certify_alone, survey_alone
    from pipeline.volume.world.proof.certificate import open_volume
    from pipeline.volume.world.proof.derived_content import require_remade
    from pipeline.volume.world.surface.furnished import hang_again

    limits, world = limits_of_kind(read_made_by(bundle).kind, overrides), open_volume(bundle)
    files, thrown = world.record.files, {"robot_contacts": contacts, "ball_contacts": contacts}
    require_furniture(bundle, files, limits.fittings.furniture, hang_again(bundle, files))
    surveyed = survey_alone(world, limits.volume)
    require_remade(bundle, world, limits.volume, surveyed, floor=limits.fittings.floor)
    return certify_alone(world, limits.volume.model_copy(update=thrown))


def _of_plan(bundle: Path, contacts: int, overrides: list[str]) -> Certificate:
    from pipeline.mjcf.bundle import open_bundle, read_made_by
    from pipeline.proof.certificate import certify as apply_limits
    from pipeline.proof.certificate import measure_containment
    from pipeline.proof.claims import allowed_claims
    from pipeline.proof.rebuilt.whole_bundle import require_built

    world, claims = open_bundle(bundle), read_made_by(bundle)
    params = allowed_claims(bundle, claims, limits_of_kind(claims.kind, overrides))
    settings = params.certificate.model_copy(update={"contacts": contacts})
    free_space = require_built(bundle, world.record, params)
    tracing = params.network_cell_m, params.network_min_leg_m
    measured = measure_containment(bundle, world, free_space, settings, tracing, os.cpu_count() or 1)
    return apply_limits(world.record.world_sha256, measured, settings.limits)


def validate(holdout: bool, sweeps: Path, out: Path | None) -> None:
    """Build the rough surface from half of the sweeps and score it on the other half (--holdout)."""
    from pipeline.compose import compose
    from pipeline.errors import InputError
    from pipeline.proof.lidar.holdout import score_holdout
    from pipeline.proof.lidar.replay import find_sweeps
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_report

    if not holdout:
        raise InputError("--holdout is required; stage 6 is run by `make validation`")
    report = score_holdout(find_sweeps(sweeps), compose([]).surface)
    if out is not None:
        write_report(out, encode(out, report))
    for split in report.splits:
        ratios = ", ".join(f"{w:g} m {r:.2f}" for w, r in zip(split.window_m, split.built_vs_held_out, strict=True))
        print(f"from {'+'.join(split.built_from)}, held out {'+'.join(split.held_out)}: built / held out {ratios}")
    print(f"typical factor of the built wall {report.built_factor}, of the sweeps' halves {report.source_factor}")


def parity(bundle: Path, rays: int, out: Path | None) -> None:
    """Cast the same rays by every backend and compare ranges. Exit code 2 if over one ray in 1,000 differs."""
    from pipeline.errors import LimitError
    from pipeline.proof.lidar.parity import compare_backends
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_report

    report = compare_backends(bundle, *_open_level(bundle), rays, seed=0)
    if out is not None:
        write_report(out, encode(out, report))
    for name, result in report.backends.items():
        print(f"{name}: {result.agree} of {result.rays} rays within {result.tolerance_m} m, worst {result.worst_m} m")
    for name, reason in report.left_out.items():
        print(f"{name}: not run, {reason}")
    # With 32-bit numbers, a ray along a wall can miss it by a centimetre. One ray in 1,000 may.
    wrong = [name for name, result in report.backends.items() if not result.rays or result.agree < 0.999 * result.rays]
    if wrong:
        raise LimitError(f"{bundle}: {', '.join(wrong)} disagree" + (f"; see {out}" if out else ""))


def add_to(commands: Any) -> None:
    """Declare the commands that check a world."""
    replay_parser = commands.add_parser("replay", help=replay.__doc__)
    replay_parser.add_argument("--bundle", type=Path, required=True)
    replay_parser.add_argument("--sweeps", type=Path, required=True, help="folder of sweep_NAME.csv")
    replay_parser.add_argument("--poses", type=Path, required=True)
    replay_parser.add_argument("--out", type=Path)
    replay_parser.add_argument("overrides", nargs="*", help="for example validation.replay.max_range_m=12")
    replay_parser.set_defaults(run=lambda a: replay(a.bundle, a.sweeps, a.poses, a.out, a.overrides))
    certify_parser = commands.add_parser("certify", help=certify.__doc__)
    certify_parser.add_argument("--bundle", type=Path, required=True)
    certify_parser.add_argument("--contacts", type=positive, default=20_000, help="robot steps in contact with rock")
    certify_parser.add_argument("--out", type=Path)
    certify_parser.add_argument("overrides", nargs="*")
    certify_parser.set_defaults(run=lambda a: certify(a.bundle, a.contacts, a.out, a.overrides), anywhere=True)
    validate_parser = commands.add_parser("validate", help=validate.__doc__)
    validate_parser.add_argument("--holdout", action="store_true")
    validate_parser.add_argument("--sweeps", type=Path, default=Path("data/raw"), help="folder of sweep_NAME.csv")
    validate_parser.add_argument("--out", type=Path)
    validate_parser.set_defaults(run=lambda a: validate(a.holdout, a.sweeps, a.out))
    parity_parser = commands.add_parser("parity", help=parity.__doc__)
    parity_parser.add_argument("--bundle", type=Path, required=True)
    parity_parser.add_argument("--rays", type=positive, default=10_000)
    parity_parser.add_argument("--out", type=Path)
    parity_parser.set_defaults(run=lambda a: parity(a.bundle, a.rays, a.out), anywhere=True)
