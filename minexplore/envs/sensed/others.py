"""What the other robots of a team are to a robot's beams and LiDARs."""

from __future__ import annotations

import numpy as np

from minexplore.physics.robot_kind import Robot
from minexplore.physics.team_stepper import TeamStepper
from minexplore.sensing.lidar import Lidar
from minexplore.sensing.scanners.caster import Hits, SurfaceCaster
from minexplore.sensing.scanners.labels import NUMBERS


class BeamsAmong:
    """Casts the beams of all robots of a team; rock stops them, and what the other robots are to beams."""

    def __init__(self, lidar: Lidar, robot: Robot, others: list[OtherRobots]) -> None:
        """Take what casts beams against rock, the robots' measures, and the others of each robot."""
        self._lidar, self._robot, self._others, self.backend = lidar, robot, others, lidar.backend

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return ranges (n, beams) m of unit rays (n, beams, 3) from the scanners (n, 3) m of all robots."""
        to_others = self._in_space if self._robot.FLIES else self._in_plan
        found: np.ndarray = np.minimum(self._lidar.cast(origins, directions), to_others(origins, directions))
        return found

    def _in_space(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return distances (n, beams) m to the other robots' guards."""
        rows = zip(self._others, origins, directions, strict=True)
        return np.stack([others.strike(origin, ways)[0] for others, origin, ways in rows])

    def _in_plan(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return distances (n, beams) m to the upright cylinders of the other robots' scanners.

        Beams count as level: robots on wheels lean by few degrees.
        """
        apart = origin[None, :, :2] - origin[:, None, :2]  # (from, to, 2)
        along = np.einsum("ibk,ijk->ijb", directions[..., :2], apart)
        across = (apart**2).sum(axis=-1)[..., None] - along**2
        half = self._robot.scanner_radius_m**2 - across
        distance = np.where((half > 0) & (along > 0), along - np.sqrt(np.maximum(half, 0.0)), np.inf)
        distance[np.arange(len(origin)), np.arange(len(origin))] = np.inf
        level = origin[:, None, None, 2] + np.where(np.isfinite(distance), distance, 0.0) * directions[:, None, :, 2]
        high = np.abs(level - origin[None, :, None, 2]) <= self._robot.scanner_height_m / 2
        return np.where(high, distance, np.inf).min(axis=1)


class OtherRobots:
    """The robots of a team but one, as that one's rays hit them in the mine frame."""

    def __init__(self, stepper: TeamStepper, robot: int, T_world_mine: np.ndarray) -> None:
        """Take what steps the team, and the number of the robot."""
        self._stepper, self._robot = stepper, robot
        self._turn, self._shift = T_world_mine[:3, :3], T_world_mine[:3, 3]

    def strike(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distances (n,) m of unit rays (n, 3), inf for no robot, and the cosines (n,) of their incidence.

        Rays start at one place (3,) m, or at places (n, 3) m.
        """
        ways = directions.astype(np.float64) @ self._turn.T
        found, normal = self._stepper.strike(self._robot, origins @ self._turn.T + self._shift, ways)
        return found, np.abs(np.einsum("ij,ij->i", normal, ways))


class SurfacesAmong:
    """Casts the rays of one robot's LiDARs at all surfaces of a world and at the other robots as they are drawn."""

    def __init__(self, surfaces: SurfaceCaster, others: OtherRobots) -> None:
        """Take what casts at the world, and the other robots."""
        self._surfaces, self._others = surfaces, others

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """Return the hits of unit rays; see `SurfaceCaster.cast`."""
        hits = self._surfaces.cast(origins, directions)
        found, cosine = self._others.strike(origins, directions)
        nearer = np.flatnonzero(found < np.minimum(hits.range_m, self._surfaces.range_m))
        hits.range_m[nearer], hits.cosine[nearer] = found[nearer], cosine[nearer]
        hits.label[nearer] = NUMBERS["robot"]
        return hits
