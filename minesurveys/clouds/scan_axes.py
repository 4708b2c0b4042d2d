"""The unit and the axes of a scan's coordinates: as stated by the user, by the file, or metres."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from minesurveys.clouds.point_blocks import PointBlock
from minesurveys.coordinates.local_plan import require_lengths
from minesurveys.coordinates.map_axes import (
    axes_of,
    coordinate_system,
    horizontal,
    require_plane,
    warn_of_heights,
    warn_of_turn,
)
from minesurveys.remarks import warn_user

_FINE_M = 0.0101  # m: steps of coordinates beyond are seen in walls
_SAME = 1e-9


@dataclass(frozen=True)
class ScanAxes:
    """Coordinates of a scan as east, north and up.

    `ways` (3, 3) makes them of stored coordinates, in the plan's `unit` of `unit_m` metres. `is_stated` is whether
    the file states that unit, `crs` its coordinate system, None if there is none.
    """

    unit: str = "m"
    unit_m: float = 1.0
    ways: list[list[float]] = field(default_factory=lambda: np.eye(3).tolist())
    is_stated: bool = False
    crs: str | None = None

    def of(self, points: np.ndarray) -> np.ndarray:
        """Return stored coordinates (n, 3) as east, north and up, in the plan's unit."""
        ways = np.array(self.ways)
        return points if (ways == np.eye(3)).all() else np.asarray(points @ ways.T)


def axes_of_scan(path: Path, block: PointBlock, unit_m: float | None) -> ScanAxes:
    """Return the axes of a file whose first points are given; remarks list what it states.

    Parameters
    ----------
    path : Path
    block : PointBlock
    unit_m : float or None
        As the user states it: it overrules the file's unit of plan and heights.

    Raises
    ------
    InputError
        If the file's coordinates are degrees, lie about the Earth's centre, or are of a stretched map.
    """
    stated = block.system
    found = ScanAxes(unit_m=1.0 if unit_m is None else unit_m)
    if stated.wkt:
        found = _of_system(path, block, stated.wkt, stated.plan_m, stated.up_m, unit_m)
    elif unit_m is None and (stated.plan_m or stated.up_m):
        plan_m = stated.plan_m or stated.up_m or 1.0
        found = ScanAxes(f"{plan_m:g} m", plan_m, _ways(np.eye(2), (stated.up_m or plan_m) / plan_m), True)
        up = f", and of heights {stated.up_m:g} m" if stated.up_m and stated.up_m != plan_m else ""
        warn_user(
            f"its header states a unit of {plan_m:g} m{up}",
            of=path.name,
            option="--unit",
            advice="--unit states another",
        )
    if (step := stated.step * found.unit_m) > _FINE_M:
        warn_user(
            f"its coordinates come in steps of {step:.3g} m, and so do walls; export it with a scale factor of 0.001 m",
            of=path.name,
        )
    return found


def _of_system(
    path: Path, block: PointBlock, text: str, plan_m: float | None, up_m: float | None, unit_m: float | None
) -> ScanAxes:
    system = coordinate_system(path, text)
    axes, place = axes_of(system), block.points[0]
    code = horizontal(system).to_authority()
    crs = ":".join(code) if code else text
    if unit_m is not None:
        warn_of_turn(path, axes)
        ways = np.eye(2) if system.is_geographic else np.array(axes.ways)
        return ScanAxes("m", unit_m, _ways(ways, math.copysign(1.0, axes.up_scale(1.0))), False, crs)
    require_plane(path, system, place)
    require_lengths(path, system, place, "points", "; --unit m reads them as they are")
    warn_of_turn(path, axes)
    plan = plan_m or axes.metres
    up = axes.up_scale(plan) if up_m is None else math.copysign(up_m, axes.up_scale(1.0))
    name = axes.unit if math.isclose(plan, axes.metres, rel_tol=_SAME) else f"{plan:g} m"
    warn_user(
        f"its coordinate system states the unit {name} ({horizontal(system).name})",
        of=path.name,
        option="--unit",
        advice="--unit states another",
    )
    if up_m is None:
        warn_of_heights(path, axes, plan)
    elif not math.isclose(up_m, plan, rel_tol=_SAME):
        warn_user(f"its header states heights in units of {up_m:g} m", of=path.name)
    return ScanAxes(name, plan, _ways(np.array(axes.ways), up / plan), True, crs)


def _ways(plan: np.ndarray, up: float) -> list[list[float]]:
    ways = np.diag([1.0, 1.0, up])
    ways[:2, :2] = plan
    return ways.tolist()
