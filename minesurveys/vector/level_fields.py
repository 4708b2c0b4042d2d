"""Levels that a property of each shape names: `--level-by FIELD`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from minesurveys.errors import NAMED, InputError, one_line
from minesurveys.guard.plain_number import plain_number
from minesurveys.remarks import warn_user
from minesurveys.vector.shapes import REACH_M, Shapes

_APART_M = 4.0  # between two floors: 3.5 m of drift and 0.5 m of rock; nearer numbers count levels
_OVERLAP_M2, _OVERLAP_SHARE = 1.0, 0.001  # of the areas: smaller overlaps come from drawing one area beside another


def require_field(path: Path, name: str, fields: list[str]) -> None:
    """Refuse the name of a property that no shape has; `InputError` lists those that there are."""
    if name not in fields:
        wanted = one_line(name, 40)
        others = f"its properties: {_listed(fields)}" if fields else "there are no properties"
        raise InputError(f"{path}: --level-by {wanted}: no shape has this property; {others}")


def _listed(fields: list[str]) -> str:
    return ", ".join(one_line(field, 40) for field in fields[:NAMED]) + (", ..." if len(fields) > NAMED else "")


def level_advice(fields: list[str]) -> list[str]:
    """Return advice on `--level-by` that names the properties of a file's shapes; none if they have no properties."""
    return [f"--level-by FIELD keeps levels apart by the value of a property ({_listed(fields)})"] if fields else []


def by_levels(fields: list[str], other: str = "") -> dict[str, str]:
    """Return the options of a remark that keep levels apart, and its advice: another one, and `level_advice`."""
    advice = [*filter(None, [other]), *level_advice(fields)]
    return {"option": ", ".join(text.split()[0] for text in advice), "advice": "; ".join(advice)}


def text_of(value: Any) -> str:
    """Return the value of a property as the name of a level; empty if there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def level_elevations(path: Path, content: Shapes, field: str, stated_m: dict[str, float] | None) -> dict[str, float]:
    """Return the elevation of each level, m, by the text of its property.

    Without stated elevations, the texts are elevations in metres if all are numbers at least 4 m apart; a warning lists
    them.

    Parameters
    ----------
    path : Path
    content : Shapes
        Its layers are the texts of the property.
    field : str
        The property's name.
    stated_m : dict of str to float, or None
        Some or all elevations.

    Raises
    ------
    InputError
        If no elevations are stated and the texts are none; the message names the option for each.
    """
    if stated_m:
        return stated_m
    names = sorted({name for name in content.layer_of if name})
    try:
        elevations = {name: plain_number(name) for name in names}
        heights = sorted(elevations.values())
        is_elevation = all(abs(z) <= REACH_M for z in heights) and all(b - a >= _APART_M for a, b in pairwise(heights))
    except ValueError:
        is_elevation = False
    if not names or not is_elevation:
        options = " ".join(f"--elevation {one_line(name, 40)!r}=M" for name in names[:NAMED])
        raise InputError(
            f"{path}: --level-by {one_line(field, 40)}: its {len(names)} values are no elevations at least "
            f"{_APART_M:g} m apart; state the floor of each level in metres: {options or 'no shape has a value'}"
            f"{' ...' if len(names) > NAMED else ''}"
        )
    listed = ", ".join(sorted(names, key=elevations.__getitem__)[:NAMED]) + (", ..." if len(names) > NAMED else "")
    warn_user(
        f"levels by {one_line(field, 40)} ({listed}), taken as elevations in metres",
        of=path.name,
        count=len(names),
        option="--elevation",
        advice="--elevation VALUE=M states others",
    )
    return elevations


def warn_of_overlaps(path: Path, content: Shapes, moved: Sequence[BaseGeometry], joined: BaseGeometry) -> None:
    """Warn that areas which lie over each other are joined, as they may be those of several levels.

    Parameters
    ----------
    path : Path
    content : Shapes
        Its layers and the names of its properties say how levels are kept apart.
    moved : sequence of shapely geometry, m
        Its shapes.
    joined : shapely geometry, m
        What was made of them.
    """
    if not len(moved) or shapely.get_dimensions(moved).min() < 2:
        return  # lines enclose areas, whatever crosses them
    over_m2 = float(shapely.area([shapely.make_valid(shape) for shape in moved]).sum()) - joined.area
    if over_m2 < max(_OVERLAP_M2, _OVERLAP_SHARE * joined.area):
        return
    warn_user(
        "of its areas lie over others and are joined with them as one level",
        of=path.name,
        count=f"{over_m2:.0f} m2",
        **by_levels(content.fields, "--elevation LAYER=M keeps layers apart" if len(set(content.layer_of)) > 1 else ""),
    )
