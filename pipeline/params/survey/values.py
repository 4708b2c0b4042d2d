"""The types of values in a survey's section: places, ranges, grades, and pieces of a survey."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

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


def _as_texts(columns: Any) -> Any:
    """Return columns as texts, also where YAML reads a number."""
    return {str(k): str(v) for k, v in columns.items()} if isinstance(columns, dict) else columns


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

Columns = Annotated[dict[str, str], BeforeValidator(_as_texts), Field(min_length=1, max_length=20)]
"""Our columns of a station table, and the table's names of them, or their numbers."""


GRADES_NEED = "a grade for each leg needs a station table (.csv), whose legs have names; state one number"
