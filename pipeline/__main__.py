"""`python -m pipeline COMMAND`: the chores around the stages."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pipeline.errors import MineError


def set_overrides() -> None:
    """Write `$OVERRIDES` to `params.yaml`, where `dvc repro` finds them; touch the file only to change it."""
    text = f"overrides: {json.dumps(os.environ.get('OVERRIDES', ''))}\n"
    path = Path("params.yaml")
    if not path.is_file() or path.read_text() != text:
        path.write_text(text)


def verify() -> None:
    """Walk the manifests from the survey to the world and name the first broken link."""
    from pipeline.store.verify import verify_chain, verify_world

    count = verify_chain(Path())
    print(f"{count} artifacts hold; world {verify_world(Path('artifacts/realism/world'))}")


def register(path: Path, origin: str, licence: str) -> None:
    """Add a file below `data/` to `data/registry.txt`."""
    from pipeline.store.registry import register as add

    entry = add(path, origin, licence)
    print(f"data/{entry.name}  {entry.sha256}  {entry.bytes} bytes")


def roughness(sweeps: list[Path], out: Path) -> None:
    """Measure the walls in planar sweeps by the default's gates and write the figures as JSON."""
    from pipeline.compose import compose
    from pipeline.metrics.roughness import roughness_of_sweeps
    from pipeline.rock import roughness_json
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_atomically
    from pipeline.survey.poses import read_sweep

    gate = compose([]).surface.sweeps
    read = {path.stem: read_sweep(path, gate.max_range_m, gate.max_range_var_m2) for path in sweeps}
    measured = roughness_of_sweeps(read, gate.max_gap_m, gate.window_m, gate.footprint_m)
    write_atomically(out, encode(out, roughness_json(measured)))
    for window, rq, p90 in zip(measured.window_m, measured.rq_m, measured.rq_p90_m, strict=True):
        print(f"{window:4.1f} m: median {1000 * rq:6.1f} mm, 90th percentile {1000 * p90:6.1f} mm")


def replay(bundle: Path, sweeps: Path, poses: Path, out: Path | None, overrides: list[str]) -> None:
    """Cast real sweeps in a world and compare ranges; figures as JSON, and with --out a picture beside them."""
    from pipeline.compose import compose
    from pipeline.mjcf.bundle import open_bundle
    from pipeline.proof.replay import find_sweeps, replay_sweeps
    from pipeline.report.replay import draw_replay
    from pipeline.store.codecs import decode, encode
    from pipeline.store.files import write_atomically
    from pipeline.types import FreeSpace

    free = decode(bundle / "free_space.geojson", FreeSpace).polygon
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
    world, free_space = open_bundle(bundle), decode(bundle / "free_space.geojson", FreeSpace)
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

    free = decode(bundle / "free_space.geojson", FreeSpace).polygon
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


def new(name: str, source: Path, origin: str, licence: str, stated: dict[str, Any], overrides: list[str]) -> None:
    """Make a world of a mine's file: look at it, write conf/survey/NAME.yaml, run all stages, draw the report."""
    from pipeline.errors import LimitError
    from pipeline.new import adopt
    from pipeline.worlds import WORLDS, env_id

    for line in adopt(name, source, origin, licence, stated):
        print(line, file=sys.stderr)
    broken = None
    try:
        build(name, [f"survey={name}", *overrides])
    except LimitError as error:
        broken = error
    print(f"world   {WORLDS / name / 'realism' / 'world'}")
    print("report ", end=" ")
    report(name)
    print(f"env id  {env_id(name)}")
    if broken is not None:
        raise broken


def build(name: str, overrides: list[str]) -> None:
    """Bring a world's folder up to date by the stages that are not."""
    from tqdm import tqdm

    from pipeline.compose import compose
    from pipeline.worlds import WORLDS
    from stages.run import make_world

    def progress(stages: list) -> Iterator:
        with tqdm(stages, desc=name, unit="stage", disable=None) as bar:
            for stage in bar:
                bar.set_postfix_str(stage.name)
                yield stage

    make_world(compose(overrides), WORLDS / name, progress)


def worlds(count: int, split: str, of: str | None, height_sd_m: float, jobs: int, overrides: list[str]) -> None:
    """Make a family of worlds: generated mines, or with --of variants of one within its survey's error."""
    from tqdm import tqdm

    from pipeline.new import adopt_workings
    from pipeline.worlds import made_by, world_folder
    from stages.family import generated, make_family, variants

    if of is None:
        members = generated(split, count, overrides)
    else:
        workings = adopt_workings(of, world_folder(of) / "contours" / "free_space.geojson")
        members = variants(of, workings, split, count, height_sd_m, made_by(of), overrides)
    print(make_family(members, jobs, lambda done, n: tqdm(done, total=n, desc=split, unit="world", disable=None)))


def list_() -> None:
    """List the worlds that were built here."""
    from pipeline.worlds import list_worlds

    print(list_worlds())


def show(name: str) -> None:
    """Show a world's figures and their limits."""
    from pipeline.worlds import show_world

    print(show_world(name))


def compare(one: str, other: str) -> None:
    """Show the figures and the parameters in which two worlds differ."""
    from pipeline.worlds import compare_worlds

    print(compare_worlds(one, other))


def report(name: str) -> None:
    """Write a world's report.html: one page that needs no network."""
    from pipeline.compose import compose
    from pipeline.report.page import write_page
    from pipeline.worlds import changed_params, env_id, world_folder

    folder = world_folder(name)
    print(write_page(folder, env_id(name), changed_params(name, compose([]))))


def accept() -> None:
    """Accept the present metrics as the baseline that the regression gate compares with."""
    from pipeline.report.baseline import accept_baseline

    print(accept_baseline())


def table() -> None:
    """Write `docs/results.md` from the present metrics and print it."""
    from pipeline.report.baseline import write_results

    print(write_results())


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value}: want 1 or more")
    return value


def _numbers(count: int) -> Callable[[str], list[float]]:
    def parse(text: str) -> list[float]:
        values = [float(part) for part in text.split(",")]
        if len(values) != count or not all(map(math.isfinite, values)):
            raise argparse.ArgumentTypeError(f"{text!r}: want {count} numbers, separated by commas")
        return values

    return parse


def _add_worlds(commands: Any) -> None:
    """Declare the commands that make and look at worlds of one's own."""
    make = commands.add_parser("new", help=new.__doc__)
    make.add_argument("name", help="of the world; conf/survey/NAME.yaml and artifacts/worlds/NAME are made")
    make.add_argument("--from", dest="source", type=Path, required=True, help="plan, map.yaml, drawing or survey")
    make.add_argument("--origin", default="not stated", help="where the file comes from")
    make.add_argument("--licence", default="not stated")
    make.add_argument("--px-per-m", type=float, help="of a plan without a scale bar")
    make.add_argument("--bar-length", dest="bar_length_m", type=float, help="m that the scale bar stands for")
    make.add_argument("--bar-box", dest="bar_box_px", type=_numbers(4), help="COL0,ROW0,COL1,ROW1 round the bar")
    make.add_argument("--unit", choices=["m", "cm", "mm", "ft", "in"], help="of a drawing")
    make.add_argument("--entrance", dest="entrance_m", type=_numbers(2), help="X,Y in the mine frame, m")
    make.add_argument("overrides", nargs="*", help="such as compile3d.height_m=2.8")
    make.add_argument("--layer", dest="layers", action="append", help="of a drawing; again for more")
    make.add_argument("--snap", dest="snap_m", type=float, help="m, between the ends of walls that are joined")
    make.add_argument("--page", type=_positive, help="of a PDF")
    make.add_argument("--dpi", type=float, help="at which a PDF's page is drawn")
    stated = ("px_per_m", "bar_length_m", "bar_box_px", "unit", "entrance_m", "layers", "snap_m", "page", "dpi")
    make.set_defaults(
        run=lambda a: new(a.name, a.source, a.origin, a.licence, {k: getattr(a, k) for k in stated}, a.overrides)
    )
    many = commands.add_parser("worlds", help=worlds.__doc__)
    many.add_argument("--count", type=_positive, default=10)
    many.add_argument("--split", choices=["train", "validation", "test"], default="train")
    many.add_argument("--of", help="a world whose variants are made")
    many.add_argument("--height-sd", type=float, default=0.1, help="m, of a variant's height")
    many.add_argument("--jobs", type=_positive, default=os.cpu_count() or 1)
    many.add_argument("overrides", nargs="*", help="such as survey.mine.loops=0.8")
    many.set_defaults(run=lambda a: worlds(a.count, a.split, a.of, a.height_sd, a.jobs, a.overrides))
    commands.add_parser("list", help=list_.__doc__).set_defaults(run=lambda a: list_())
    for function in (show, report):
        look = commands.add_parser(function.__name__, help=function.__doc__)
        look.add_argument("name", nargs="?", default="default")
        look.set_defaults(run=lambda a, f=function: f(a.name))
    beside = commands.add_parser("compare", help=compare.__doc__)
    beside.add_argument("one")
    beside.add_argument("other")
    beside.set_defaults(run=lambda a: compare(a.one, a.other))


def command_line() -> argparse.ArgumentParser:
    """Return the parser of all commands; what it parses has `run`."""
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for function in (set_overrides, verify, accept, table):
        name = function.__name__.replace("_", "-")
        commands.add_parser(name, help=function.__doc__).set_defaults(run=lambda a, f=function: f())
    add = commands.add_parser("register", help=register.__doc__)
    add.add_argument("path", type=Path)
    add.add_argument("--origin", default="unknown")
    add.add_argument("--licence", default="none stated")
    add.set_defaults(run=lambda a: register(a.path, a.origin, a.licence))
    rough = commands.add_parser("roughness", help=roughness.__doc__)
    rough.add_argument("sweeps", type=Path, nargs="+")
    rough.add_argument("--out", type=Path, required=True)
    rough.set_defaults(run=lambda a: roughness(a.sweeps, a.out))
    again = commands.add_parser("replay", help=replay.__doc__)
    again.add_argument("--bundle", type=Path, required=True)
    again.add_argument("--sweeps", type=Path, required=True, help="folder of sweep_NAME.csv")
    again.add_argument("--poses", type=Path, required=True)
    again.add_argument("--out", type=Path)
    again.add_argument("overrides", nargs="*", help="such as validation.replay.max_range_m=12")
    again.set_defaults(run=lambda a: replay(a.bundle, a.sweeps, a.poses, a.out, a.overrides))
    proof = commands.add_parser("certify", help=certify.__doc__)
    proof.add_argument("--bundle", type=Path, required=True)
    proof.add_argument("--contacts", type=_positive, default=20_000, help="robot steps in touch with rock")
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
    alike.add_argument("--rays", type=_positive, default=10_000)
    alike.add_argument("--out", type=Path)
    alike.set_defaults(run=lambda a: parity(a.bundle, a.rays, a.out))
    _add_worlds(commands)
    return parser


def main() -> int:
    """Run one command; exit code 2 with one message on bad input."""
    arguments = command_line().parse_args()
    try:
        arguments.run(arguments)
    except MineError as error:
        print(f"{arguments.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{arguments.command}: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
