"""Stage 1: the source of the survey and of its scale."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from pipeline.params.base import DataFile, Params
from pipeline.params.floor_rules import FloorRules

PointM = tuple[float, float]


def _boxed(box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not (box[0] < box[2] and box[1] < box[3]):
        raise ValueError("want west < east and south < north")
    return box


def _rising(limits: tuple[float, float]) -> tuple[float, float]:
    if not 0 < limits[0] < limits[1]:
        raise ValueError("want 0 < low < high")
    return limits


def _by_name(grades: Any) -> Any:
    return {str(leg): grade for leg, grade in grades.items()} if isinstance(grades, dict) else grades


def _name_or_place(value: Any) -> Any:
    """Return a station's name as text, also where YAML reads a number, and a place as a tuple."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return str(value) if is_number else tuple(value) if isinstance(value, list) else value


def _kind_of_piece(value: Any) -> str:
    return "place" if isinstance(value, tuple) else "station"


def _kind_of_grade(value: Any) -> str:
    return "of_legs" if isinstance(value, dict) else "one"


BoxM = Annotated[tuple[float, float, float, float], AfterValidator(_boxed)]
BoxPx = Annotated[tuple[int, int, int, int], AfterValidator(_boxed)]
Range = Annotated[tuple[float, float], AfterValidator(_rising)]
Share = Annotated[float, Field(ge=0, le=1)]
Grey = Annotated[int, Field(ge=0, le=255)]
Elevation = Annotated[float, Field(ge=-10_000, le=10_000)]
Unit = Literal["m", "cm", "mm", "ft", "in"]
Grade = Annotated[
    Annotated[Annotated[float, Field(ge=-0.36, le=0.36)], Tag("one")]
    | Annotated[dict[str, float], BeforeValidator(_by_name), Field(min_length=1, max_length=10_000), Tag("of_legs")],
    Discriminator(_kind_of_grade),
]
"""Rise over run, or one for each of some legs by their names."""
_Metres = Annotated[float, Field(ge=-1e9, le=1e9)]
PlaceM = tuple[_Metres, _Metres, _Metres]
StartM = Annotated[tuple[_Metres, ...], Field(min_length=2, max_length=3)]
"""Easting and northing, or also the elevation."""
PieceOption = Annotated[
    Annotated[Annotated[str, Field(min_length=1, max_length=1000)], Tag("station")] | Annotated[PlaceM, Tag("place")],
    Discriminator(_kind_of_piece),
    BeforeValidator(_name_or_place),
]
"""A station by its name, or a place (easting, northing, elevation)."""


GRADES_NEED = "a grade for each leg needs a station table (.csv), whose legs have names; state one number"


class ScaleParams(Params):
    """The source of the plan's scale."""

    source: Literal["bar", "stated", "poses", "georeference"]
    bar_image: DataFile | None = None
    bar_box_px: tuple[int, int, int, int] | None = Field(None, description="col0, row0, col1, row1 in the plan")
    bar_length_m: float = Field(100.0, gt=0)
    px_per_m: float | None = Field(None, gt=0, le=1000)


class PosesParams(Params):
    """Surveyed scanner poses and their planar sweeps, which determine a scale."""

    file: DataFile
    sweeps: dict[str, DataFile] = Field(description="pose number -> sweep file")
    scale_range_px_per_m: Range
    max_range_m: float = Field(gt=0)
    max_range_var_m2: float = Field(gt=0)


class _SurveyParams(FloorRules):
    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")
    poses: PosesParams | None = None
    correct: Literal["sweeps"] | None = Field(default=None, description="stage 2 corrects walls by the sweeps of poses")
    entrance_m: StartM | None = Field(
        default=None, description="where robots start, m, mine frame, with the elevation where drifts pass over others"
    )
    labels_m: dict[str, PointM] = Field(default_factory=dict)
    grade: Grade | None = Field(
        default=None,
        description="rise over run of the floor along the drifts, away from the entrance; with a station table also "
        "{leg: grade}, in the order of the leg's stations",
    )
    heights: DataFile | None = Field(
        default=None,
        description="heights of the floor in the coordinates of the survey's file: CSV of easting_m, northing_m, "
        "elevation_m; GeoTIFF; contour lines, points or labels",
    )

    @model_validator(mode="after")
    def _heights_have_one_source(self) -> _SurveyParams:
        if self.grade is not None and self.heights is not None:
            raise ValueError("give grade or heights, not both")
        return self

    @model_validator(mode="after")
    def _legs_with_grades_have_names(self) -> _SurveyParams:
        table = str(getattr(self, "stations", getattr(self, "file", "")))
        if isinstance(self.grade, dict) and not table.lower().endswith(".csv"):
            raise ValueError(f"grade: {GRADES_NEED}")
        return self

    @model_validator(mode="after")
    def _correction_has_sweeps(self) -> _SurveyParams:
        if self.correct is not None and (self.poses is None or not self.poses.sweeps):
            raise ValueError("correct=sweeps needs poses (file, sweeps)")
        return self


class _ScaledParams(_SurveyParams):
    """A survey that is a picture with a scale."""

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
    """A station survey. It is drawn as a plan and traced like a published plan."""

    kind: Literal["stations"]
    stations: DataFile
    px_per_m: float = Field(gt=0, le=100)
    frame_m: BoxM | None = Field(None, description="west, south, east, north")
    margin_m: float = Field(ge=1)
    drawing_grey: Grey


class IgnoredColour(Params):
    """A colour that does not show workings, such as grid lines, water or notes."""

    rgb: tuple[Grey, Grey, Grey]
    within: int = Field(30, ge=0, le=255, description="largest difference in a channel")


class PlanSurveyParams(_ScaledParams):
    """A plan image: PNG, JPEG, TIFF or a page of a PDF. Workings are filled, or drawn as lines."""

    kind: Literal["plan"]
    image: DataFile
    origin_px: tuple[float, float] | None = Field(
        None, description="pixel (col, row) of the cropped and turned picture whose centre is the mine's origin"
    )
    max_megapixels: float = Field(gt=0)
    page: int = Field(1, ge=1, description="page of a PDF")
    dpi: float = Field(200.0, ge=36, le=1200, description="resolution of a PDF's page")
    crop_px: BoxPx | None = Field(None, description="col0, row0, col1, row1 in the original picture")
    turn_deg: float = Field(0.0, ge=-180, le=180, description="counter-clockwise, after cropping")
    light_on_dark: bool = False
    ignore_colours: list[IgnoredColour] = Field(default_factory=list)
    workings_only: bool = Field(
        False, description="leave out frames, labels, grids and whatever else does not look like workings"
    )
    level: int | None = Field(None, ge=1, le=99, description="which plan of several on the drawing; null: it shows one")
    line_drawing: bool = Field(False, description="walls are drawn as lines that enclose the workings")
    seeds_px: list[tuple[float, float]] = Field(
        default_factory=list, description="places (col, row) inside workings drawn as lines"
    )
    wall_gap_px: float = Field(3.0, ge=0, le=200, description="gaps in drawn walls up to this width are closed")


class _DrawnParams(_SurveyParams):
    """A survey in metres. Its workings stay vectors; a drawing serves only the pictures and the IoU."""

    px_per_m: float | None = Field(
        default=None, gt=0, le=100, description="null: 8 px/m, less if a side would exceed 6,000 px"
    )
    margin_m: float = Field(default=6.0, ge=1, le=100)
    drawing_grey: Grey = 40


class VectorSurveyParams(_DrawnParams):
    """A vector file with workings as polygons or walls as lines: DXF, GeoJSON, GeoPackage, Shapefile."""

    kind: Literal["vector"]
    file: DataFile
    layers: list[str] | None = Field(default=None, description="null: all")
    unit: Unit | None = Field(default=None, description="null: the unit that the file states")
    origin: PointM | None = Field(
        None, description="the mine frame's origin in the file's coordinates; null: chosen if needed"
    )
    snap_m: float = Field(default=0.25, ge=0, le=10, description="open ends of walls nearer than this are joined")
    elevations_m: dict[str, Elevation] | None = Field(
        default=None, description="of the floors of layers, m; null: as the file states them"
    )
    piece: PlaceM | None = Field(
        default=None,
        description="a place (m, mine frame) in the piece of levels and ramps that is built; null: the largest piece",
    )
    seeds_m: list[PointM] = Field(
        default_factory=list, description="places inside the workings; none: the workings are what the walls enclose"
    )


class PassageSurveyParams(_DrawnParams):
    """Stations with the distances to their walls: the project's CSV, Survex .svx, Compass .plt from Therion."""

    kind: Literal["passages"]
    file: DataFile
    origin: PointM | None = None
    half_width_m: float | None = Field(
        default=None,
        gt=0,
        le=20,
        description="distance to a wall that nobody measured; null: half the median width of the survey's own stations",
    )
    apart_m: float | None = Field(
        default=None,
        gt=0,
        le=50,
        description="passages less than this over or under others that they do not meet are left out; null: none are",
    )
    piece: PieceOption | None = Field(
        default=None,
        description="a station of the drivable piece that is built, by its name or by its place in the coordinates of "
        "the survey, m; null: the longest piece",
    )


class CentrelineSurveyParams(_DrawnParams):
    """Centrelines of drifts of one width in a vector file, in plan or in three dimensions."""

    kind: Literal["centrelines"]
    file: DataFile
    layers: list[str] | None = Field(default=None, description="null: all")
    unit: Unit | None = Field(default=None, description="null: the unit that the file states")
    origin: PointM | None = None
    half_width_m: float = Field(gt=0, le=20)
    snap_m: float = Field(default=0.25, ge=0, le=10, description="an end nearer than this to another line joins it")
    apart_m: float | None = Field(default=None, gt=0, le=50, description="as of passages")
    piece: PieceOption | None = Field(default=None, description="as of passages; a place is in m, mine frame")


class GridSurveyParams(_SurveyParams):
    """A ROS occupancy grid: `map.yaml` and its image."""

    kind: Literal["grid"]
    map: DataFile
    unknown_is_free: bool = False


class MineParams(Params):
    """The shape of a procedural mine; the last three parameters apply to the styles in their descriptions."""

    style: Literal["room_and_pillar", "drift_and_crosscut", "ramp", "cave"]
    size_m: Range
    width_m: Range
    loops: Share = Field(description="share of the crosscuts driven in addition to a spanning tree")
    dead_ends: Share = Field(description="share of the possible dead ends that stay dead ends")
    pillar_m: float = Field(ge=3, le=50, description="room_and_pillar")
    spacing_m: float = Field(ge=10, le=100, description="drift_and_crosscut, ramp")
    wander: Share = Field(description="cave")


class RoughWallsParams(Params):
    """Self-affine roughness of a procedural mine's walls; `rms_m` is over the band from shortest to longest."""

    rms_m: float = Field(gt=0, le=0.5)
    hurst: float = Field(gt=0, le=1)
    shortest_m: float = Field(ge=0.05, le=10)
    longest_m: float = Field(ge=0.1, le=50)


class ProceduralSurveyParams(_DrawnParams):
    """A procedural mine, generated from a seed; `as_picture` traces it from its drawing, as a plan's picture is."""

    kind: Literal["procedural"]
    seed: int = Field(ge=0)
    mine: MineParams
    rib_noise_m: float = Field(0.15, ge=0, le=1, description="standard deviation of the walls about their lines")
    rough_walls: RoughWallsParams | None = None
    as_picture: bool = False
    anti_aliased: bool = True
    jpeg_quality: int | None = Field(None, ge=30, le=100, description="null: the drawing is not compressed")


class VariantSurveyParams(_DrawnParams):
    """A random variant of another mine's workings, within the errors of a survey."""

    kind: Literal["variant"]
    workings: DataFile = Field(description="free_space.geojson or workings.geojson of the mine")
    seed: int = Field(ge=0)
    station_sd_m: float = Field(
        0.3, ge=0, le=5, description="s.d. of each coordinate of a place, correlated over reach_m"
    )
    width_sd_m: float = Field(0.1, ge=0, le=1, description="s.d. of the offset of all walls, drawn once")
    reach_m: float = Field(20.0, gt=0, le=500)


SurveyParams = Annotated[
    StationSurveyParams
    | PlanSurveyParams
    | VectorSurveyParams
    | PassageSurveyParams
    | CentrelineSurveyParams
    | GridSurveyParams
    | ProceduralSurveyParams
    | VariantSurveyParams,
    Field(discriminator="kind"),
]
