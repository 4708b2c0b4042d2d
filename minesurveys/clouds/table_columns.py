"""The columns of tables by the names that surveyors and their programs give them, and the units in those names."""

from __future__ import annotations

import re
from dataclasses import dataclass

_QUANTITIES = {  # ours first, then those of others, the more usual ones first; in lower case and without a unit
    "leg": ("drift", "strecke", "heading", "galerie", "galeria"),
    "station": ("punkt", "punktnummer", "punktnr", "punkt-nr", "pkt", "pktnr", "pkt-nr", "point", "point id", "pointid",
                "point_id", "point name", "point no", "point number", "pt", "ptid", "pt id", "pnt", "p", "stn", "punto",
                "numero", "nr", "nr.", "no", "no.", "number", "name", "id"),
    "easting": ("x", "rechtswert", "ostwert", "ost", "east", "e", "este", "est", "rw"),
    "northing": ("y", "hochwert", "nordwert", "nord", "north", "n", "norte", "hw"),
    "elevation": ("z", "height", "hoehe", "höhe", "elev", "elev.", "rl", "alt", "altitude", "cota"),
    "left": ("links",), "right": ("rechts",), "up": ("oben",), "down": ("unten",),
}  # fmt: skip
QUANTITIES = tuple(_QUANTITIES)
NAMES = ("leg", "station")  # of these quantities, those that are texts
UNITS_M = {
    **dict.fromkeys(("m", "m.", "meter", "meters", "metre", "metres"), 1.0),
    "cm": 0.01, "mm": 0.001,
    **dict.fromkeys(("ft", "ft.", "feet", "foot"), 0.3048),
    **dict.fromkeys(("usft", "us-ft", "us ft", "ftus", "sft"), 1200 / 3937),
    **dict.fromkeys(("in", "in.", "inch", "inches"), 0.0254),
}  # fmt: skip
_SUFFIX = "|".join(sorted(map(re.escape, UNITS_M), key=len, reverse=True))
_UNIT = re.compile(rf"\s*[\[(](?P<bracket>[^\])]*)[\])]$|[_ ](?P<suffix>{_SUFFIX})$")


@dataclass(frozen=True)
class NamedColumn:
    """What a column's name states: a quantity and how usual its name is, 0 for ours; and its unit, "" if none."""

    quantity: str | None
    rank: int
    unit: str

    @property
    def metres(self) -> float | None:
        """Return the metres of its unit, 1 without one; None if the unit is unknown."""
        return UNITS_M.get(self.unit, None if self.unit else 1.0)


def named_column(name: str) -> NamedColumn:
    """Return what a column's name states, in capitals or not: `Easting`, `E (ft)`, `x_ft`, `Hochwert [m]`."""
    plain = name.strip().lower()
    unit = _UNIT.search(plain)
    if unit:
        plain = plain[: unit.start()].strip()
    for quantity, others in _QUANTITIES.items():
        if plain in (quantity, *others):
            return NamedColumn(quantity, (quantity, *others).index(plain), (unit and (unit[1] or unit[2])) or "")
    return NamedColumn(None, 0, "")


def best_columns(names: list[str], quantities: tuple[str, ...] = QUANTITIES) -> dict[str, int]:
    """Return which column has each quantity: of several names the most usual, of columns of one name the first."""
    columns = [named_column(name) for name in names]
    found: dict[str, int] = {}
    for quantity in quantities:
        ranked = [(column.rank, k) for k, column in enumerate(columns) if column.quantity == quantity]
        if ranked:
            found[quantity] = min(ranked)[1]
    return found
