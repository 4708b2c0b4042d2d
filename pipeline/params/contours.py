"""Stage 2: from the plan's pixels to the free-space polygon and the drift network."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.params.base import Params
from pipeline.params.survey import PosesParams


class NetworkParams(Params):
    """Cells, shortest leg and stations of the drift network."""

    cell_m: float = Field(gt=0.02, le=2)
    min_leg_m: float = Field(ge=0, le=50)
    station_spacing_m: float = Field(gt=0, le=100)


class ContoursParams(Params):
    """Binarisation, cleaning, tracing and simplification."""

    threshold: Literal["otsu"] | Annotated[int, Field(ge=1, le=254)]
    annotation_chroma: int = Field(ge=1, le=255)
    annotation_margin_m: float = Field(ge=0, le=5)
    bridge_m: float = Field(ge=0, le=20)
    despeck_m: float = Field(ge=0, le=20)
    min_island_m2: float = Field(ge=0)
    components: Literal["largest", "spawn"] | list[tuple[float, float]] = "largest"
    min_tunnel_m2: float = Field(gt=0)
    max_workings_share: float = Field(gt=0, lt=1)
    trace: Literal["pixels", "half_level"] = Field(
        "pixels", description="along the pixels' borders, or along the half level of the grey values"
    )
    tolerance_m: float | None = Field(ge=0, le=50, description="null: the fewest vertices that keep wall_error_m")
    wall_error_m: float = Field(
        0.03, ge=0.002, le=1, description="mean distance of the traced wall from the simplified one"
    )
    network: NetworkParams
    openings: bool = Field(False, description="build the shafts of a survey with heights; not with visible rock")
    correct: Literal["sweeps"] | None = None
    poses: PosesParams | None = None
