"""Stage 4: the visible rock."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.params.base import Params

Channel = Annotated[int, Field(ge=0, le=255)]


class TextureParams(Params):
    """The rock's colour picture, made from seeded noise."""

    size_px: int = Field(ge=16, le=4096)
    repeat_m: float = Field(gt=0)
    spectral_exponent: float = Field(ge=0, le=4)
    contrast: float = Field(ge=0, le=1)
    rgb: tuple[Channel, Channel, Channel]
    seed: int = Field(ge=0)


class SurfaceParams(Params):
    """The octagonal base layer and its material."""

    sill_chamfer_m: float = Field(gt=0)
    back_chamfer_m: float = Field(gt=0)
    texture: TextureParams
