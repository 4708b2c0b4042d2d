"""Where robots are placed: the rock of a world round a place, and the floor there, of level mines and of volumes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np

from minexplore.extra.placing.robot_file import RobotStance
from minexplore.physics.local_models import Box, LocalModels
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.volume.columns import FloorColumns
from minexplore.volume.rock import PartsOfRock
from minexplore.world import World

_PATCH = 5  # places along either side of a robot's box at which the floor under it is looked up
_LOOK_M = 0.3  # over a place: a floor there is at or under it


@dataclass(frozen=True)
class Pose:
    """Where a robot is put: `x_m`, `y_m` and `yaw_rad` (0 east, counter-clockwise), and `z_m` of the mine frame.

    Without `z_m` the robot stands on the floor at a place seen from above, upright on its slope; in a mine with floors
    over each other on the highest. With `z_m` it is level in the world, whatever the floor's slope, and its lowest
    point is there, unless `stands`: then it stands on the next floor at or under that height.
    """

    x_m: float
    y_m: float
    yaw_rad: float = 0.0
    z_m: float | None = None
    stands: bool = False

    def __post_init__(self) -> None:
        """Refuse a number that is not finite, and a height whose meaning is not stated."""
        for name in ("x_m", "y_m", "yaw_rad", "z_m"):
            value = getattr(self, name)
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not (number and math.isfinite(value)) and not (name == "z_m" and value is None):
                raise ValueError(f"pose: {name} = {value!r}: want a finite number")
        if not isinstance(self.stands, bool):
            raise ValueError(f"pose: stands = {self.stands!r}: want True or False")

    @property
    def hovers(self) -> bool:
        """Return whether the robot is put into the air."""
        return self.z_m is not None and not self.stands


class Site(Protocol):
    """A world in which robots are placed; places are of the mine frame."""

    T_world_mine: np.ndarray

    def rock(self, here_m: np.ndarray, reach_m: float) -> mujoco.MjSpec:
        """Return the spec of the rock within reach of a place (3,) m; of all of it where that is infinite."""

    def floor_at(self, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Return the place (3,) m on the floor at a pose, and the floor's normal; refuse a pose in rock."""

    def rise(self, stance: RobotStance, foot_m: np.ndarray, turn: np.ndarray) -> float:
        """Return how far (m) the floor under a robot's box rises over the plane that it stands on.

        The plane goes through `foot_m` (3,); `turn` (3, 3) are the robot's axes, as columns.
        """


class LevelSite:
    """A level mine; its floor may be rough."""

    def __init__(self, world: World) -> None:
        """Read the rock."""
        self._world, self._models = world, LocalModels(world, TaskParams(), RobotParams())
        self.T_world_mine = self._models.T_world_mine

    def rock(self, here_m: np.ndarray, reach_m: float) -> mujoco.MjSpec:
        """Return the spec of the rock within reach of a place; see `Site`."""
        if not math.isfinite(reach_m):
            return self._models.rock_spec(None)
        return self._models.rock_spec(Box(here_m[:2] - reach_m, here_m[:2] + reach_m))

    def floor_at(self, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Return the place on the floor and its normal; see `Site`."""
        plan, world = np.array([pose.x_m, pose.y_m]), self._world
        col, row = np.floor((plan - world.origin_m) / world.cell_m).astype(int)
        rows, cols = world.clearance_m.shape
        if not (0 <= row < rows and 0 <= col < cols) or world.clearance_m[row, col] <= 0:
            raise _in_rock(pose)
        if pose.z_m is not None and pose.z_m < (0.0 if pose.hovers else -_LOOK_M):
            raise _in_rock(pose)
        if pose.hovers and pose.z_m > world.record["height_m"]:
            raise _in_rock(pose)
        return np.append(plan, 0.0), np.array([0.0, 0.0, 1.0])

    def rise(self, stance: RobotStance, foot_m: np.ndarray, turn: np.ndarray) -> float:
        """Return how far a rough floor rises; see `Site`."""
        return self._models.highest_m(foot_m[:2], stance.radius_m)


class VolumeSite:
    """A mine that is one volume."""

    def __init__(self, world: World) -> None:
        """Index the floors."""
        assert world.volume is not None
        self.T_world_mine, self._rock = world.T_world_mine, PartsOfRock(world, TaskParams())
        self._columns = FloorColumns(world.volume.facets)

    def rock(self, here_m: np.ndarray, reach_m: float) -> mujoco.MjSpec:
        """Return the spec of the rock within reach of a place; see `Site`."""
        return self._rock.spec(here_m - reach_m, here_m + reach_m)

    def floor_at(self, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Return the place on the floor and its normal; see `Site`."""
        plan, columns = np.array([[pose.x_m, pose.y_m]]), self._columns
        top_m = math.inf if pose.z_m is None else pose.z_m
        floors, roofs = columns.spans(columns.hits(plan), 1)
        if pose.hovers and not ((floors <= top_m) & (roofs >= top_m)).any():
            raise _in_rock(pose)
        facet = columns.facets_under(np.append(plan[0], top_m + _LOOK_M)[None])
        if facet[0] < 0:
            raise _in_rock(pose)
        normal = -columns.normals[facet[0]]
        return np.append(plan, columns.heights_on(facet, plan)), normal / np.linalg.norm(normal)

    def rise(self, stance: RobotStance, foot_m: np.ndarray, turn: np.ndarray) -> float:
        """Return how far the floor rises; see `Site`."""
        x, y = (np.linspace(stance.low_m[k], stance.high_m[k], _PATCH) - stance.origin_m[k] for k in (0, 1))
        own = np.column_stack([np.repeat(x, _PATCH), np.tile(y, _PATCH), np.zeros(_PATCH**2)])
        under = foot_m + own @ turn.T
        top = under + np.array([0.0, 0.0, stance.high_m[2] - stance.low_m[2]])  # higher floors are other ones
        facet = self._columns.facets_under(top)
        rise = self._columns.heights_on(facet, under[:, :2]) - under[:, 2]
        return float(np.fmax(0.0, rise * turn[2, 2]).max())


def site_of(world: World) -> Site:
    """Return a world as robots are placed in it."""
    return LevelSite(world) if world.volume is None else VolumeSite(world)


def _in_rock(pose: Pose) -> ValueError:
    place = f"(x, y) = ({pose.x_m:g}, {pose.y_m:g})" if pose.z_m is None else f"{(pose.x_m, pose.y_m, pose.z_m)}"
    return ValueError(
        f"pose: {place}: in rock; want a place of the workings, such as one of World.places_m(clearance_m)"
    )
