"""What a user may state about a survey's file on the command line. Each option is declared here and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from minesurveys.formats import FileKind
from minesurveys.frames import Unit
from minesurveys.refusals import in_own_words
from pipeline.errors import InputError
from pipeline.params.base import Params
from pipeline.params.survey import GRADES_NEED, BoxPx, Columns, Elevation, Grade, Grey, PieceOption, StartM

_MOST_PX = 1_000_000.0  # of a coordinate in a picture; a side has at most 16,384
_Px = Annotated[float, Field(ge=-_MOST_PX, le=_MOST_PX)]
BarBoxPx = tuple[_Px, _Px, _Px, _Px]
SeedPx = tuple[_Px, _Px]
Colour = tuple[Grey, Grey, Grey]
Ratio = Annotated[float, "1:N"]
"""N of a scale 1:N."""
Elevations = dict[str, Elevation]
"""The elevation of each layer that is a level, m."""


_PICTURES = (FileKind.PICTURE, FileKind.PDF)
_BODIES = (FileKind.SOLID, FileKind.CLOUD)


@dataclass(frozen=True)
class Option:
    """How a value is typed on the command line (`flags`, the name of its value), and the files it is read with."""

    flags: tuple[str, ...]
    read_with: tuple[FileKind, ...] = tuple(FileKind)
    metavar: str | None = None


def _option(flag: str, *read_with: FileKind, metavar: str | None = None) -> Option:
    return Option(tuple(flag.split()), read_with or tuple(FileKind), metavar)


class StatedOptions(Params):
    """The options of `python -m pipeline new`; None is not stated.

    The description of a field is the option's help. Its type chooses the parser of its text.
    """

    px_per_m: Annotated[float | None, _option("--px-per-m", *_PICTURES)] = Field(
        default=None, gt=0, le=1000, description="scale of a plan without a scale bar"
    )
    bar_length_m: Annotated[float | None, _option("--bar-length", *_PICTURES)] = Field(
        default=None, gt=0, le=100_000, description="length that the scale bar represents, m"
    )
    bar_box_px: Annotated[BarBoxPx | None, _option("--bar-box", *_PICTURES)] = Field(
        default=None, description="COL0,ROW0,COL1,ROW1 around the bar, px"
    )
    ratio: Annotated[Ratio | None, _option("--scale", *_PICTURES, metavar="1:N")] = Field(
        default=None,
        ge=1,
        le=1_000_000,
        description="scale of a drawing whose file states its resolution",
    )
    unit: Annotated[Unit | None, _option("--unit", FileKind.VECTOR, *_BODIES)] = Field(
        default=None, description="unit of a drawing"
    )
    half_width_m: Annotated[float | None, _option("--half-width", FileKind.VECTOR, FileKind.STATIONS)] = Field(
        default=None, gt=0, le=20, description="distance to a wall that a survey has not measured, m"
    )
    columns: Annotated[Columns | None, _option("--columns", FileKind.STATIONS, metavar="OURS=NAME,...")] = Field(
        default=None,
        description="columns of a station table with other names, such as leg=Code,easting_ft=E; or their numbers",
    )
    declination_deg: Annotated[float | None, _option("--declination", FileKind.STATIONS, metavar="DEG")] = Field(
        default=None,
        ge=-180,
        le=180,
        description="magnetic declination in place of computed ones, deg east of true north",
    )
    heights: Annotated[Path | None, _option("--heights", metavar="FILE")] = Field(
        default=None, description="the floor's heights: CSV, GeoTIFF, contour lines, LandXML"
    )
    grade: Annotated[Grade | None, _option("--grade", metavar="G or LEG=G,...")] = Field(
        default=None,
        description="rise over run along the drifts, away from the entrance; or of legs of a station table",
    )
    piece: Annotated[
        PieceOption | None, _option("--piece", FileKind.VECTOR, FileKind.STATIONS, metavar="STATION or E,N,Z")
    ] = Field(
        default=None,
        description="which piece of a survey is built, by a station of it or a place; default: the longest",
    )
    volume: Annotated[bool | None, _option("--volume", FileKind.VECTOR)] = Field(
        default=None, description="build the solids in a DXF file"
    )
    entrance_m: Annotated[StartM | None, _option("--start --entrance", metavar="E,N[,Z]")] = Field(
        default=None,
        description="where robots start: E and N in m of the mine frame, Z an elevation of the survey; default: of "
        "drifts with elevations the highest end on the largest floor, else the start of the longest drift",
    )
    layers: Annotated[list[str] | None, _option("--layer", FileKind.VECTOR, FileKind.SOLID)] = Field(
        default=None, max_length=1000, description="layer of a drawing; repeat for more layers"
    )
    elevations_m: Annotated[Elevations | None, _option("--elevation", FileKind.VECTOR, metavar="LAYER=M")] = Field(
        default=None, max_length=1000, description="elevation of a layer that is a level; repeat for more levels"
    )
    level_by: Annotated[str | None, _option("--level-by", FileKind.VECTOR, metavar="FIELD")] = Field(
        default=None,
        min_length=1,
        max_length=200,
        description="property of a shape that names its level, or is its elevation in metres",
    )
    no_elevation: Annotated[float | None, _option("--no-elevation", FileKind.VECTOR, metavar="Z")] = Field(
        default=None, description="elevation that stands for none in a drawing, in its unit: 0 or -9999"
    )
    snap_m: Annotated[float | None, _option("--snap", FileKind.VECTOR)] = Field(
        default=None, ge=0, le=10, description="largest gap between wall ends that are joined, m"
    )
    close_m: Annotated[float | None, _option("--close", FileKind.VECTOR, *_BODIES, metavar="M")] = Field(
        default=None,
        ge=0,
        le=50,
        description="widest hole of a solid that is closed, of a scan that is listed as one, m",
    )
    simplify_m: Annotated[float | None, _option("--simplify", FileKind.VECTOR, *_BODIES, metavar="M")] = Field(
        default=None,
        gt=0,
        le=0.5,
        description="how far the mesh of a solid or a scan may move when it is simplified, m",
    )
    up: Annotated[Literal["y", "z"] | None, _option("--up", FileKind.VECTOR, *_BODIES, metavar="y|z")] = Field(
        default=None, description="axis of the file of a solid or a scan that points up"
    )
    voxel_m: Annotated[float | None, _option("--voxel", *_BODIES, metavar="M")] = Field(
        default=None,
        ge=0.02,
        le=2,
        description="resolution at which the free space of a scan is found, m; a solid is then read as a scan",
    )
    trajectory: Annotated[Path | None, _option("--trajectory", *_BODIES, metavar="FILE")] = Field(
        default=None, description="where the scanner of a scan was: rows of time x y z"
    )
    page: Annotated[int | None, _option("--page", FileKind.PDF)] = Field(
        default=None, ge=1, le=100_000, description="page of a PDF"
    )
    dpi: Annotated[float | None, _option("--dpi", FileKind.PDF)] = Field(
        default=None, ge=36, le=1200, description="resolution at which a PDF page is rendered"
    )
    crop_px: Annotated[BoxPx | None, _option("--crop", *_PICTURES)] = Field(
        default=None, description="COL0,ROW0,COL1,ROW1 of a picture to read"
    )
    level: Annotated[int | None, _option("--level", *_PICTURES)] = Field(
        default=None, ge=1, le=99, description="which of several plans on a drawing, from 1"
    )
    seeds_px: Annotated[list[SeedPx] | None, _option("--seed", *_PICTURES)] = Field(
        default=None, max_length=1000, description="COL,ROW inside drawn walls"
    )
    narrowest_m: Annotated[float | None, _option("--narrowest", FileKind.GRID, metavar="M")] = Field(
        default=None, ge=0, le=10, description="free places of an occupancy grid that are narrower are left out, m"
    )
    thinnest_m: Annotated[float | None, _option("--thinnest", FileKind.GRID, metavar="M")] = Field(
        default=None, ge=0, le=10, description="walls of an occupancy grid that are thinner are made so thick, m"
    )
    wall_gap_px: Annotated[float | None, _option("--gap", *_PICTURES)] = Field(
        default=None, ge=0, le=200, description="widest gap in drawn walls that is closed, px"
    )
    ignore_colours: Annotated[list[Colour] | None, _option("--ignore", *_PICTURES)] = Field(
        default=None, max_length=100, description="R,G,B: no walls"
    )

    def values(self) -> dict[str, Any]:
        """Return the values that are stated, as JSON has them."""
        return self.model_dump(mode="json", exclude_none=True)


def option(name: str) -> Option:
    """Return how a field of `StatedOptions` is typed."""
    return next(item for item in StatedOptions.model_fields[name].metadata if isinstance(item, Option))


def state(path: Path, values: Mapping[str, Any]) -> StatedOptions:
    """Return what is stated about a file, within its limits.

    Parameters
    ----------
    path : Path
        Messages name it.
    values : mapping
        Values by the names of `StatedOptions`; None is not stated.

    Raises
    ------
    InputError
        The message names the file, the option, its value and the limit.
    """
    try:
        return StatedOptions.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        flag = option(str(first["loc"][0])).flags[0]
        raise InputError(f"{path}: {flag} = {first['input']!r:.80}: {in_own_words(first)}") from error


def require_read(path: Path, kind: FileKind, stated: StatedOptions) -> None:
    """Refuse a stated value that nothing reads with a file of this kind.

    Raises
    ------
    InputError
        The message names the file, the option, and the options that apply.
    """
    if isinstance(stated.grade, dict) and path.suffix.lower() != ".csv":
        raise InputError(f"{path}: --grade: {GRADES_NEED}")
    if stated.columns is not None and path.suffix.lower() != ".csv":
        raise InputError(f"{path}: --columns names the columns of a station table (.csv)")
    options = {name: option(name) for name in StatedOptions.model_fields}
    for name in stated.values():
        if kind not in options[name].read_with:
            known = ", ".join(sorted(option.flags[0] for option in options.values() if kind in option.read_with))
            raise InputError(f"{path}: {options[name].flags[0]} is not read with {kind}; there are {known}")
