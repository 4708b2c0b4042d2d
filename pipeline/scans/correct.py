"""Correct a traced plan by surveyed sweeps: find the bias in width, place the sweeps, and follow them."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from minesurveys.errors import GeometryError, InputError
from pipeline.geometry.raycast import RayCaster
from pipeline.scans.poses import CORRECTION_M, CORRECTION_RAD
from pipeline.scans.registration import Fan, Pose, Registration, Search, range_loss, register_scans
from pipeline.scans.sweep_correction import cast_fan, caster_of, follow_sweeps, narrow_drifts
from pipeline.scans.sweeps import gate_returns, read_poses, read_returns, require_poses, static_returns

WALL_RANGE_M = 9.0  # beyond it a bin of 0.25 deg is wider than 4 cm
WALL_INCIDENCE_RAD = math.radians(20.0)  # at this grazing angle, an error across the wall is tripled in range
_LEAST_RETURNS = 30
_SEARCH = Search((0.95, 1.05), math.radians(2.0), 10.0, CORRECTION_M, CORRECTION_RAD)
_COARSE_M = (0.0, 0.4, 0.8, 1.2)  # offsets of a wall at which the sweeps are placed
_STEP_M = 0.1
_REACH_M = 0.6  # by which a sweep's own offset may differ from the coarse one
_STARTS_M = (-0.5, 0.5)


@dataclass(frozen=True)
class Sweeps:
    """Surveyed poses in their own frame, returns that place a scan, and those that show walls well, by name."""

    poses: dict[str, Pose]
    coarse: dict[str, Fan]
    counted: dict[str, Fan]

    def without(self, name: str) -> Sweeps:
        """Return all sweeps but one."""
        kept = [other for other in self.poses if other != name]
        return Sweeps(
            {key: self.poses[key] for key in kept},
            {key: self.coarse[key] for key in kept},
            {key: self.counted[key] for key in kept},
        )


@dataclass(frozen=True)
class CorrectionReport:
    """What sweeps correct, m.

    `bias_m` is how far each wall is moved inward where no sweep sees it, `bias_of_sweep_m` the distance at which each
    sweep fits best, and `bias_interval_m` the range of their mean when each sweep is left out. `followed_m` is the
    length of wall that follows each sweep, and `implied_scale` the survey's metre in metres of the plan.
    """

    bias_m: float
    bias_interval_m: tuple[float, float]
    bias_of_sweep_m: dict[str, float]
    followed_m: dict[str, float]
    implied_scale: float

    def summary(self) -> str:
        """Return the correction in one line."""
        low, high = self.bias_interval_m
        return (
            f"walls follow the sweeps along {sum(self.followed_m.values()):.0f} m; elsewhere each is moved inward by "
            f"{self.bias_m:.2f} m ({low:.2f} to {high:.2f} m when each of {len(self.bias_of_sweep_m)} sweeps is left "
            "out)"
        )


@dataclass(frozen=True)
class Correction:
    """The corrected free space, the report, and for pictures each sweep's pose and returns that show walls."""

    polygon: Polygon
    report: CorrectionReport
    poses: dict[str, Pose]
    fans: dict[str, Fan]


def read_sweeps(poses: Path, files: dict[str, Path], max_range_m: float, max_range_var_m2: float) -> Sweeps:
    """Read surveyed poses and their sweeps, gated for placing and for following walls.

    Raises
    ------
    InputError
        If a file cannot be read, a sweep has no pose or too few returns.
    """
    surveyed = read_poses(poses)
    returns = {name: read_returns(path) for name, path in files.items()}
    require_poses(surveyed, returns)
    coarse = {
        name: gate_returns(files[name], each, max_range_m, max_range_var_m2).fan for name, each in returns.items()
    }
    gates = WALL_RANGE_M, max_range_var_m2, WALL_INCIDENCE_RAD
    counted = {name: static_returns(each, *gates)[0].fan for name, each in returns.items()}
    bare = [name for name, fan in counted.items() if len(fan[0]) < _LEAST_RETURNS]
    if bare:
        raise InputError(
            f"{files[bare[0]]}: {len(counted[bare[0]][0])} returns show a wall (range <= {WALL_RANGE_M:g} m, at least "
            f"20 deg to the wall); at least {_LEAST_RETURNS} are needed"
        )
    return Sweeps({name: surveyed[name].planar for name in files}, coarse, counted)


def correct_by_sweeps(free: Polygon, sweeps: Sweeps) -> Correction:
    """Move walls onto the sweeps that see them, and all other walls by the mean bias that the sweeps show.

    A plan that draws drifts too wide fits a sweep at one wall only, and a placement clings to that wall. So the sweeps
    are placed in the plan at several offsets of its walls; each sweep's bias is the offset at which it fits best.

    Parameters
    ----------
    free : shapely.Polygon, m, mine frame
    sweeps : Sweeps

    Raises
    ------
    GeometryError
        If the sweeps fit nowhere, their biases have both signs, or the correction would close a drift.
    """
    return correct_by_bias(free, sweeps, sweeps, measure_bias(free, sweeps))


def correct_by_bias(free: Polygon, sweeps: Sweeps, followed: Sweeps, bias_of: dict[str, float]) -> Correction:
    """Correct walls by known biases: all sweeps are placed, and walls follow some of them."""
    bias, interval = mean_bias(bias_of)
    narrowed = narrow_drifts(free, bias)
    placed = place_sweeps(narrowed, sweeps)
    polygon, lengths = follow_sweeps(narrowed, followed.counted, placed.poses)
    report = CorrectionReport(bias, interval, bias_of, lengths, round(placed.similarity.scale, 4))
    return Correction(polygon, report, placed.poses, followed.counted)


def measure_bias(free: Polygon, sweeps: Sweeps) -> dict[str, float]:
    """Return for each sweep the distance, m, by which walls must move inward for the sweep to fit best."""
    trials: dict[float, tuple[float, dict[str, Pose]]] = {}
    for offset in _COARSE_M:
        try:
            narrowed = narrow_drifts(free, offset)
            placed = place_sweeps(narrowed, sweeps)
        except GeometryError:
            continue
        caster = caster_of(narrowed)
        cost = sum(_cost(caster, fan, np.array(placed.poses[name])) for name, fan in sweeps.counted.items())
        trials[offset] = cost, placed.poses
    if not trials:
        raise GeometryError("sweeps: no placement puts the poses into the workings")
    coarse = min(trials, key=lambda offset: trials[offset][0])
    poses = trials[coarse][1]
    offsets = np.arange(max(coarse - _REACH_M, -_REACH_M), coarse + _REACH_M + 1e-9, _STEP_M)
    costs: dict[str, list[float]] = {name: [] for name in sweeps.counted}
    for offset in offsets:
        narrowed_caster: RayCaster | None = None
        with suppress(GeometryError):  # drifts that would close
            narrowed_caster = caster_of(narrow_drifts(free, float(offset)))
        for name, fan in sweeps.counted.items():
            costs[name].append(
                np.inf if narrowed_caster is None else _least_cost(narrowed_caster, fan, np.array(poses[name]))
            )
    return {name: _lowest(offsets, np.array(each)) for name, each in costs.items()}


def mean_bias(bias_of: dict[str, float]) -> tuple[float, tuple[float, float]]:
    """Return the mean of the sweeps' biases, m, and the range of the means when each sweep is left out.

    Raises
    ------
    GeometryError
        If the sweeps disagree on its sign: then they support no correction where none of them sees a wall.
    """
    values = np.array(list(bias_of.values()))
    total = values.sum()
    left_out = (total - values) / (len(values) - 1) if len(values) > 1 else values
    if left_out.min() < 0 < left_out.max() or values.min() < 0 < values.max():
        shown = ", ".join(f"{name} {value:+.2f} m" for name, value in bias_of.items())
        raise GeometryError(f"sweeps: they disagree on whether the plan's drifts are too wide ({shown} a wall)")
    return round(float(values.mean()), 3), (round(float(left_out.min()), 3), round(float(left_out.max()), 3))


def place_sweeps(free: Polygon, sweeps: Sweeps) -> Registration:
    """Place the surveyed poses in a free space by their sweeps."""
    caster = caster_of(free)

    def cast(places: np.ndarray, bearings: np.ndarray) -> np.ndarray:
        return caster.fan(places, bearings, 0.5)

    def inside(places: np.ndarray) -> np.ndarray:
        return shapely.contains_xy(free, places[:, 0], places[:, 1])

    return register_scans(sweeps.poses, sweeps.coarse, cast, inside, _SEARCH, sweeps.counted)


def _cost(caster: RayCaster, fan: Fan, pose: np.ndarray) -> float:
    return float(range_loss(cast_fan(caster, tuple(pose), fan[0]) - fan[1]))


def _least_cost(caster: RayCaster, fan: Fan, pose: np.ndarray) -> float:
    """Return the least cost of a sweep near a pose, searched from five starts."""
    from scipy.optimize import minimize  # takes a tenth of a second to load, and most plans have no sweeps

    starts = [pose, *(pose + np.array([dx, dy, 0.0]) for dx in _STARTS_M for dy in _STARTS_M)]
    start = min(starts, key=lambda each: _cost(caster, fan, each))
    simplex = start + np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.01]])
    found = minimize(
        lambda q: _cost(caster, fan, q),
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3},
    )
    return float(found.fun)


def _lowest(offsets: np.ndarray, costs: np.ndarray) -> float:
    """Return where a parabola through the lowest cost and its neighbours is lowest."""
    k = int(np.argmin(costs))
    if not 0 < k < len(costs) - 1 or not np.isfinite(costs[k - 1 : k + 2]).all():
        return round(float(offsets[k]), 3)
    before, here, after = costs[k - 1 : k + 2]
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return round(float(offsets[k] + shift * (offsets[1] - offsets[0])), 3)
