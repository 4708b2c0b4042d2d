"""What a user may state about a survey's file on the command line: the limits of each value, and what it applies to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from pipeline.errors import InputError
from pipeline.params.base import Params
from pipeline.params.survey import GRADES_NEED, BoxPx, Elevation, Grade, Grey, PieceOption, StartM, Unit

_MOST_PX = 1_000_000.0  # of a coordinate in a picture; a side has at most 16,384
_Px = Annotated[float, Field(ge=-_MOST_PX, le=_MOST_PX)]
_Metres = Annotated[float, Field(ge=-1e9, le=1e9)]
_PICTURE = {"px_per_m", "bar_length_m", "bar_box_px", "crop_px", "level", "seeds_px", "wall_gap_px", "ignore_colours"}
_NAMES = {"bar_length_m": "bar-length", "bar_box_px": "bar-box", "entrance_m": "start", "layers": "layer",
          "snap_m": "snap", "elevations_m": "elevation", "half_width_m": "half-width", "crop_px": "crop",
          "seeds_px": "seed", "wall_gap_px": "gap", "ignore_colours": "ignore"}  # fmt: skip
APPLIES = {  # what a file is -> the options that are read with it; entrance and grade are with all
    "a picture": _PICTURE,
    "a PDF": {*_PICTURE, "page", "dpi"},
    "an occupancy grid": set(),
    "a vector file": {"unit", "layers", "snap_m", "half_width_m", "elevations_m", "piece"},
    "a station survey": {"half_width_m", "piece"},
}


class StatedOptions(Params):
    """The options of `python -m pipeline new`; None is not stated."""

    px_per_m: float | None = Field(None, gt=0, le=1000)
    bar_length_m: float | None = Field(None, gt=0, le=100_000)
    bar_box_px: tuple[_Px, _Px, _Px, _Px] | None = None
    unit: Unit | None = None
    entrance_m: StartM | None = None
    layers: list[str] | None = Field(None, max_length=1000)
    snap_m: float | None = Field(None, ge=0, le=10)
    elevations_m: dict[str, Elevation] | None = Field(None, max_length=1000)
    page: int | None = Field(None, ge=1, le=100_000)
    dpi: float | None = Field(None, ge=36, le=1200)
    half_width_m: float | None = Field(None, gt=0, le=20)
    grade: Grade | None = None
    piece: PieceOption | None = None
    crop_px: BoxPx | None = None
    level: int | None = Field(None, ge=1, le=99)
    seeds_px: list[tuple[_Px, _Px]] | None = Field(None, max_length=1000)
    wall_gap_px: float | None = Field(None, ge=0, le=200)
    ignore_colours: list[tuple[Grey, Grey, Grey]] | None = Field(None, max_length=100)


def option_of(name: str) -> str:
    """Return an option as it is typed: `--bar-length` for `bar_length_m`."""
    return f"--{_NAMES.get(name, name).replace('_', '-')}"


def require_stated(path: Path, is_a: str, stated: dict[str, Any]) -> None:
    """Refuse a stated value that is out of range, or that nothing reads with a file of this kind.

    Parameters
    ----------
    path : Path
    is_a : str
        What the file is, a key of `APPLIES`.
    stated : dict
        Values by the names of `StatedOptions`.

    Raises
    ------
    InputError
        The message names the file, the option, its value and the limit, or the options that apply.
    """
    try:
        StatedOptions.model_validate(stated)
    except ValidationError as error:
        first = error.errors()[0]
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{path}: {option_of(str(first['loc'][0]))} = {first['input']!r:.80}: {message}") from error
    if isinstance(stated.get("grade"), dict) and path.suffix.lower() != ".csv":
        raise InputError(f"{path}: --grade: {GRADES_NEED}")
    known = {*APPLIES[is_a], "entrance_m", "grade"}
    unread = [name for name, value in stated.items() if value is not None and name not in known]
    if unread:
        options = ", ".join(sorted(map(option_of, known)))
        raise InputError(f"{path}: {option_of(unread[0])} is not read with {is_a}; there are {options}")
