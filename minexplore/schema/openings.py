"""The table of a world's openings: shafts from a floor with heights down to a lower one, or to a blind end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import COLLAR_CORNERS, FLOOR, RECORD, BundleError
from minexplore.floor import Floor
from minexplore.schema.model import REACH_M
from minexplore.schema.rules import Rule, list_of, number, one_of, same_json, whole

MOST_OPENINGS = 10_000
_MOST_SHEETS = 1000
_CORNER_M = 1e-6
_LEAST_M2 = 0.01

OPENING: dict[str, Rule] = {
    "outline_m": list_of(list_of(number(-REACH_M, REACH_M), 2), COLLAR_CORNERS),
    "sheet": whole(0, _MOST_SHEETS - 1),
    "below": one_of(whole(0, _MOST_SHEETS - 1), same_json(None)),
    "top_m": number(-REACH_M, REACH_M),
    "bottom_m": number(-REACH_M, REACH_M),
}
FENCED = one_of(same_json(True), same_json(False))


def check_openings(record: Mapping[str, Any], floor: Floor) -> None:
    """Compare the openings of a record with the floor's mesh: each is a convex hole in it, and leads down.

    Raises
    ------
    BundleError
        With the opening and what is wrong.
    """
    edges = floor.wall_edges() if record.get("openings") else []
    corners = np.array([floor.vertices[a, :2] for _, (a, _) in edges])
    for at, opening in enumerate(record.get("openings", [])):
        where, outline = f"{RECORD}: openings[{at}]", np.array(opening["outline_m"])
        if max(opening["sheet"], opening["below"] or 0) >= len(floor.offset_m) or opening["sheet"] == opening["below"]:
            raise BundleError(f"{where}: from sheet {opening['sheet']} to {opening['below']}, {FLOOR} has others")
        if not opening["bottom_m"] < opening["top_m"]:
            raise BundleError(f"{where}.bottom_m = {opening['bottom_m']}: want less than top_m = {opening['top_m']}")
        along = np.roll(outline, -1, axis=0) - outline
        ahead = np.roll(along, -1, axis=0)
        if (along[:, 0] * ahead[:, 1] - along[:, 1] * ahead[:, 0]).min() < _LEAST_M2:
            raise BundleError(f"{where}.outline_m = {opening['outline_m']}: want a convex, counter-clockwise outline")
        apart = np.abs(outline[:, None] - corners[None]).max(axis=2).min(axis=1)
        if apart.max() > _CORNER_M or (floor.sheets_at(outline) != opening["sheet"]).any():
            raise BundleError(f"{where}.outline_m: a corner that is not on the boundary of sheet {opening['sheet']}")
