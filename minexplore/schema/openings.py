"""The table of a world's openings: shafts from a floor with heights down to a lower one, or to a blind end, and raises.

A raise has no upper sheet: it leads from the roof of the lower one up to a cap. A shaft that leans has bends.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from minexplore.bundle import COLLAR_CORNERS, FLOOR, RECORD, BundleError, decode_msh, mesh_file, opening_mesh
from minexplore.floors.floor import Floor
from minexplore.floors.shaft_axis import aside_at
from minexplore.schema.model import REACH_M
from minexplore.schema.readers.rules import Rule, is_number, list_of, number, one_of, same_json, whole

MOST_OPENINGS = 10_000
_MOST_SHEETS = 1000
_CORNER_M = 1e-6
_LEAST_M2 = 0.01
_FENCE_M = 1.5  # height, at most
_OVER_ROBOTS_M = 1.0  # over the floor below a shaft
_SLACK_M = 0.01
_MOST_BENDS, _LEAST_BEND_M, _MOST_LEAN = 1000, 0.1, 2.8  # heights between bends; run over fall, 20 deg of dip

OPENING: dict[str, Rule] = {
    "outline_m": list_of(list_of(number(-REACH_M, REACH_M), 2), COLLAR_CORNERS),
    "sheet": one_of(whole(0, _MOST_SHEETS - 1), same_json(None)),
    "below": one_of(whole(0, _MOST_SHEETS - 1), same_json(None)),
    "top_m": number(-REACH_M, REACH_M),
    "bottom_m": number(-REACH_M, REACH_M),
}
BENDS: dict[str, Rule] = {  # of a shaft that leans, from the highest down
    "bends_m": Rule(
        lambda value: isinstance(value, list) and 2 <= len(value) <= _MOST_BENDS and all(map(_is_place, value)),
        f"2 to {_MOST_BENDS} lists of three numbers from {-REACH_M:g} to {REACH_M:g}",
    )
}
FENCED = one_of(same_json(True), same_json(False))


def _is_place(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(is_number(v) and abs(v) <= REACH_M for v in value)


def check_opening_meshes(files: Mapping[str, bytes], record: Mapping[str, Any], floor: Floor) -> None:
    """Refuse a lining or a fence that is not within its opening, or hangs as low as robots are in the drift below.

    Raises
    ------
    BundleError
        Naming the file, how far it is outside, or its heights and the limits.
    """
    for at, opening in enumerate(record.get("openings", [])):
        outline, sheet = np.array(opening["outline_m"]), opening["sheet"]
        section = outline - floor.offset_m[opening["below"] if sheet is None else sheet]
        if sheet is None:
            collar_m = np.full(len(outline), opening["top_m"])
        else:
            corners = [int(np.abs(floor.vertices[:, :2] - corner).max(axis=1).argmin()) for corner in outline]
            collar_m = floor.vertices[corners, 2]
        along = np.roll(section, -1, axis=0) - section
        out = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        above = 0.0 if opening["below"] is None else _OVER_ROBOTS_M
        heights = {
            "fence": (collar_m.min(), collar_m.max() + _FENCE_M),
            "shaft": (opening["bottom_m"] + above, collar_m.max()),
        }
        for kind, (low, high) in heights.items():
            name = mesh_file(opening_mesh(kind, at))
            if name not in files:  # `check_fittings` says which there must be
                continue
            vertices = decode_msh(files[name]).vertices.astype(np.float64)
            bends = opening.get("bends_m", ()) if kind == "shaft" else ()
            places = vertices[:, :2] - aside_at(bends, vertices[:, 2])
            beyond = ((places[:, None] - section) * out).sum(axis=2).max()
            least, most = vertices[:, 2].min(), vertices[:, 2].max()
            if not beyond <= _SLACK_M:
                raise BundleError(f"{name}: {beyond:.3f} m outside openings[{at}], want at most {_SLACK_M:g} m")
            if not (least >= low - _SLACK_M and most <= high + _SLACK_M):
                raise BundleError(
                    f"{name}: from {least:.3f} to {most:.3f} m, openings[{at}] has {low:.3f} to {high:.3f} m"
                )


def check_openings(record: Mapping[str, Any], floor: Floor) -> None:
    """Compare the openings of a record with the floor's mesh: each is a convex hole in it or in the roof over it.

    Raises
    ------
    BundleError
        With the opening and what is wrong.
    """
    edges = floor.wall_edges() if record.get("openings") else []
    corners = np.array([floor.vertices[a, :2] for _, (a, _) in edges])
    for at, opening in enumerate(record.get("openings", [])):
        where, outline = f"{RECORD}: openings[{at}]", np.array(opening["outline_m"])
        sheet, below = opening["sheet"], opening["below"]
        leans = "bends_m" in opening
        if max(sheet or 0, below or 0) >= len(floor.offset_m) or (sheet == below and (sheet is None or not leans)):
            raise BundleError(f"{where}: from sheet {sheet} to {below}, {FLOOR} has others")
        if not opening["bottom_m"] < opening["top_m"]:
            raise BundleError(f"{where}.bottom_m = {opening['bottom_m']}: want less than top_m = {opening['top_m']}")
        if leans:
            _check_bends(f"{where}.bends_m", opening)
        along = np.roll(outline, -1, axis=0) - outline
        ahead = np.roll(along, -1, axis=0)
        if (along[:, 0] * ahead[:, 1] - along[:, 1] * ahead[:, 0]).min() < _LEAST_M2:
            raise BundleError(f"{where}.outline_m = {opening['outline_m']}: want a convex, counter-clockwise outline")
        if sheet is None:
            _check_raise(where, opening, floor, record["height_m"])
            continue
        apart = np.abs(outline[:, None] - corners[None]).max(axis=2).min(axis=1)
        if apart.max() > _CORNER_M or (floor.sheets_at(outline) != sheet).any():
            raise BundleError(f"{where}.outline_m: a corner that is not on the boundary of sheet {sheet}")


def _check_bends(where: str, opening: Mapping[str, Any]) -> None:
    """Check that a shaft's bends lie between its ends, lead down, and lean no more than what is too steep to drive."""
    bends = np.array(opening["bends_m"])
    run, drop = np.linalg.norm(np.diff(bends[:, :2], axis=0), axis=1), -np.diff(bends[:, 2])
    if not drop.min() >= _LEAST_BEND_M:
        raise BundleError(f"{where}: {drop.min():g} m from bend to bend, want at least {_LEAST_BEND_M:g} m down")
    if not (run / drop).max() <= _MOST_LEAN:
        raise BundleError(f"{where}: leans by {(run / drop).max():.2f} of its depth, want at most {_MOST_LEAN:g}")
    own = bends[-1] if opening["sheet"] is None else bends[0]
    if own[:2].any():
        raise BundleError(f"{where}: {own[:2].tolist()} beside its outline at its drift, want [0, 0]")
    if bends[0, 2] > opening["top_m"] + _SLACK_M or bends[-1, 2] < opening["bottom_m"] - _SLACK_M:
        raise BundleError(
            f"{where}: from {bends[0, 2]:g} to {bends[-1, 2]:g} m, not between {opening['top_m']:g} and "
            f"{opening['bottom_m']:g} m"
        )


def _check_raise(where: str, opening: Mapping[str, Any], floor: Floor, height_m: float) -> None:
    """Check that a raise lies over its sheet, and ends over the roof."""
    outline, below = np.array(opening["outline_m"]), opening["below"]
    if not floor.covers(outline).all() or (floor.sheets_at(outline) != below).any():
        raise BundleError(f"{where}.outline_m: a corner that is not over sheet {below}")
    roof_m = float(floor.raised(height_m).heights_at(outline).max())
    if not opening["top_m"] > roof_m:
        raise BundleError(f"{where}.top_m = {opening['top_m']}: want more than the roof's {roof_m:.3f} m")
