"""Worlds that are one volume, built by stages 1, 3 and 5 in memory and measured by stage 6."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from pipeline.params.survey import PassageSurveyParams, SolidSurveyParams, VectorSurveyParams
from pipeline.params.validation import VolumeProofParams
from pipeline.places import TEXTURE
from pipeline.store.codecs import decode, encode
from pipeline.store.mine_survey import MineSurvey, volume_of
from pipeline.survey.load import read_unlimited
from pipeline.types import SurveyedLegs, VolumeShape
from pipeline.volume.world.bundle import bundle_volume
from pipeline.volume.world.proof.certificate import Validated, VolumeBundle, open_volume, validate_volume
from pipeline.volume.world.surface.build import rock_of_volume
from stages.compile3d import compile_rock
from stages.contours import trace_free_space
from tests.composed import compose

CONFIG, WITH_ROCK = compose(["preset=light"]), compose(["+mine=heights"])
HEADER = "leg,station,easting_m,northing_m,elevation_m,left_m,right_m,up_m,down_m\n"
RAMP = HEADER + "A,1,0,0,0,2,2,3,0\nA,2,30,0,0,2,2,3,0\nA,3,60,0,-6,2,2,3,0\n"


def legs_of_table(text: str, folder: Path, **values: Any) -> SurveyedLegs:
    """Return the legs that stage 1 writes of a station table that is built as one volume."""
    shape = survey_of_table(text, folder, **values).shape
    assert isinstance(shape, SurveyedLegs)
    return shape


def survey_of_table(source: str | Path, folder: Path, **values: Any) -> MineSurvey:
    """Return what stage 1 writes of a station table, or of the file of a station survey."""
    path = source if isinstance(source, Path) else folder / "survey.csv"
    if isinstance(source, str):
        path.write_text(source)
    section = {"kind": "passages", "name": "test", "file": "data/x", "flat_step_m": 0}  # level ones, too
    params = PassageSurveyParams.model_validate({**section, **values})
    return read_unlimited(params.model_copy(update={"file": path.as_posix()}))


def survey_of_areas(path: Path, heights: Path | None = None, **values: Any) -> MineSurvey:
    """Return what stage 1 writes of a drawing; `values` are those of the survey's section."""
    params = VectorSurveyParams.model_validate({"kind": "vector", "name": "test", "file": "data/x", **values})
    update = {"file": path.as_posix(), "heights": None if heights is None else heights.as_posix()}
    return read_unlimited(params.model_copy(update=update))


class VolumeWorld:
    """A station table, or a file, built as one volume; its bundle is in `folder / "world"`."""

    def __init__(self, source: str | Path | MineSurvey, folder: Path, **values: Any) -> None:
        """Run the functions of stages 1, 2, 3 and 5; `values` are those of the survey's section."""
        mine = source if isinstance(source, MineSurvey) else survey_of_table(source, folder, **values)
        self.mine, self.survey, self.folder = mine, mine.survey, folder
        self.traced = trace_free_space(CONFIG.contours, mine)
        write(folder / "traced", self.traced["traced"])
        self.shape: Any = volume_of(mine, folder / "traced")
        self.compiled, self.bundle = folder / "compiled", folder / "world"
        seen = {"free_space": self.traced["free_space"], "topology": self.traced["topology"]}
        write(self.compiled, compile_rock(CONFIG.compile3d, mine, **seen, traced=folder / "traced")["compiled"])
        write(self.bundle, bundle_volume(CONFIG.realism, self.survey, self.traced["free_space"], self.compiled))

    @classmethod
    def from_solid(cls, path: Path, **values: Any) -> Self:
        """Build a mesh of workings instead; the folders are beside it."""
        section = {"kind": "solid", "name": "test", "file": "data/x", "heights": None}
        params = SolidSurveyParams.model_validate(section | values)
        return cls(read_unlimited(params.model_copy(update={"file": path.as_posix()})), path.parent)

    @classmethod
    def from_areas(cls, path: Path, heights: Path | None = None, **values: Any) -> Self:
        """Build the areas of a drawing with heights instead; `values` are those of the survey's section."""
        return cls(survey_of_areas(path, heights, **values), path.parent)

    def opened(self) -> VolumeBundle:
        """Return the bundle, checked as stage 6 does."""
        return open_volume(self.bundle)

    def decoded(self, name: str, kind: Any) -> Any:
        """Return a file of the bundle."""
        return decode(self.bundle / name, kind)


def with_rock(source: str | MineSurvey, folder: Path) -> Path:
    """Build a station table, or a survey, in a folder, with its rock in `folder / "rocky"`; return the folder."""
    built, rock = VolumeWorld(source, folder), folder / "rock"
    texture = np.full((16, 16, 3), 90, np.uint8)
    write(rock, {**rock_of_volume(WITH_ROCK.surface, folder / "compiled", texture).files, TEXTURE: texture})
    plan = built.traced["free_space"]
    write(folder / "rocky", bundle_volume(WITH_ROCK.realism, built.survey, plan, built.compiled, rock))
    return folder


def proof(**values: Any) -> VolumeProofParams:
    """Return the parameters of stage 6 with nothing thrown, and other values."""
    quiet = {"robot_contacts": 0, "ball_contacts": 0}
    return CONFIG.validation.volume.model_copy(update=quiet | values)


def validated(world: VolumeBundle, shape: VolumeShape, **values: Any) -> Validated:
    """Return what stage 6 measures of a bundle that was read."""
    return validate_volume(proof(**values), world, shape)


def write(folder: Path, files: Mapping[str, Any]) -> None:
    """Write values by the names of their files into a folder, which is made."""
    folder.mkdir(exist_ok=True, parents=True)
    for name, value in files.items():
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_bytes(encode(folder / name, value))
