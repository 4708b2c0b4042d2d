"""Physics models of parts of a mine for robots that fly: tiles are cubes, and all that they touch is rock."""

from __future__ import annotations

import mujoco
import numpy as np

from minexplore.bundle import MINE_BODY
from minexplore.physics.local_models import Box, LocalModels
from minexplore.physics.robot_kind import Robot
from minexplore.tiles import Tile, tiles_at

CUBE_M = 4.0  # side of a tile
_AIR = (1.225, 1.8e-5)  # density, kg/m3, and viscosity, Pa s, at 15 deg C


class FlyerModels(LocalModels):
    """Physics models of a world, one a cube of the mine frame, each with one robot and the same state layout."""

    def tiles_of(self, xyz: np.ndarray) -> np.ndarray:
        """Return each place's cube (n, 3), mine frame; a whole world has one."""
        return np.zeros((len(xyz), 3), dtype=int) if self.whole else tiles_at(xyz, CUBE_M)

    def spec(self, tile: Tile | None, robots: tuple[str, ...] = ("robot",)) -> mujoco.MjSpec:
        """Return a physics model's spec; without a tile it holds all parts."""
        box = None
        if tile is not None and not self.whole:
            low, high = self.reach(np.array(tile), CUBE_M)
            box = Box(low[:2], high[:2], is_exact=True)
        spec = self.rock_spec(box)
        add_flyers(spec, self.robot, robots)
        return spec


def add_flyers(spec: mujoco.MjSpec, robot: Robot, names: tuple[str, ...]) -> None:
    """Add air and robots that fly to a spec of rock, each with a sensor that counts all that its guard touches."""
    spec.option.density, spec.option.viscosity = _AIR
    for name in names:
        robot.attach(spec, name)
        spec.add_sensor(
            name=f"{name}_touches_rock",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=f"{name}_chassis",
            reftype=mujoco.mjtObj.mjOBJ_XBODY,
            refname=MINE_BODY,
            intprm=[1, 0, 1],
        )
