"""The survey of a mine, as stage 1 writes it: one folder that holds what the mine has, and no more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from pipeline.errors import ArtifactError
from pipeline.store.codecs import decode, encode
from pipeline.store.files import adapter_of
from pipeline.types import (
    ClosedMesh,
    DrawnFloors,
    DrawnPlan,
    FloorMesh,
    Image,
    Survey,
    SurveyedLegs,
    VolumeShape,
    Workings,
)

WORKINGS, FLOORS = "workings.geojson", "floors.npz"  # also of what stage 2 traces: floors of a plan with heights
_SURVEY, _PLAN = "survey.json", "plan.png"
_LEGS, _SOLID, _SHAFTS, _DRAWN_FROM = "legs.npz", "solid.npz", "shafts.npz", "drawn_from.npz"
_RECORDS: dict[str, Any] = {
    _LEGS: SurveyedLegs,
    _SOLID: ClosedMesh,
    FLOORS: FloorMesh,
    _SHAFTS: SurveyedLegs,
    _DRAWN_FROM: SurveyedLegs,
}
_KINDS: dict[str, Any] = {_SURVEY: Survey, _PLAN: Image, WORKINGS: Workings, **_RECORDS}


class MineModel(Enum):
    """What a mine is built as: walls about a level floor, or one closed volume."""

    LEVEL = "level"
    VOLUME = "volume"


@dataclass(frozen=True)
class MineSurvey:
    """One mine as its survey has it.

    Attributes
    ----------
    survey : Survey
        Frame, scale, places and sources.
    plan : (rows, cols, 3) uint8, BGR
        The picture that was read, or a drawing of the mine seen from above.
    shape : DrawnPlan, SurveyedLegs, ClosedMesh or DrawnFloors
    workings : Workings, optional
        The mine seen from above, m, mine frame; None if stage 2 finds it in the picture.
    """

    survey: Survey
    plan: Image
    shape: DrawnPlan | VolumeShape
    workings: Workings | None = None

    @property
    def model(self) -> MineModel:
        """Return what the mine is built as: a plan without heights is level, all else is a volume."""
        is_level = isinstance(self.shape, DrawnPlan) and self.survey.heights is None
        return MineModel.LEVEL if is_level else MineModel.VOLUME

    @property
    def source(self) -> str:
        """Return the survey's file, which messages name; of a generated mine its name."""
        return (self.survey.sources or [self.survey.name])[0]


def survey_files(mine: MineSurvey) -> dict[str, bytes]:
    """Return the files of a survey's folder by name."""
    return {name: encode(Path(name), part) for name, part in _parts_of(mine).items()}


def open_survey(folder: Path) -> MineSurvey:
    """Read a survey's folder.

    Raises
    ------
    ArtifactError
        If a file is missing, broken, or none of a survey; the message names it.
    """
    if not (folder / _SURVEY).exists():
        decode(folder / _SURVEY, Survey)  # says what is missing
    names = sorted(path.name for path in folder.iterdir())
    for name in names:
        if name not in _KINDS:
            raise ArtifactError(f"{folder / name}: no file of a survey; the files are {', '.join(_KINDS)}")
    return _of_parts(folder, {name: decode(folder / name, _KINDS[name]) for name in names})


def survey_arrays(mine: MineSurvey) -> tuple[Any, dict[str, np.ndarray]]:
    """Return a survey as JSON values and arrays, which one process hands to another."""
    parts = _parts_of(mine)
    arrays = {_PLAN: mine.plan}
    if mine.workings is not None:
        arrays[WORKINGS] = np.frombuffer(shapely.to_wkb(mine.workings.polygons), np.uint8)
    for name in _RECORDS.keys() & parts.keys():
        arrays |= {f"{name}/{f.name}": np.asarray(getattr(parts[name], f.name)) for f in fields(parts[name])}
    return adapter_of(Survey).dump_python(mine.survey, mode="json"), arrays


def survey_of_arrays(values: Any, arrays: Mapping[str, np.ndarray]) -> MineSurvey:
    """Return the survey that `survey_arrays` took apart."""
    parts: dict[str, Any] = {_SURVEY: adapter_of(Survey).validate_python(values), _PLAN: arrays[_PLAN]}
    if WORKINGS in arrays:
        parts[WORKINGS] = Workings(shapely.from_wkb(arrays[WORKINGS].tobytes()))
    for name in {key.partition("/")[0] for key in arrays} & _RECORDS.keys():
        found = {f: arrays[f"{name}/{f.name}"] for f in fields(_RECORDS[name])}
        # Between processes an array of no dimension gets one.
        numbers = {f.name: array.item() if f.type == "float" else array for f, array in found.items()}
        parts[name] = _RECORDS[name](**numbers)
    return _of_parts(Path(), parts)


def volume_of(mine: MineSurvey, traced: Path) -> VolumeShape:
    """Return what a volume is made of: the survey's shape, or of a plan with heights the floors that stage 2 traced."""
    if isinstance(mine.shape, DrawnPlan):
        return DrawnFloors(decode(traced / FLOORS, FloorMesh))
    return mine.shape


def _parts_of(mine: MineSurvey) -> dict[str, Any]:
    match mine.shape:
        case DrawnPlan(legs):
            shape: dict[str, Any] = {_DRAWN_FROM: legs}
        case SurveyedLegs():
            shape = {_LEGS: mine.shape}
        case ClosedMesh():
            shape = {_SOLID: mine.shape}
        case DrawnFloors(mesh, shafts):
            shape = {FLOORS: mesh, _SHAFTS: shafts}
    parts = {_SURVEY: mine.survey, _PLAN: mine.plan, WORKINGS: mine.workings, **shape}
    return {name: part for name, part in parts.items() if part is not None}


def _of_parts(folder: Path, parts: Mapping[str, Any]) -> MineSurvey:
    shapes = [parts[name] for name in (_LEGS, _SOLID) if name in parts]
    if FLOORS in parts:
        shapes.append(DrawnFloors(parts[FLOORS], parts.get(_SHAFTS)))
    if len(shapes) > 1 or _PLAN not in parts or not (shapes == [] or WORKINGS in parts):
        raise ArtifactError(f"{folder}: {', '.join(sorted(parts))} are not the files of one survey")
    shape = shapes[0] if shapes else DrawnPlan(parts.get(_DRAWN_FROM))
    return MineSurvey(parts[_SURVEY], parts[_PLAN], shape, parts.get(WORKINGS))
