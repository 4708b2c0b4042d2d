"""Locate scans in the mine: one similarity maps all surveyed poses, and each scan has a small correction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from minesurveys.errors import GeometryError

Pose = tuple[float, float, float]  # x, y (m), heading (rad)
Fan = tuple[np.ndarray, np.ndarray]  # bearings (n,) rad in the scanner's frame, ranges (n,) m
CastFan = Callable[[np.ndarray, np.ndarray], np.ndarray]  # places (n, 2), bearings (n, k) rad -> ranges (n, k) m
Contains = Callable[[np.ndarray], np.ndarray]  # places (n, 2) -> bool (n,)

_CELL_M, _TURN_STEP, _HEADING_STEP = 0.5, math.radians(0.25), math.radians(1.0)
_SCALE_STEP = 0.002
_LOSS_M = (
    0.2  # scale of Cauchy's loss, about the error of an outline; from 0.15 to 0.4 the result's scale stays within 0.1 %
)
_FAR_M = 5.0  # larger errors count as this
_FAN = 240
_FARTHEST_M = 400.0
_CORRECTION_WEIGHT = 0.2  # cost of a correction at its bound, in units of the mean Cauchy loss
_UNREACHED = 1e3  # cost of a place outside the workings, above any real cost; the erosion accepts no infinity
_BEYOND_BOUND = 1e3  # slope of the cost beyond a correction's bound
_AS_GOOD = 1.05  # scales whose cost is within 5 % of the best are in the interval


@dataclass(frozen=True)
class Search:
    """Bounds of the search: scales (low, high), turn and shift of all poses together, correction of each scan.

    The penalty of a correction is `_CORRECTION_WEIGHT` times the square of its share of the bound.
    """

    scale: tuple[float, float]
    turn_rad: float
    shift_m: float
    correction_m: float
    correction_rad: float


@dataclass(frozen=True)
class Similarity:
    """Map from the survey frame to the mine frame: scale, turn, shift (m, rad)."""

    scale: float
    turn_rad: float
    east_m: float
    north_m: float

    def place(self, pose: Pose) -> Pose:
        """Return a pose of the survey in the mine frame."""
        c, s = self.scale * math.cos(self.turn_rad), self.scale * math.sin(self.turn_rad)
        x, y, heading = pose
        return c * x - s * y + self.east_m, s * x + c * y + self.north_m, heading + self.turn_rad


@dataclass(frozen=True)
class Registration:
    """The similarity, the interval of scales that fit nearly as well, and each scan's pose and correction."""

    similarity: Similarity
    scale_interval: tuple[float, float]
    poses: dict[str, Pose]
    corrections: dict[str, Pose]


def register_scans(
    poses: dict[str, Pose],
    scans: dict[str, Fan],
    cast: CastFan,
    inside: Contains,
    search: Search,
    fine: dict[str, Fan] | None = None,
) -> Registration:
    """Find where scans were taken: cast their bearings in the mine and compare the ranges.

    The cost of each scan is computed once on a grid of places and headings. The cost of a similarity is the sum over
    the scans of the least cost plus penalty near the place that it gives. Every similarity of the search is tried: many
    places along a straight drift look alike, and a local search could stop at a wrong one. The poses are then refined.

    Parameters
    ----------
    poses : dict of (x, y, heading)
        m, rad, survey frame: its axes and origin differ from the mine frame's by no more than the search.
    scans : dict of (bearings (n,), ranges (n,))
    cast : callable
        Ranges, m, in the mine from places (n, 2) m at bearings (n, k) rad of the mine frame.
    inside : callable
        Whether places (n, 2) m lie in the workings.
    search : Search
    fine : dict, optional
        The returns used to refine the poses, all by default; near returns at steep incidence are the most exact.

    Raises
    ------
    GeometryError
        If no pose of the search lies in the workings, or a pose lies too far from the survey's origin.
    """
    fields = {name: ScanCostGrid(poses[name], fan, cast, inside, search) for name, fan in sorted(scans.items())}
    turns = np.arange(-search.turn_rad, search.turn_rad + 1e-9, _TURN_STEP)
    scales = np.arange(search.scale[0], search.scale[1] + 1e-9, _SCALE_STEP)
    profile, best = np.full(len(scales), np.inf), Similarity(1.0, 0.0, 0.0, 0.0)
    steps = round(search.shift_m / _CELL_M)
    for turn in turns:
        costs = {name: field.with_corrections(turn) for name, field in fields.items()}
        for k, scale in enumerate(scales):
            about = Similarity(scale, turn, 0.0, 0.0)
            total = np.sum(
                [fields[name].window(costs[name], about.place(poses[name]), steps) for name in fields], axis=0
            )
            row, col = np.unravel_index(int(total.argmin()), total.shape)
            if total[row, col] < profile.min():
                best = Similarity(scale, turn, (col - steps) * _CELL_M, (row - steps) * _CELL_M)
            profile[k] = min(profile[k], total[row, col])
    if not np.isfinite(profile).any():
        raise GeometryError("registration: no pose lies in the workings within the bounds of the search")
    as_good = scales[profile <= _AS_GOOD * profile.min()]
    placed = {name: field.refined(best, cast, (fine or scans)[name]) for name, field in fields.items()}
    similarity = _similarity_between([poses[n] for n in placed], list(placed.values()), best)
    if not _within(_corrections(similarity, poses, placed), search):
        similarity = best  # one pose far off distorts the fit to all; the searched one stays within its bounds
    interval = sorted([float(as_good[0]), float(as_good[-1]), similarity.scale])
    return Registration(similarity, (interval[0], interval[-1]), placed, _corrections(similarity, poses, placed))


def _corrections(similarity: Similarity, poses: dict[str, Pose], placed: dict[str, Pose]) -> dict[str, Pose]:
    corrections = {}
    for name, (x, y, heading) in placed.items():
        at = similarity.place(poses[name])
        corrections[name] = (x - at[0], y - at[1], heading - at[2])
    return corrections


def _within(corrections: dict[str, Pose], search: Search) -> bool:
    return all(
        math.hypot(dx, dy) <= search.correction_m and abs(turn) <= search.correction_rad
        for dx, dy, turn in corrections.values()
    )


class ScanCostGrid:
    """The cost of one scan over a grid of places and headings: `cost` (headings, rows, cols)."""

    def __init__(self, pose: Pose, fan: Fan, cast: CastFan, inside: Contains, search: Search) -> None:
        self.pose, self.search = pose, search
        thin = slice(None, None, max(1, len(fan[0]) // _FAN))
        bearing, measured = fan[0][thin], fan[1][thin]
        far = math.hypot(*pose[:2])
        reach = search.shift_m + search.correction_m + far * (max(abs(s - 1) for s in search.scale) + search.turn_rad)
        if reach > _FARTHEST_M:
            raise GeometryError(
                f"registration: a pose lies {far:.0f} m from the survey's origin, so its search spans {reach:.0f} m "
                f"(at most {_FARTHEST_M:g}); give poses relative to a place in the mine"
            )
        half = math.ceil(reach / _CELL_M) + 1
        self.low = np.round(np.array(pose[:2]) / _CELL_M) * _CELL_M - half * _CELL_M
        rows, cols = np.indices((2 * half + 1, 2 * half + 1))
        places = self.low + np.stack([cols, rows], axis=-1).reshape(-1, 2) * _CELL_M
        free = np.flatnonzero(inside(places))
        widest = search.turn_rad + search.correction_rad
        self.heading = pose[2] + np.arange(-widest, widest + 1e-9, _HEADING_STEP)
        self.cost = np.full((len(self.heading), *rows.shape), np.inf)
        for k, heading in enumerate(self.heading):
            at = np.broadcast_to(heading + bearing, (len(free), len(bearing)))
            self.cost[k].reshape(-1)[free] = range_loss(cast(places[free], at) - measured)

    def with_corrections(self, turn: float) -> np.ndarray:
        """Return the least cost plus penalty (rows, cols) near each place, with all poses turned by `turn` rad."""
        from scipy.ndimage import grey_erosion  # here, as `minimize` below: most surveys have no poses

        search = self.search
        off = self.heading - self.pose[2] - turn
        allowed = np.abs(off) <= search.correction_rad + 1e-9
        penalty = np.where(allowed, _penalty(off / search.correction_rad), np.inf)
        cost = (self.cost + penalty[:, None, None]).min(axis=0)
        steps = math.floor(search.correction_m / _CELL_M)
        dy, dx = np.mgrid[-steps : steps + 1, -steps : steps + 1] * _CELL_M
        distance = np.hypot(dx, dy)
        near = distance <= search.correction_m
        return grey_erosion(
            np.where(np.isfinite(cost), cost, _UNREACHED),
            footprint=near,
            structure=-_penalty(distance / search.correction_m),
            mode="constant",
            cval=_UNREACHED,
        )

    def window(self, cost: np.ndarray, pose: Pose, steps: int) -> np.ndarray:
        """Return costs (2 steps + 1, 2 steps + 1) at a pose shifted north (rows) and east by whole cells."""
        col, row = np.round((np.array(pose[:2]) - self.low) / _CELL_M).astype(int)
        near = cost[row - steps : row + steps + 1, col - steps : col + steps + 1]
        return np.where(near < _UNREACHED, near, np.inf)

    def refined(self, similarity: Similarity, cast: CastFan, fan: Fan) -> Pose:
        """Return the pose of least cost within the correction's bounds of the pose that a similarity gives."""
        from scipy.optimize import minimize

        search, about = self.search, np.array(similarity.place(self.pose))
        bound = np.array([search.correction_m, search.correction_m, search.correction_rad])

        def cost(q: np.ndarray) -> float:
            off = (q - about) / bound
            beyond = max(0.0, math.hypot(off[0], off[1]) - 1, abs(off[2]) - 1)
            loss = range_loss(cast(q[None, :2], (q[2] + fan[0])[None]) - fan[1])
            return float(loss[0]) + float(_penalty(off).sum()) + _BEYOND_BOUND * float(beyond)

        cells = np.indices(self.cost.shape[1:])
        places = self.low + np.stack([cells[1], cells[0]], axis=-1) * _CELL_M
        distance = np.linalg.norm(places - about[:2], axis=-1)
        turned = _penalty((self.heading - about[2]) / search.correction_rad)
        penalty = _penalty(distance / search.correction_m) + turned[:, None, None]
        whole = np.where(distance <= search.correction_m, self.cost + penalty, np.inf)
        k, row, col = np.unravel_index(int(whole.argmin()), whole.shape)
        start = np.array([*places[row, col], self.heading[k]])
        simplex = start + np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.01]])
        result = minimize(cost, start, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-3})
        return float(result.x[0]), float(result.x[1]), float(result.x[2])


def range_loss(error: np.ndarray) -> np.ndarray:
    """Return the mean robust loss (...,) of range errors (..., n) m."""
    return np.log1p((np.minimum(np.abs(error), _FAR_M) / _LOSS_M) ** 2).mean(axis=-1)


def _penalty(share: np.ndarray) -> np.ndarray:
    """Return the cost of corrections given as shares of their bound."""
    return _CORRECTION_WEIGHT * share**2


def _similarity_between(survey: list[Pose], mine: list[Pose], found: Similarity) -> Similarity:
    """Return the least-squares similarity between poses; `found` if there are fewer than three or all at one place.

    References
    ----------
    Umeyama 1991, doi:10.1109/34.88573
    """
    if len(survey) < 3:
        return found
    a, b = np.array(survey)[:, :2] @ [1, 1j], np.array(mine)[:, :2] @ [1, 1j]
    from_mean, to_mean = a - a.mean(), b - b.mean()
    if np.abs(from_mean).max() < 1.0:  # scans at one place do not determine the scale
        return found
    ratio = np.vdot(from_mean, to_mean) / np.vdot(from_mean, from_mean)
    shift = b.mean() - ratio * a.mean()
    return Similarity(float(abs(ratio)), float(np.angle(ratio)), float(shift.real), float(shift.imag))
