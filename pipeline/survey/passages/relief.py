"""How a survey's distances are known, whether its legs rise or fall, and how high roofs are over the floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from minesurveys.frames import Source
from minesurveys.remarks import warn_user
from pipeline.params.floor_rules import FLOOR_RULES, FloorRules
from pipeline.survey.passages.legs import along_stations
from pipeline.survey.passages.survey_leg import SurveyLeg

_EVEN_M = 0.01  # smaller differences are rounding
_LEAST_ROOFS = 10  # measured ones that show a survey's usual one


def floor_of(leg: SurveyLeg) -> np.ndarray:
    """Return the floor's height (n,) m at the stations of a leg; a station without a distance down is on the floor."""
    assert leg.heights_m is not None
    elevation, _, down = leg.heights_m.T
    known = np.flatnonzero(np.isfinite(down))
    filled = np.interp(np.arange(len(down)), known, down[known]) if len(known) else np.zeros(len(down))
    return np.asarray(elevation - filled)


def has_relief(legs: list[SurveyLeg], rules: FloorRules = FLOOR_RULES) -> bool:
    """Return whether a survey has grades, or floors that differ in height by `flat_step_m` or more; else it is flat.

    With relief it is built as one volume, else as a level plan.

    A shaft has relief. Legs without elevations have none, also where `flat_step_m` is 0.
    """
    if any(leg.heights_m is None for leg in legs):
        return False
    if any(leg.grades is not None for leg in legs):
        return True
    floors = np.concatenate([floor_of(leg) for leg in legs])
    return bool(np.isfinite(floors).all() and np.ptp(floors) >= rules.flat_step_m)


def warn_of_level(path: Path, heights_m: np.ndarray, rules: FloorRules = FLOOR_RULES) -> None:
    """Warn that floors with these heights (n,) m are built level, if they differ; nan is no height."""
    known = heights_m[np.isfinite(heights_m)]
    rise, most = float(np.ptp(known)) if len(known) else 0.0, rules.flat_step_m
    if rise >= _EVEN_M:
        warn_user(
            f"its elevations differ by {rise:.2f} m, no more than {most:g} m, and it is built level",
            of=path.name,
            option="survey.flat_step_m=0",
            advice="survey.flat_step_m=0 builds the heights",
        )


def warn_of_level_roofs(path: Path, legs: list[SurveyLeg]) -> None:
    """Warn of measured roofs of legs with heights that are built level: such a mine has one height."""
    roofs = roofs_of(legs)
    known = [tall for tall in roofs.values() if np.isfinite(tall)]
    if known:
        warn_user(
            f"stations have a measured roof, {min(known):.2f} to {max(known):.2f} m over the floor; built "
            "level, the mine has compile3d.height_m everywhere",
            of=path.name,
            count=f"{len(known)} of {len(roofs)}",
            option="compile3d.height_m, survey.flat_step_m=0",
            advice="survey.flat_step_m=0 builds the roofs",
        )


def roofs_of(legs: list[SurveyLeg]) -> dict[str, float]:
    """Return the height of the roof over the floor, m, at each station, by name; nan where it is not known.

    Of passages that share a station the tallest counts. A survey without distances down has its stations on the floor.
    """
    over: dict[str, float] = {}
    for leg in legs:
        assert leg.heights_m is not None
        up = np.where(leg.known[:, 2] == Source.MEASURED, leg.heights_m[:, 1], np.nan)
        tall = up + np.nan_to_num(leg.heights_m[:, 2])
        for name, height, is_station in zip(leg.stations, tall.tolist(), leg.surveyed, strict=True):
            if is_station:
                over[name] = np.fmax(height, over.get(name, np.nan)).item()
    return over


def usual_roof_m(legs: list[SurveyLeg]) -> float | None:
    """Return the median height of roofs over the floor, m, if ten or more are known: fewer may be those of stopes."""
    known = [tall for tall in roofs_of(legs).values() if np.isfinite(tall)]
    return float(np.median(known)) if len(known) >= _LEAST_ROOFS else None


def heights_along(leg: SurveyLeg, tall: np.ndarray, else_m: float) -> np.ndarray:
    """Return the roof's height (n,) m over the floor along a leg; `tall` is nan where nobody measured it.

    At stations it is as `along_stations` says, and linear between them.
    """
    assert leg.heights_m is not None
    steps = np.diff(np.column_stack([leg.positions_m, leg.heights_m[:, 0]]), axis=0)
    way, own = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1))), leg.surveyed
    filled = along_stations(tall[own], else_m)
    return np.where(np.isfinite(tall), tall, np.interp(way, way[own], filled))


def warn_of_shafts(path: Path, shafts: list[SurveyLeg]) -> None:
    """Warn of plumb legs, which a level plan leaves out: their number, and the deepest."""
    if not shafts:
        return
    depths = [float(abs(np.diff(leg.heights_m[:, 0])[0])) for leg in shafts if leg.heights_m is not None]
    deepest = shafts[int(np.argmax(depths))]
    warn_user(
        f"shafts are left out, the deepest {max(depths):.1f} m, from {deepest.stations[0]} to {deepest.stations[1]}",
        of=path.name,
        count=len(shafts),
    )


def known_of(leg: SurveyLeg) -> np.ndarray:
    """Return how the distances left, right, up and down (n, 4) of the places of a leg are known (`Source`).

    Roofs that nobody measured are interpolated where half of the leg's stations or more have one.
    """
    known = leg.known.astype(np.uint8)
    roofs = known[:, 2] == Source.MEASURED
    known[~roofs, 2] = Source.INTERPOLATED if 2 * roofs[leg.surveyed].mean() >= 1 else Source.ASSUMED
    return known
