"""Stage 1: where the survey comes from and how its scale is known."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from pipeline.params.base import DataFile, Params

PointM = tuple[float, float]


def _boxed(box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not (box[0] < box[2] and box[1] < box[3]):
        raise ValueError("want west < east and south < north")
    return box


def _rising(limits: tuple[float, float]) -> tuple[float, float]:
    if not 0 < limits[0] < limits[1]:
        raise ValueError("want 0 < low < high")
    return limits


BoxM = Annotated[tuple[float, float, float, float], AfterValidator(_boxed)]
BoxPx = Annotated[tuple[int, int, int, int], AfterValidator(_boxed)]
Range = Annotated[tuple[float, float], AfterValidator(_rising)]
Share = Annotated[float, Field(ge=0, le=1)]
Grey = Annotated[int, Field(ge=0, le=255)]
Unit = Literal["m", "cm", "mm", "ft", "in"]


class ScaleParams(Params):
    """How metres are read off the plan."""

    source: Literal["bar", "stated", "poses", "georeference"]
    bar_image: DataFile | None = None
    bar_box_px: tuple[int, int, int, int] | None = Field(None, description="col0, row0, col1, row1 in the plan")
    bar_length_m: float = Field(100.0, gt=0)
    px_per_m: float | None = Field(None, gt=0, le=1000)


class PosesParams(Params):
    """Surveyed scanner poses and their planar sweeps, from which a scale can be derived."""

    file: DataFile
    sweeps: dict[str, DataFile] = Field(description="pose number -> sweep file")
    scale_range_px_per_m: Range
    max_range_m: float = Field(gt=0)
    max_range_var_m2: float = Field(gt=0)


class _SurveyParams(Params):
    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")
    poses: PosesParams | None = None
    entrance_m: PointM | None = None
    labels_m: dict[str, PointM] = Field(default_factory=dict)


class _ScaledParams(_SurveyParams):
    """A survey whose picture says how long its metre is."""

    scale: ScaleParams
    resample_width_px: int | None = Field(None, ge=64, le=20000)

    @model_validator(mode="after")
    def _scale_has_its_source(self) -> _ScaledParams:
        if self.scale.source == "stated" and self.scale.px_per_m is None:
            raise ValueError("scale.source=stated needs scale.px_per_m")
        if self.scale.source == "poses" and self.poses is None:
            raise ValueError("scale.source=poses needs poses (file, sweeps)")
        return self


class StationSurveyParams(_ScaledParams):
    """A station survey, drawn as a plan and traced from the drawing, as a published plan is."""

    kind: Literal["stations"]
    stations: DataFile
    px_per_m: float = Field(gt=0, le=100)
    frame_m: BoxM | None = Field(None, description="west, south, east, north")
    margin_m: float = Field(ge=1)
    drawing_grey: Grey


class IgnoredColour(Params):
    """A colour that is no workings: grid lines, water, notes."""

    rgb: tuple[Grey, Grey, Grey]
    within: int = Field(30, ge=0, le=255, description="largest difference in any channel")


class PlanSurveyParams(_ScaledParams):
    """A plan image: PNG, JPEG, TIFF or a page of a PDF; cropped, turned, dark or light, filled or drawn as lines."""

    kind: Literal["plan"]
    image: DataFile
    origin_px: tuple[float, float] | None = Field(
        None, description="pixel (col, row) whose centre is the mine's origin; of the cropped and turned picture"
    )
    max_megapixels: float = Field(gt=0)
    page: int = Field(1, ge=1, description="of a PDF")
    dpi: float = Field(200.0, ge=36, le=1200, description="at which a PDF's page is drawn")
    crop_px: BoxPx | None = Field(None, description="col0, row0, col1, row1 of the picture as it is")
    turn_deg: float = Field(0.0, ge=-180, le=180, description="counter-clockwise, after cropping")
    light_on_dark: bool = False
    ignore_colours: list[IgnoredColour] = Field(default_factory=list)
    line_drawing: bool = Field(False, description="walls are drawn as lines; what they enclose is the workings")
    seeds_px: list[tuple[float, float]] = Field(default_factory=list, description="inside workings drawn as lines")
    wall_gap_px: float = Field(3.0, ge=0, le=200, description="gaps in drawn walls up to this are closed")


class _DrawnParams(_SurveyParams):
    """A survey that has metres of its own: it stays as it is and is drawn for the pictures and the IoU only."""

    px_per_m: float | None = Field(
        default=None, gt=0, le=100, description="null: as fine as 8 px/m or 6,000 px a side allow"
    )
    margin_m: float = Field(default=6.0, ge=1, le=100)
    drawing_grey: Grey = 40


class VectorSurveyParams(_DrawnParams):
    """Workings as polygons or walls as lines: DXF, GeoJSON, GeoPackage, Shapefile."""

    kind: Literal["vector"]
    file: DataFile
    layers: list[str] | None = Field(default=None, description="null: all")
    unit: Unit | None = Field(default=None, description="null: what the file says")
    origin: PointM | None = Field(
        None, description="of the mine frame in the file's coordinates; null: chosen if needed"
    )
    snap_m: float = Field(default=0.25, ge=0, le=10, description="walls whose ends are nearer than this are joined")
    seeds_m: list[PointM] = Field(default_factory=list, description="inside the workings; null: what walls enclose")


class PassageSurveyParams(_DrawnParams):
    """Stations with the distances to their walls, kept as vectors: our CSV, Survex .svx, Compass .plt of Therion."""

    kind: Literal["passages"]
    file: DataFile
    origin: PointM | None = None


class GridSurveyParams(_SurveyParams):
    """A ROS occupancy grid: `map.yaml` and its picture."""

    kind: Literal["grid"]
    map: DataFile
    unknown_is_free: bool = False


class MineParams(Params):
    """What a generated mine looks like; a style uses those of the last three that it knows."""

    style: Literal["room_and_pillar", "drift_and_crosscut", "ramp", "cave"]
    size_m: Range
    width_m: Range
    loops: Share = Field(description="share of the crosscuts beyond a tree that are driven")
    dead_ends: Share = Field(description="share of the places that may end blind that do")
    pillar_m: float = Field(ge=3, le=50, description="room_and_pillar")
    spacing_m: float = Field(ge=10, le=100, description="drift_and_crosscut, ramp")
    wander: Share = Field(description="cave")


class ProceduralSurveyParams(_DrawnParams):
    """A mine that was never dug, drawn from a seed."""

    kind: Literal["procedural"]
    seed: int = Field(ge=0)
    mine: MineParams
    rib_noise_m: float = Field(0.15, ge=0, le=1, description="standard deviation of the ribs about their lines")


class VariantSurveyParams(_DrawnParams):
    """Another mine's workings as a survey of limited accuracy could have told them."""

    kind: Literal["variant"]
    workings: DataFile = Field(description="free_space.geojson or workings.geojson of the mine")
    seed: int = Field(ge=0)
    station_sd_m: float = Field(0.3, ge=0, le=5, description="of a place, correlated over the reach")
    width_sd_m: float = Field(0.1, ge=0, le=1, description="of each rib's offset, correlated over the reach")
    reach_m: float = Field(20.0, gt=0, le=500)


SurveyParams = Annotated[
    StationSurveyParams
    | PlanSurveyParams
    | VectorSurveyParams
    | PassageSurveyParams
    | GridSurveyParams
    | ProceduralSurveyParams
    | VariantSurveyParams,
    Field(discriminator="kind"),
]
