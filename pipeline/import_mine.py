"""A mine of your own: its file is looked at, copied and registered, and a survey section with remarks is written."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml
from pydantic import TypeAdapter, ValidationError

from minexplore import WORLDS
from pipeline.compose import CONF
from pipeline.errors import ArtifactError, InputError, ParamsError
from pipeline.params.survey import SurveyParams
from pipeline.store.files import write_atomically
from pipeline.store.registry import register
from pipeline.survey.detect import WIDTHS_M, Detection, detect_survey

DATA = Path("data/mines")
_KINDS = {
    "plan": "a plan image",
    "grid": "an occupancy grid",
    "vector": "a vector drawing",
    "passages": "a station survey",
}
_NAME = r"[A-Za-z][A-Za-z0-9_-]{0,63}"
_WORDS = {"default", "true", "false", "null", "none", "nan", "inf", "yes", "no", "on", "off"}  # mean something else


def survey_file(name: str) -> Path:
    """Return where a mine's survey section lies."""
    return CONF / "survey" / f"{name}.yaml"


def import_mine(name: str, source: Path, origin: str, licence: str, stated: dict[str, Any]) -> list[str]:
    """Copy and register a mine's files and write `conf/survey/NAME.yaml`, unless it is there: then it is kept.

    Returns
    -------
    list of str
        What was found out, one line each, with the YAML line that corrects a wrong reading.

    Raises
    ------
    InputError, ParamsError
        If the name or the file cannot be used; nothing is then written.
    """
    conf = survey_file(name)
    if not re.fullmatch(_NAME, name) or name.lower() in _WORDS:
        raise ParamsError(f"name = {name!r}: want a letter, then letters, digits, - and _, at most 64")
    if f"MineXplore/{name}-v0" in WORLDS:
        raise ParamsError(f"name = {name}: MineXplore/{name}-v0 is an environment of the project's own")
    if conf.is_file():
        if f"`python -m pipeline new {name}`" not in conf.read_text() or not (DATA / name).is_dir():
            raise ParamsError(f"name = {name}: {conf} is a survey of the project's own; choose another name")
        return [f"{conf} is kept as it is; remove it to look at the file anew"]
    detected = detect_survey(source, stated)
    folder = DATA / name
    placed = {file: folder / file.absolute().relative_to(source.parent.absolute()) for file in detected.files}
    for file, place in placed.items():
        if place.is_file() and place.read_bytes() != file.read_bytes():
            raise InputError(f"{place}: holds another file; remove it, or choose another name than {name}")
    text = survey_yaml(name, placed[detected.files[0]], detected, stated)
    _require_section(text)
    for file, place in placed.items():
        if not place.is_file():
            write_atomically(place, file.read_bytes())
        register(place, origin, licence)
    write_atomically(conf, text.encode())
    return _findings(conf, detected)


def _require_section(text: str) -> None:
    """Refuse a section that stage 1 would not take: a value was stated that it cannot be."""
    try:
        TypeAdapter(SurveyParams).validate_python(yaml.safe_load(text)["survey"])
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        raise ParamsError(f"survey.{where} = {first['input']!r}: {first['msg']}") from error


def import_workings(name: str, source: Path) -> Path:
    """Copy a world's free space below data/ and register it, so that variants of it can be made.

    Raises
    ------
    InputError
        If another one of that name was copied before.
    """
    if not source.is_file():
        raise ArtifactError(f"{source}: missing; make the world first")
    place = DATA / name / "variants" / source.name
    if place.is_file() and place.read_bytes() != source.read_bytes():
        raise InputError(f"{place}: is of an earlier {name}; remove it and its line in data/registry.txt")
    write_atomically(place, source.read_bytes())
    register(place, f"made from the world {name}", "as its sources")
    return place


def survey_yaml(name: str, file: Path, detected: Detection, stated: dict[str, Any]) -> str:
    """Return the text of a survey section: what was detected, and a remark beside each value."""
    values = {"kind": detected.values["kind"], "name": name, **detected.values}
    for key in ("image", "file", "map"):
        if key in values:
            values[key] = file.as_posix()
    values |= {"poses": None, "entrance_m": stated.get("entrance_m"), "labels_m": {}}
    remarks = {
        "entrance_m": "[x, y]; null: the start of the longest drift",
        "labels_m": "{A: [x, y], ...}",
        **detected.remarks,
    }
    lines = [
        f"# @package _global_\n# Written by `python -m pipeline new {name}`; correct what is wrong and run it again.",
        "defaults:\n  - /mine/own  # tolerance, room for rock and limits of a mine other than the published one",
        "  - _self_\nsurvey:",
    ]
    for key, value in values.items():
        if isinstance(value, dict) and value:
            lines.append(f"  {key}:{'  # ' + remarks[key] if key in remarks else ''}")
            lines += [f"    {inner}: {json.dumps(held)}" for inner, held in value.items()]
        else:
            lines.append(_line(f"  {key}: {json.dumps(value)}", remarks.get(key)))
    lines += ["contours:", _line("  parts: largest", "or spawn: those at entrance_m; or [[x, y], ...]")]
    return "\n".join(lines) + "\n"


def _line(text: str, remark: str | None) -> str:
    return f"{text:40}  # {remark}" if remark else text


def _findings(conf: Path, detected: Detection) -> list[str]:
    lines = [f"{detected.files[0].name}: {_KINDS[detected.values['kind']]}; wrong? correct {conf}"]
    if detected.values.get("line_drawing"):
        lines.append("walls are drawn as lines and what they enclose is filled; wrong? survey.line_drawing: false")
    if detected.values.get("light_on_dark"):
        lines.append("light on dark paper; wrong? survey.light_on_dark: false")
    if "scale" in detected.remarks:
        lines.append(f"scale: {detected.remarks['scale']}; wrong? survey.scale")
    if detected.values.get("unit"):
        lines.append(
            f"unit: {detected.values['unit']}, as drifts are then {detected.width_m:.1f} m wide; wrong? survey.unit"
        )
    low, high = WIDTHS_M
    if not low <= detected.width_m <= high:
        where = "survey.scale" if "scale" in detected.values else "survey.unit"
        lines.append(
            f"WARNING: drifts would be {detected.width_m:.2f} m wide, outside {low:g} to {high:g} m; "
            f"is the scale right? {where}"
        )
    return lines
