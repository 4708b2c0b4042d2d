"""The whole configuration, with one section for each stage."""

from __future__ import annotations

from pydantic import model_validator

from pipeline.params.base import Params
from pipeline.params.compile3d import Compile3dParams
from pipeline.params.contours import ContoursParams
from pipeline.params.realism import RealismParams
from pipeline.params.surface import SurfaceParams
from pipeline.params.survey import SurveyParams
from pipeline.params.validation import ValidationParams


class Config(Params):
    """Everything that a run depends on, except its inputs and its code."""

    survey: SurveyParams
    contours: ContoursParams
    compile3d: Compile3dParams
    surface: SurfaceParams
    realism: RealismParams
    validation: ValidationParams

    @model_validator(mode="after")
    def _texture_of_a_look(self) -> Config:
        if self.surface.texture.tether_m is not None and self.realism.look == "plain":
            raise ValueError("surface.texture.tether_m needs a look other than realism.look=plain; choose look=dry")
        return self

    @model_validator(mode="after")
    def _fittings_on_rock(self) -> Config:
        if self.surface.overlay == "none" and (self.realism.floor or self.realism.furnish != "off"):
            raise ValueError("realism.floor and realism.furnish need visible rock (surface.overlay=rough)")
        return self

    @model_validator(mode="after")
    def _robot_fits_where_it_starts(self) -> Config:
        start_m, robot_m = self.compile3d.spawn.clearance_m, self.validation.certificate.robot_radius_m
        if start_m < robot_m:
            raise ValueError(
                f"compile3d.spawn.clearance_m = {start_m:g}: less than the robot's radius of {robot_m:g} m "
                "(validation.certificate.robot_radius_m)"
            )
        return self
