"""Import a user's mine: detect its format, copy and register its files, write a commented survey section."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import yaml
from pydantic import TypeAdapter, ValidationError

from minesurveys.errors import InputError, MineError, ParamsError, one_line
from minesurveys.guard.plain_file import require_plain_file
from minesurveys.limits import FILE, reader_limits
from minesurveys.refusals import in_own_words
from minesurveys.remarks import hand_on, warn_user
from pipeline.errors import ArtifactError
from pipeline.findings import findings_of
from pipeline.own_mines import DATA, WORDS, require_kept, require_name, require_same, survey_file
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import SurveyParams
from pipeline.places import WRITTEN_BY_NEW
from pipeline.store.files import missing_folders, write_atomically
from pipeline.store.hashing import absence_of, sha256_bytes, sha256_file
from pipeline.store.registry import OWN_REGISTRY, read_registry, register, unregister
from pipeline.store.written import take_back
from pipeline.survey.detect import detect_survey
from pipeline.survey.detection.detected_section import Detection
from pipeline.survey.surfaces import HEIGHT_SUFFIXES, height_files
from pipeline.types import Image

_DRAWN_ISLAND_M2 = 1.0  # in a drawing a hole is a pillar; a picture, whose limit is 10 m2, has specks


@dataclass(frozen=True)
class ImportDraft:
    """What an import will write: the survey section and a copy of each file. Nothing is written yet.

    `picture` shows what of a plan's picture was taken for workings. `section` is None if there is one that is kept.
    """

    name: str
    section: str | None
    copies: dict[Path, Path] = field(default_factory=dict)
    picture: Image | None = None


@dataclass(frozen=True)
class Import:
    """The files that an import wrote with their sha256, its new folders, and the files that it registered."""

    written: dict[Path, str] = field(default_factory=dict)
    registered: list[Path] = field(default_factory=list)
    folders: list[Path] = field(default_factory=list)


def draft_import(
    name: str, source: Path, stated: StatedOptions, is_kept: bool = True, rules: FloorRules = FLOOR_RULES
) -> ImportDraft:
    """Detect how a mine's file is read, and draft its copies and its survey section. An existing section is kept.

    The section states the rules of the floor that are not the default ones.
    `warn_user` lists what is guessed, with the option that overrules it: the survey section only where it `is_kept`.

    Raises InputError, ParamsError if the name or the file cannot be used.
    """
    require_name(name)
    conf = survey_file(name)
    if conf.is_file():
        require_same(conf, name, source)
        require_kept(conf, stated)
        again = f"remove it to detect the file again, and {DATA / name} to read another file"
        warn_user(f"{conf} exists and is kept; only stages whose inputs changed run again; {again}")
        return ImportDraft(name, None)
    detected = detect_survey(source, stated, rules)
    copies = _targets(source, detected.files, DATA / name)
    detected = _with_heights(detected, stated, source)
    if stated.heights is not None:
        copies |= _targets(stated.heights, [Path(file) for file in height_files(stated.heights)], DATA / name)
        detected.values["heights"] = copies[stated.heights].as_posix()
    if stated.trajectory is not None:
        require_plain_file(stated.trajectory)
        copies |= _targets(stated.trajectory, [stated.trajectory], DATA / name)
        detected.values["trajectory"] = copies[stated.trajectory].as_posix()
    detected.values.update(rules.model_dump(exclude_defaults=True))
    section = survey_yaml(name, copies[detected.files[0]], detected, stated)
    require_section(section)
    hand_on(findings_of(detected, conf if is_kept else None))
    return ImportDraft(name, section, copies, detected.picture)


def import_mine(draft: ImportDraft, origin: str, licence: str) -> Import:
    """Copy and register a mine's files and write `conf/survey/NAME.yaml`.

    Raises
    ------
    InputError, ArtifactError
        If a file cannot be written. Then nothing is.
    """
    if draft.section is None:
        return Import()
    known, conf = read_registry(), survey_file(draft.name)
    section = draft.section.encode()
    written = {target: sha256_file(file) for file, target in draft.copies.items() if not target.is_file()}
    written |= {} if conf.is_file() else {conf: sha256_bytes(section)}
    made = Import(
        written,
        [path for path in draft.copies.values() if path.relative_to("data").as_posix() not in known],
        missing_folders(written),
    )
    try:
        for file, target in draft.copies.items():
            if target in made.written:
                write_atomically(target, file.read_bytes())
            register(target, origin, licence, OWN_REGISTRY)
        write_atomically(conf, section)
    except BaseException:
        forget_import(made)
        raise
    return made


def _with_heights(detected: Detection, stated: StatedOptions, source: Path) -> Detection:
    """Return what was detected with stated heights of the floor; grades of legs are among what was detected.

    Raises
    ------
    InputError
        If both are stated, the file has elevations of its own, or heights are not read from such a file.
    """
    heights, grade = stated.heights, stated.grade
    if heights is None and grade is None:
        return detected
    option = "--grade" if heights is None else f"--heights {heights}"
    if heights is not None and grade is not None:
        raise InputError(f"{source}: give --heights or --grade, not both")
    if isinstance(grade, dict):
        return detected
    if detected.has_heights:
        raise InputError(f"{source}: {option}: it has elevations of its own")
    if heights is not None:
        require_plain_file(heights)
        if heights.suffix.lower() not in HEIGHT_SUFFIXES:
            raise InputError(f"{heights}: --heights is read from {', '.join(HEIGHT_SUFFIXES)}")
    remarks = {"heights": "of the floor", "grade": "rise over run along the drifts, away from the entrance"}
    values = {**detected.values, **({} if grade is None else {"grade": grade})}
    return replace(detected, values=values, remarks={**detected.remarks, **remarks}, has_heights=True)


def forget_import(made: Import) -> None:
    """Remove what an import wrote and nobody has changed, and its lines in the registry; print what stays.

    What cannot be removed hinders nothing else from being removed.
    """
    try:
        unregister(made.registered)
    except (MineError, OSError) as error:
        print(f"{OWN_REGISTRY}: lines of {made.registered[0].parent} stay ({error})", file=sys.stderr)
    for path in take_back(made.written, made.folders):
        print(f"{path}: stays, as it was changed, holds other files or cannot be removed", file=sys.stderr)


def _targets(source: Path, files: list[Path], folder: Path) -> dict[Path, Path]:
    """Return where each file of a mine is copied to.

    Raises
    ------
    InputError
        If a file's name cannot stand in a configuration, a companion file lies outside the folder of `source`, a file
        is too large, or a different file is already there.
    """
    targets, most = {}, reader_limits().file_bytes
    for file in files:
        if not file.name.isprintable() or "$" in file.as_posix():
            raise InputError(f"{file.name!r}: a name with $, line breaks or control characters cannot be used")
        if file != source and not file.resolve().is_relative_to(source.parent.resolve()):
            raise InputError(f"{file}: a link that leads out of {source.parent}; copy the file there")
        if file.stat().st_size > most:
            raise InputError(f"{file}: {file.stat().st_size} bytes, the limit is {most} (file_bytes in {FILE})")
        target = targets[file] = folder / file.absolute().relative_to(source.parent.absolute())
        if target.is_file() and target.read_bytes() != file.read_bytes():
            raise InputError(f"{target}: a different file exists; remove it, or choose another name than {folder.name}")
    return targets


def require_section(text: str) -> None:
    """Refuse a survey section that stage 1 would not accept, because a stated value is out of range."""
    try:
        TypeAdapter(SurveyParams).validate_python(yaml.safe_load(text)["survey"])
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        raise ParamsError(f"survey.{where} = {first['input']!r}: {in_own_words(first)}") from error


def import_workings(name: str, source: Path) -> Path:
    """Copy a world's free space below data/ and register it as the source of variants.

    Raises
    ------
    ArtifactError
        If the world has no free space yet.
    InputError
        If a different free space of this name was copied before.
    """
    if not source.is_file():
        raise ArtifactError(f"{source}: {absence_of(source)}; make the world first")
    target = DATA / name / "variants" / source.name
    if target.is_file() and target.read_bytes() != source.read_bytes():
        raise InputError(f"{target}: comes from an earlier {name}; remove it and its line in {OWN_REGISTRY}")
    write_atomically(target, source.read_bytes())
    register(target, f"made from the world {name}", "as its sources", OWN_REGISTRY)
    return target


def survey_yaml(name: str, file: Path, detected: Detection, stated: StatedOptions) -> str:
    """Return the text of a survey section: the detected values, each with a comment."""
    values = {"kind": detected.values["kind"], "name": name, **detected.values}
    values |= {key: file.as_posix() for key in ("image", "file", "map") if key in values}
    values |= {"poses": None, "correct": None, "entrance_m": stated.entrance_m, "labels_m": {}}
    remarks = {
        "entrance_m": "[x, y] or [x, y, elevation]; null: of drifts with elevations the highest end on the largest "
        "floor, else the start of the longest drift",
        "labels_m": "{A: [x, y], ...}",
        **detected.remarks,
    }
    lines = [
        f"# @package _global_\n# {WRITTEN_BY_NEW} {name}`; correct wrong values and run it again.",
        f"defaults:\n  - /mine/{'heights' if detected.has_heights else 'own'}  # values and limits of a user's mine",
        *(["  - /mine/grid  # of occupancy grids"] if detected.values["kind"] == "grid" else []),
        "  - _self_\nsurvey:",
    ]
    for key, value in values.items():
        if isinstance(value, dict) and value:
            lines.append(f"  {key}:{'  # ' + one_line(remarks[key], 200) if key in remarks else ''}")
            lines += [f"    {_key(inner)}: {json.dumps(inner_value)}" for inner, inner_value in value.items()]
        else:
            lines.append(_line(f"  {key}: {json.dumps(value)}", remarks.get(key)))
    lines += ["contours:", _line("  components: largest", "or spawn: the component at entrance_m; or [[x, y], ...]")]
    smallest = _line(f"  min_island_m2: {_DRAWN_ISLAND_M2}", "smaller holes in the workings are filled, m2")
    lines += [smallest] if detected.values["kind"] == "vector" else []
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    """Return a key as YAML reads it back: a leg's name may be a number or a word with a meaning."""
    return name if name.isidentifier() and name.lower() not in WORDS else json.dumps(name)


def _line(text: str, remark: str | None) -> str:
    return f"{text:40}  # {one_line(remark, 200)}" if remark else text  # a remark may quote the user's file
