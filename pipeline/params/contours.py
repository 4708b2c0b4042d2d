"""Stage 2: from the plan's pixels to the free-space polygon and the drift network."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.params.base import Params
from pipeline.params.survey import PosesParams


class NetworkParams(Params):
    """Cells, shortest leg and stations of the drift network."""

    cell_m: float = Field(gt=0.02, le=2, description="cell of the grid that is thinned to the drift network")
    min_leg_m: float = Field(
        ge=0,
        le=50,
        description="a dead-end leg is kept if it reaches this far beyond the walls of the drift that it leaves",
    )
    station_spacing_m: float = Field(
        gt=0, le=100, description="distance between the stations along a leg of the network"
    )


class ContoursParams(Params):
    """Binarisation, cleaning, tracing and simplification."""

    threshold: Literal["otsu"] | Annotated[int, Field(ge=1, le=254)] = Field(
        description="grey value up to which a pixel is workings; otsu: found from the picture (Otsu 1979)"
    )
    annotation_chroma: int = Field(
        ge=1, le=255, description="a pixel whose channels differ by more than this is coloured annotation, not workings"
    )
    annotation_margin_m: float = Field(
        ge=0, le=5, description="width of the fringe around annotation that is removed too"
    )
    bridge_m: float = Field(ge=0, le=20, description="gaps in the workings up to twice this are closed")
    despeck_m: float = Field(ge=0, le=20, description="drawn parts thinner than twice this are removed")
    min_island_m2: float = Field(ge=0, description="smaller holes in the workings are filled; larger ones are pillars")
    components: Literal["largest", "spawn"] | list[tuple[float, float]] = Field(
        "largest",
        description="connected part that is built: the largest, that at the entrance, or that at [[x, y], ...], m",
    )
    min_tunnel_m2: float = Field(gt=0, description="a plan whose largest dark region is smaller is refused")
    max_workings_share: float = Field(
        gt=0, lt=1, description="a plan with a larger share of dark pixels is refused: it is probably inverted"
    )
    trace: Literal["pixels", "half_level"] = Field(
        "pixels", description="along the pixels' borders, or along the half level of the grey values"
    )
    tolerance_m: float | None = Field(ge=0, le=50, description="null: the fewest vertices that keep wall_error_m")
    wall_error_m: float = Field(
        0.03, ge=0.002, le=1, description="mean distance of the traced wall from the simplified one"
    )
    network: NetworkParams = Field(description="how the drift network is traced")
    correct: Literal["sweeps"] | None = Field(
        None, description="sweeps: the walls follow the survey's sweeps (docs/adr/0015); null: they stay as drawn"
    )
    poses: PosesParams | None = Field(
        None, description="the survey's poses with their sweeps, for correct=sweeps; null: none"
    )
