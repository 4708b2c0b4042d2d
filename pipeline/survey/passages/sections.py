"""How the sections of a passage stand: across a bend that costs little width, else square to each of its legs."""

from __future__ import annotations

import numpy as np

from pipeline.types import Points2

KEPT = 0.96  # of the survey's width: a section that two legs share leaves this to both; figures ask for 0.95
_LEAST_M = 0.05  # of a width that is compared
_NO_LENGTH_M = 1e-12
LEAST_M = 0.05  # of a width or height: a section of no area makes no solid


def sections_of(
    places_m: Points2, walls_m: Points2, may_share: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions to the left of a passage's sections, and which stations have one for both of their legs.

    The section at a station is square to the line from the station before to the one after, if both legs keep 96 % of
    the width that the survey has along them. If not, each leg has a section of its own there, square to the leg.

    Parameters
    ----------
    places_m : (n, 2) float64, m
        Stations, in plan.
    walls_m : (n, 2) float64, m
        Distances to the left and right wall.
    may_share : (n,) bool, optional
        Stations at which both legs may have one section; all if not stated.

    Returns
    -------
    (n - 1, 2, 2) float64
        Unit vectors at both ends of each leg; zeros of a leg without a length in plan.
    (n,) bool
        Whether both legs of a station have one section; never at the first and the last.
    """
    own, shared = _left_of(np.diff(places_m, axis=0)), _left_of(np.gradient(places_m, axis=0))[1:-1]
    is_shared = (np.einsum("kd,kd->k", own[:-1], shared) >= KEPT) & (np.einsum("kd,kd->k", own[1:], shared) >= KEPT)
    if may_share is not None:
        is_shared &= may_share[1:-1]
    while True:  # with another section at one end, a leg's walls change up to the other
        across = np.stack([own, own], axis=1)
        across[:-1, 1][is_shared] = across[1:, 0][is_shared] = shared[is_shared]
        kept = widths_kept(places_m, walls_m, across)
        narrow = is_shared & ((kept[:-1, 1] < KEPT) | (kept[1:, 0] < KEPT))
        if not narrow.any():
            return across, np.concatenate([[False], is_shared, [False]])
        is_shared &= ~narrow


def widths_kept(places_m: Points2, walls_m: Points2, across: np.ndarray) -> np.ndarray:
    """Return the least share (n - 1, 2) of the survey's width that each leg has near its two ends.

    A leg's walls are straight from section to section. Where a section leans over the leg, on the inside of a bend, the
    wall of the next leg takes over.

    Parameters
    ----------
    places_m, walls_m : as of `sections_of`
    across : (n - 1, 2, 2) float64
        As `sections_of` returns it, for turns below 90 deg.
    """
    stations = np.stack([places_m[:-1], places_m[1:]], axis=1)
    walls = np.stack([walls_m[:-1], walls_m[1:]], axis=1) * [1.0, -1.0]  # leg, end, side
    corners = stations[:, :, None] + across[:, :, None] * walls[..., None]
    step = stations[:, 1] - stations[:, 0]
    length = np.maximum(np.linalg.norm(step, axis=1), _NO_LENGTH_M)
    left = _left_of(step)
    kept = np.ones((len(step), 2))
    for end, other in ((0, 1), (1, 0)):
        ahead = (stations[:, other] - stations[:, end]) / length[:, None]
        beyond = corners[:, end].copy()  # the far corners of the leg before or after
        if end == 0:
            beyond[1:] = corners[:-1, 0]
        else:
            beyond[:-1] = corners[1:, 1]
        wall = np.stack([beyond, corners[:, end], corners[:, other]], axis=1) - stations[:, None, None, end]
        along, aside = np.einsum("lpsd,ld->psl", wall, ahead), np.einsum("lpsd,ld->psl", wall, left)
        for at in (np.zeros(len(step)), *along[1]):
            way = np.clip(at, 0.0, length)
            built = _line(way, along[1], aside[1], along[2], aside[2])
            built = np.where(way < along[1], _line(way, along[0], aside[0], along[1], aside[1]), built)
            stated = walls[:, end].T + way / length * (walls[:, other] - walls[:, end]).T
            width = np.maximum(stated[0] - stated[1], _LEAST_M)
            found = np.where(width > _LEAST_M, (built[0] - built[1]) / width, 1.0)
            kept[:, end] = np.minimum(kept[:, end], found)
    return kept


def _line(at: np.ndarray, x0: np.ndarray, y0: np.ndarray, x1: np.ndarray, y1: np.ndarray) -> np.ndarray:
    """Return the heights of lines from (x0, y0) to (x1, y1), x0 < x1, at places; before and beyond, that of the end."""
    share = np.clip((at - x0) / np.maximum(x1 - x0, _NO_LENGTH_M), 0.0, 1.0)
    found: np.ndarray = y0 + share * (y1 - y0)
    return found


def _left_of(heading: np.ndarray) -> np.ndarray:
    """Return the unit vectors (n, 2) to the left of headings (n, 2)."""
    heading = heading / np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), _NO_LENGTH_M)
    return np.column_stack([-heading[:, 1], heading[:, 0]])


def narrow_sections(stations: list[str], lrud: np.ndarray) -> list[str]:
    """Return a line for each section that has no area or is turned inside out."""
    sizes = np.column_stack([lrud[:, :2].sum(axis=1), lrud[:, 2:].sum(axis=1)])
    return [
        f"{station}: its {what} are {size:.2f} m apart, {LEAST_M:g} m are taken"
        for station, both in zip(stations, sizes.tolist(), strict=True)
        for what, size in zip(("walls", "roof and floor"), both, strict=True)
        if size < LEAST_M
    ]
