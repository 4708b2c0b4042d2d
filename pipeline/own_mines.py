"""The names of own mines, and what `new` keeps of a mine that exists."""

from __future__ import annotations

import filecmp
import re
from pathlib import Path

import yaml

from minesurveys.guard.plain_file import require_plain_file
from minexplore import is_built_in
from pipeline.errors import InputError, ParamsError
from pipeline.params.stated import StatedOptions
from pipeline.places import CONF, WRITTEN_BY_NEW

DATA = Path("data/mines")
_NAME = r"[A-Za-z][A-Za-z0-9_-]{0,63}"
# YAML or this project gives these words another meaning.
WORDS = {"default", "true", "false", "null", "none", "nan", "inf", "yes", "no", "on", "off"}


def survey_file(name: str) -> Path:
    """Return the path of a mine's survey section."""
    return CONF / "survey" / f"{name}.yaml"


def require_name(name: str) -> None:
    """Refuse a name that is no name of a world, or belongs to this project.

    Raises
    ------
    ParamsError
        The message states the rule.
    """
    if not re.fullmatch(_NAME, name):
        raise ParamsError(f"name = {name!r}: expected a letter, then letters, digits, - and _, at most 64 in all")
    if name.lower() in WORDS:
        raise ParamsError(f"name = {name}: is a reserved word ({', '.join(sorted(WORDS))}); choose another name")
    if is_built_in(f"MineXplore/{name}-v0"):
        raise ParamsError(f"name = {name}: MineXplore/{name}-v0 is an environment of this project; choose another name")
    conf = survey_file(name)
    if conf.is_file() and f"{WRITTEN_BY_NEW} {name}`" not in conf.read_text():
        raise ParamsError(f"name = {name}: {conf} is a survey of this project; choose another name")
    if conf.is_file() and not (DATA / name).is_dir():
        raise ParamsError(f"name = {name}: {conf} is there without {DATA / name}; remove it to read the file again")


def require_same(conf: Path, name: str, source: Path) -> None:
    """Refuse a file of which a mine that exists has no copy: the mine was read from another one.

    Raises
    ------
    InputError
        If no file of the mine has the same bytes.
    """
    require_plain_file(source)
    folder = DATA / name
    if not any(path.is_file() and filecmp.cmp(source, path, shallow=False) for path in folder.rglob("*")):
        raise InputError(
            f"{source}: {name} was read from another file, which is in {folder}; remove {conf} and {folder} to read "
            "this one, or choose another name"
        )


def require_kept(conf: Path, stated: StatedOptions) -> None:
    """Refuse options that differ from a section that exists, as it is kept and they would do nothing.

    Raises
    ------
    ParamsError
        If the section states another value of the same key.
    """
    section = (yaml.safe_load(conf.read_text()) or {}).get("survey") or {}
    scale = section.get("scale")
    kept = {**section, **(scale if isinstance(scale, dict) else {})}
    for key, value in stated.values().items():
        written = [{"rgb": rgb} for rgb in value] if key == "ignore_colours" else value
        if key not in ("heights", "trajectory") and key in kept and kept[key] != written:
            raise ParamsError(
                f"survey.{key} = {value}: {conf} exists and states {kept[key]}; change it there, or remove it"
            )
