"""Commands that make, list, show, compare and report worlds."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from pipeline.commands.arguments import natural, number, positive
from pipeline.commands.options import add_options, stated_options
from pipeline.params.stated import StatedOptions

DETECTED = "detected.png"


def new(
    name: str,
    source: Path,
    origin: str,
    licence: str,
    stated: StatedOptions,
    overrides: list[str],
    detected: Path | None = None,
) -> None:
    """Make a world from a mine's file: detect the format, write conf/survey/NAME.yaml, run all stages and report."""
    from pipeline.errors import DoubtError, InputError
    from pipeline.import_mine import require_name
    from pipeline.store.locks import hold_lock
    from pipeline.worlds import WORLDS

    require_name(name)
    _require_place(detected, source)
    try:
        with hold_lock(WORLDS / f".{name}.lock", f"name = {name}: another command is making this world"):
            _make(name, source, origin, licence, stated, overrides, detected)
    except DoubtError as error:  # nothing is left behind but the picture that was asked for
        if detected is None:
            raise InputError(f"{error}; --detected FILE.png draws what was found") from error
        _write_picture(detected, error.picture)
        raise InputError(f"{error}; {detected} shows what was found") from error


def _require_place(detected: Path | None, source: Path) -> None:
    """Refuse a place for the picture of what was found that is no .png file in a folder, or is the plan itself."""
    from pipeline.errors import InputError

    if detected is None:
        return
    if detected.suffix.lower() != ".png" or not detected.parent.is_dir() or detected.is_dir():
        raise InputError(f"--detected {detected}: expected FILE.png in a folder that exists")
    if detected.resolve() == source.resolve():
        raise InputError(f"--detected {detected}: is the plan itself; choose another name")


def _write_picture(path: Path, picture: Any) -> None:
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_atomically

    write_atomically(path, encode(path, picture))


def _make(
    name: str,
    source: Path,
    origin: str,
    licence: str,
    stated: StatedOptions,
    overrides: list[str],
    detected: Path | None,
) -> None:
    from pipeline.errors import LimitError, lacks_memory
    from pipeline.import_mine import forget_import, import_mine
    from pipeline.worlds import WORLDS, describe_start, env_id

    imported = import_mine(name, source, origin, licence, stated)
    for line in imported.findings:
        print(line, file=sys.stderr)
    existed, failure = (WORLDS / name).exists(), None
    try:
        if imported.picture is not None:
            for path in filter(None, (WORLDS / name / DETECTED, detected)):
                _write_picture(path, imported.picture)
        build(name, [f"survey={name}", *overrides])
    except LimitError as error:
        failure = error
    except BaseException as error:
        is_read = (WORLDS / name / "survey").is_dir()
        refused = isinstance(error, Exception) and not lacks_memory(error)
        # A refused mine leaves nothing behind. Ctrl-C and a lack of memory leave nothing before the file is read, and
        # keep the finished stages later.
        if imported.written and (refused or not is_read):
            forget_import(imported)
            if not existed:
                shutil.rmtree(WORLDS / name, ignore_errors=True)
            remedy = "; state corrected values as overrides, for example survey.snap_m=1" if refused else ""
            print(f"nothing is kept{remedy}", file=sys.stderr)
        elif lacks_memory(error):
            print(f"{WORLDS / name}: the finished stages are kept; the same command continues", file=sys.stderr)
        raise
    if imported.picture is not None:
        print(f"taken for workings: {WORLDS / name / DETECTED}", file=sys.stderr)
    print(f"world   {WORLDS / name / 'realism' / 'world'}")
    print("report ", end=" ")
    report(name)
    print(f"start   {describe_start(WORLDS / name)}")
    print(f"env id  {env_id(name)}")
    if failure is not None:
        raise failure


def build(name: str, overrides: list[str]) -> None:
    """Run the stages of a world that are out of date."""
    from tqdm import tqdm

    from pipeline.build.world import make_world
    from pipeline.compose import compose
    from pipeline.worlds import WORLDS

    def progress(stages: list) -> Iterator:
        tqdm.monitor_interval = 0  # no thread beside this one: stage 1 forks
        with tqdm(stages, desc=name, unit="stage", disable=None) as bar:
            for stage in bar:
                bar.set_postfix_str(stage.name)
                yield stage

    make_world(compose(overrides), WORLDS / name, progress)


def worlds(
    count: int | None,
    split: str,
    of: str | None,
    height_sd_m: float,
    jobs: int,
    overrides: list[str],
    light: bool = False,
    on: Literal["local", "ray"] = "local",
    stress_tests: int = 50,
    write: bool = False,
) -> None:
    """Make many worlds: generated mines, or with --of variants of one world within its survey's error."""
    from tqdm import tqdm

    from minexplore.splits import SIZES
    from pipeline.build.family import FAMILIES, generated, make_family, to_list, variants, without_rock
    from pipeline.build.splits import LIST, read_list, write_list
    from pipeline.errors import InputError
    from pipeline.import_mine import import_workings
    from pipeline.worlds import DEFAULT, world_folder, world_params

    if (split == "variants") != (of == DEFAULT):
        raise InputError(f"--split {split} --of {of}: variants of the {DEFAULT} world have the split variants")
    benchmark = of is None and light and not overrides
    if write and not benchmark:
        raise InputError("--list: the list has light generated mines without overrides only (--light)")
    count = count or (SIZES[split] if benchmark else 10)
    if of is None:
        members = generated(split, count, overrides)
    else:
        workings = import_workings(of, world_folder(of) / "contours/free_space.geojson")
        members = variants(of, workings, split, count, height_sd_m, world_params(of), overrides)
    if light:
        members = without_rock(members, stress_tests)
    listed = read_list() if benchmark and not write else {}
    outcomes = make_family(
        members, jobs, lambda done, n: tqdm(done, total=n, desc=split, unit="world", disable=None), on, listed
    )
    if write:
        write_list(to_list(outcomes))
    print(LIST if write else FAMILIES / "manifest.json")


def list_() -> None:
    """List the worlds in this project."""
    from pipeline.worlds import list_worlds

    print(list_worlds())


def show(name: str) -> None:
    """Show a world's metrics and their limits."""
    from pipeline.worlds import show_world

    print(show_world(name))


def compare(one: str, other: str) -> None:
    """Show the metrics and parameters that differ between two worlds."""
    from pipeline.worlds import compare_worlds

    print(compare_worlds(one, other))


def report(name: str) -> None:
    """Write a world's report.html, a single page that needs no network."""
    from pipeline.compose import compose
    from pipeline.report.page import write_page
    from pipeline.worlds import changed_params, env_id, world_folder

    folder = world_folder(name)
    print(write_page(folder, env_id(name), changed_params(name, compose([]))))


def add_to(commands: Any) -> None:
    """Declare the commands for worlds."""
    make = commands.add_parser("new", help=new.__doc__)
    make.add_argument("name", help="name of the world; conf/survey/NAME.yaml and artifacts/worlds/NAME are made")
    make.add_argument("--from", dest="source", type=Path, required=True, help="plan, map.yaml, drawing or survey")
    make.add_argument("--origin", default="not stated", help="source of the file")
    make.add_argument("--licence", default="not stated")
    make.add_argument("overrides", nargs="*", help="for example compile3d.height_m=2.8")
    add_options(make)
    make.add_argument(
        "--detected", type=Path, metavar="FILE.png", help="draw what of a plan was found, also if it is refused"
    )
    make.set_defaults(
        run=lambda a: new(a.name, a.source, a.origin, a.licence, stated_options(a.source, a), a.overrides, a.detected)
    )
    many = commands.add_parser("worlds", help=worlds.__doc__)
    many.add_argument("--count", type=positive, help="default: 10, or with --light the whole split")
    many.add_argument("--split", choices=["train", "validation", "test", "variants"], default="train")
    many.add_argument("--light", action="store_true", help="without visible rock (preset=light)")
    many.add_argument("--stress-tests", type=natural, default=50, help="light worlds that pass the stress test as well")
    many.add_argument("--list", dest="write", action="store_true", help="write the hashes to data/families/splits.csv")
    many.add_argument("--on", choices=["local", "ray"], default="local", help="ray: the cluster at RAY_ADDRESS")
    many.add_argument("--of", help="make variants of this world")
    many.add_argument("--height-sd", type=number, default=0.1, help="standard deviation of the variants' height, m")
    many.add_argument("--jobs", type=positive, default=os.cpu_count() or 1)
    many.add_argument("overrides", nargs="*", help="for example survey.mine.loops=0.8")
    many.set_defaults(
        run=lambda a: worlds(
            a.count, a.split, a.of, a.height_sd, a.jobs, a.overrides, a.light, a.on, a.stress_tests, a.write
        )
    )
    commands.add_parser("list", help=list_.__doc__).set_defaults(run=lambda a: list_())
    for function in (show, report):
        parser = commands.add_parser(function.__name__, help=function.__doc__)
        parser.add_argument("name", nargs="?", default="default")
        parser.set_defaults(run=lambda a, f=function: f(a.name))
    pair = commands.add_parser("compare", help=compare.__doc__)
    pair.add_argument("one")
    pair.add_argument("other")
    pair.set_defaults(run=lambda a: compare(a.one, a.other))
