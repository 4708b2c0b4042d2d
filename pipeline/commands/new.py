"""The command that makes a world from a mine's file, or with --dry-run shows what it would read."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipeline.commands.options import add_options, stated_options
from pipeline.commands.remark_table import remark_table
from pipeline.commands.worlds import build, write_report
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
    only_read: bool = False,
) -> None:
    """Make a world from a mine's file: detect the format, write conf/survey/NAME.yaml, run all stages and report.

    What was guessed, dropped or assumed is listed once, at the end, also if the file is refused.
    """
    from minesurveys.errors import DoubtError
    from pipeline.errors import InputError
    from pipeline.own_mines import require_name
    from pipeline.store.locks import hold_lock
    from pipeline.worlds import WORLDS

    require_name(name)
    _require_place(detected, source)
    shown = detected or (WORLDS / name / DETECTED if only_read else None)
    try:
        with _remarks_listed(source):
            if only_read and shown is not None:
                _show(name, source, stated, overrides, shown)
            else:
                with hold_lock(WORLDS / f".{name}.lock", f"name = {name}: another command is making this world"):
                    _make(name, source, origin, licence, stated, overrides, detected)
    except DoubtError as error:  # nothing is left behind but the picture that was asked for
        if shown is None:
            raise InputError(f"{error}; --detected FILE.png draws what was found") from error
        _write_picture(shown, error.picture)
        raise InputError(f"{error}; {shown} shows what was found") from error


@contextmanager
def _remarks_listed(source: Path) -> Iterator[None]:
    """List the remarks of what runs in a table on standard error, also if it fails; not if it is interrupted."""
    from minesurveys.remarks import collect_remarks

    with collect_remarks() as remarks:
        failure = None
        try:
            yield
        except Exception as error:
            failure = error
        if remarks:
            print(remark_table(source.name, remarks), file=sys.stderr)
    if failure is not None:
        raise failure


def _require_place(detected: Path | None, source: Path) -> None:
    """Refuse a place for the picture of what was found that is no .png file in a folder, or is taken."""
    from pipeline.errors import InputError

    if detected is None:
        return
    if detected.suffix.lower() != ".png" or not detected.parent.is_dir() or detected.is_dir():
        raise InputError(f"--detected {detected}: expected FILE.png in a folder that exists")
    if os.path.lexists(detected):
        is_plan = detected.resolve() == source.resolve()
        what = "is the plan itself" if is_plan else "there is a file"
        raise InputError(f"--detected {detected}: {what}; choose another name")


def _write_picture(path: Path, picture: Any) -> str:
    """Write a picture and return its sha256."""
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_atomically
    from pipeline.store.hashing import sha256_bytes

    data = encode(path, picture)
    write_atomically(path, data)
    return sha256_bytes(data)


def _show(name: str, source: Path, stated: StatedOptions, overrides: list[str], detected: Path) -> None:
    """Read the file, draw what was read, and build nothing."""
    from pipeline.build.dry_run import dry_run

    _write_picture(detected, dry_run(name, source, stated, overrides).picture)
    print(f"read    {source}; nothing is built")
    print(f"drawn   {detected}")


def _make(
    name: str,
    source: Path,
    origin: str,
    licence: str,
    stated: StatedOptions,
    overrides: list[str],
    detected: Path | None,
) -> None:
    from minesurveys.remarks import hand_on, record_remarks
    from minexplore.ends import uninterrupted
    from pipeline.compose import compose, floor_rules_of
    from pipeline.errors import LimitError
    from pipeline.import_mine import draft_import, import_mine
    from pipeline.report.remarks import read_detected, write_detected
    from pipeline.worlds import WORLDS, describe_start, env_id

    with record_remarks() as found:
        draft = draft_import(name, source, stated, rules=floor_rules_of(overrides))
    if draft.section is None:
        hand_on(read_detected(WORLDS / name))
    pictures, failure = dict[Path, str](), None
    imported = import_mine(draft, origin, licence)
    try:
        if draft.picture is not None:
            for path in filter(None, (WORLDS / name / DETECTED, detected)):
                pictures[path] = _write_picture(path, draft.picture)
        if draft.section is not None:
            pictures |= write_detected(WORLDS / name, found)
        is_drawn = draft.picture is not None
        del draft  # a plan of 50 million pixels takes 150 MB
        build(name, [f"survey={name}", *overrides])
    except LimitError as error:
        failure = error
    except BaseException as error:
        if detected is not None:
            pictures.pop(detected, None)  # it was asked for
        with uninterrupted():
            _take_back(name, imported, pictures, error)
        raise
    if is_drawn:
        print(f"taken for workings: {WORLDS / name / DETECTED}", file=sys.stderr)
    print(f"world   {WORLDS / name / 'realism' / 'world'}")
    print("report ", end=" ")
    write_report(name, compose([]))
    print(f"start   {describe_start(WORLDS / name)}")
    print(f"env id  {env_id(name)}")
    if failure is not None:
        raise failure


def _take_back(name: str, imported: Any, pictures: dict[Path, str], error: BaseException) -> None:
    """Remove what an import wrote after an error.

    A refused mine leaves nothing behind. Ctrl-C and a lack of memory or space leave nothing before the file is read,
    and keep the finished stages later.
    """
    from minesurveys.errors import lacks_resources
    from pipeline.build.world import remove_world
    from pipeline.errors import MineError
    from pipeline.import_mine import forget_import
    from pipeline.store.written import take_back
    from pipeline.worlds import WORLDS

    is_read = (WORLDS / name / "survey").is_dir()
    refused = isinstance(error, Exception) and not lacks_resources(error)
    if imported.written and (refused or not is_read):
        forget_import(imported)
        take_back(pictures, ())
        try:
            remove_world(WORLDS / name)
        except (MineError, OSError) as left:
            print(f"{WORLDS / name}: stays ({left})", file=sys.stderr)
            return
        remedy = "; state corrected values as overrides, for example survey.snap_m=1" if refused else ""
        if isinstance(error, Exception):
            print(f"nothing is kept{remedy}", file=sys.stderr)
    elif lacks_resources(error):
        print(f"{WORLDS / name}: the finished stages are kept; the same command continues", file=sys.stderr)


def add_to(commands: Any) -> None:
    """Declare the command."""
    make = commands.add_parser("new", help=(new.__doc__ or "").splitlines()[0])
    make.add_argument("name", help="name of the world; conf/survey/NAME.yaml and artifacts/worlds/NAME are made")
    make.add_argument("--from", dest="source", type=Path, required=True, help="plan, map.yaml, drawing or survey")
    make.add_argument("--origin", default="not stated", help="source of the file")
    make.add_argument("--licence", default="not stated")
    make.add_argument("overrides", nargs="*", help="for example compile3d.height_m=2.8")
    add_options(make)
    make.add_argument(
        "--detected", type=Path, metavar="FILE.png", help="draw what of a plan was found, also if it is refused"
    )
    make.add_argument(
        "--dry-run",
        action="store_true",
        help="read the file, list what is guessed or dropped, and draw what was read; build nothing",
    )
    make.set_defaults(run=_run)


def _run(a: Any) -> None:
    new(a.name, a.source, a.origin, a.licence, stated_options(a.source, a), a.overrides, a.detected, a.dry_run)
