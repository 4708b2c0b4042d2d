"""Commands that make, list, show, compare and report worlds."""

from __future__ import annotations

import shlex
import sys
from typing import TYPE_CHECKING, Any, NoReturn

from pieces.work import Where, add_options, where_of
from pipeline.commands.arguments import natural, number, positive

if TYPE_CHECKING:
    from pathlib import Path

    from pipeline.params.config import Config
    from pipeline.report.page import WorldView
    from pipeline.store.mine_survey import MineSurvey


def this_command() -> str:
    """Return the command line of this process, which continues what is unfinished."""
    return shlex.join(["python", "-m", "pipeline", *sys.argv[1:]])


def build(name: str, overrides: list[str]) -> None:
    """Run the stages of a world that are out of date."""
    from pipeline.build.world import make_world
    from pipeline.compose import compose
    from pipeline.worlds import WORLDS

    make_world(compose(overrides), WORLDS / name, this_command())


def worlds(
    count: int | None,
    split: str,
    of: str | None,
    height_sd_m: float,
    where: Where,
    overrides: list[str],
    light: bool = False,
    stress_tests: int = 50,
    write: bool = False,
) -> None:
    """Make many worlds: generated mines, or with --of variants of one world within its survey's error."""
    from minexplore.splits import SIZES
    from pipeline.build.family import FAMILIES, generated, make_family, to_list, variants, without_rock
    from pipeline.build.splits import LIST, read_list, write_list
    from pipeline.errors import InputError
    from pipeline.stage import by_model
    from pipeline.worlds import DEFAULT, survey_of, world_folder, world_params

    if (split == "variants") != (of == DEFAULT):
        raise InputError(f"--split {split} --of {of}: variants of the {DEFAULT} world have the split variants")
    benchmark = of is None and light and not overrides
    if write and not benchmark:
        raise InputError("--list: the list has light generated mines without overrides only (--light)")
    count = count or (SIZES[split] if benchmark else 10)
    if of is None:
        members = generated(split, count, overrides)
    else:
        workings = by_model(level=_import_plan, volume=_refuse_volume)(of, survey_of(world_folder(of)))
        members = variants(of, workings, split, count, height_sd_m, world_params(of), overrides)
    if light:
        members = without_rock(members, stress_tests)
    listed = read_list() if benchmark and not write else {}
    outcomes = make_family(members, where, listed, this_command())
    if write:
        write_list(to_list(outcomes))
    print(LIST if write else FAMILIES / "manifest.json")


def _import_plan(of: str, mine: MineSurvey) -> Path:
    from pipeline.import_mine import import_workings
    from pipeline.worlds import world_folder

    return import_workings(of, world_folder(of) / "contours/free_space.geojson")


def _refuse_volume(of: str, mine: MineSurvey) -> NoReturn:
    from pipeline.errors import InputError

    raise InputError(f"--of {of}: variants are made of the plan of a level mine, and this world is one volume")


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

    write_report(name, compose([]))


def write_report(name: str, default: Config) -> None:
    """Write a world's report.html, which lists what of its parameters differs from the default."""
    from pipeline.report.page import write_page
    from pipeline.stage import by_model
    from pipeline.worlds import changed_params, env_id, survey_of, world_folder

    folder = world_folder(name)
    view = by_model(level=lambda folder, mine: None, volume=_view_of_volume)(folder, survey_of(folder))
    print(write_page(folder, env_id(name), changed_params(name, default), view))


def _view_of_volume(folder: Path, mine: MineSurvey) -> WorldView:
    from pipeline.volume.world.page import volume_view

    return volume_view(folder, mine)


def add_to(commands: Any) -> None:
    """Declare the commands for worlds."""
    many = commands.add_parser("worlds", help=worlds.__doc__)
    many.add_argument("--count", type=positive, help="default: 10, or with --light the whole split")
    many.add_argument("--split", choices=["train", "validation", "test", "variants"], default="train")
    many.add_argument("--light", action="store_true", help="without visible rock (preset=light)")
    many.add_argument("--stress-tests", type=natural, default=50, help="light worlds that pass the stress test as well")
    many.add_argument("--list", dest="write", action="store_true", help="write the hashes to data/families/splits.csv")
    many.add_argument("--of", help="make variants of this world")
    many.add_argument("--height-sd", type=number, default=0.1, help="standard deviation of the variants' height, m")
    add_options(many)
    many.add_argument("overrides", nargs="*", help="for example survey.mine.loops=0.8")
    many.set_defaults(
        run=lambda a: worlds(
            a.count, a.split, a.of, a.height_sd, where_of(a), a.overrides, a.light, a.stress_tests, a.write
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
